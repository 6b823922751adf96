"""Keyframes: where a replay can start, and what it finds of those that are false."""

import json
import math
from dataclasses import fields, replace
from pathlib import Path

import msgspec
import numpy as np
import pytest
import zstandard

from tests.harness.replay.episodes import altered
from wayproof.harness.attribution import read_case
from wayproof.harness.cli.main import main
from wayproof.harness.explain import make_card
from wayproof.harness.log.reader import open_log
from wayproof.harness.recompute import keyframes as pieces
from wayproof.harness.recompute.keyframes import pieces_of, stack_at, startable
from wayproof.harness.replay.closed_loop import simulate_again
from wayproof.harness.replay.fork import fork
from wayproof.harness.replay.replay import replay
from wayproof.harness.replay.verify import verify
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.harness.stack import keyframe as schedule
from wayproof.harness.stack.state import (
    ClosedGap,
    Exploration,
    LostWay,
    Narrows,
    PathLoss,
    PlannerState,
    Route,
    Trails,
    Tries,
)
from wayproof.harness.stack.state_messages import read_state, state_message
from wayproof.planners import Trajectory, hold
from wayproof.planners.jerk_limited import Profile

OFTEN = ("episode.time_limit=3", "keyframe_period=1")
EPISODES = {
    "quadruped": ("corridor", "quadruped", 1, *OFTEN),
    "drone": ("forest", "drone", 4, *OFTEN),
    "half-life": ("corridor", "quadruped", 2, *OFTEN, "map.half_life=0"),
    "rrtconnect": ("forest", "drone", 3, *OFTEN, "planner.name=rrtconnect"),
    "lidar pose": ("corridor", "quadruped", 3, *OFTEN, "estimate.kind=lidar"),
    "tsdf": ("corridor", "quadruped", 1, *OFTEN, "map.kind=tsdf", "map.half_life=0"),
    "classes": ("corridor", "quadruped", 1, *OFTEN, "sensors.semantics=true"),
}


BRIEFLY = ("corridor", "quadruped", 1, "episode.time_limit=2", "keyframe_period=1")


@pytest.fixture(autouse=True)
def short_pieces(monkeypatch):
    monkeypatch.setattr(pieces, "LEAST_DECISIONS", 4)


def in_parts(log, parts):
    keyframes = startable(log, log.keyframes())
    return pieces_of(keyframes, int(log.result["decisions"]), parts)


@pytest.mark.few(3)
@pytest.mark.parametrize("name", EPISODES)
def test_pieces_from_keyframes_decide_what_the_whole_does(recorded, name):
    path = Path(recorded(*EPISODES[name]).log)
    log = open_log(path)
    assert len(in_parts(log, 3)) == 3
    whole = replay(path)
    assert whole.identical
    in_three = replay(path, jobs=3)
    assert replace(in_three, wall_time_s=0.0) == replace(whole, wall_time_s=0.0)


@pytest.mark.few(2)
@pytest.mark.parametrize("name", ["drone", "lidar pose", "classes"])
def test_a_stack_goes_on_from_each_keyframe_bit_by_bit(recorded, name):
    log = open_log(Path(recorded(*EPISODES[name]).log))
    keyframes = log.keyframes()
    maps = sum(one.HasField("map") for one in keyframes)
    assert len(keyframes) > 5
    assert (maps > 0) == (name != "classes")
    for keyframe in keyframes[::3]:
        stack = stack_at(log, keyframes, keyframe)
        for record, _ in zip(log.records(keyframe), range(5), strict=False):
            assert stack.step(record).chain == record.decision.chain


def of_filter(name, change):
    """Change what a filter remembers."""

    def edit(keyframe):
        [message] = [one for one in keyframe.map.filters if one.name == name]
        content = change(msgspec.msgpack.decode(zstandard.decompress(message.content)))
        message.content = zstandard.compress(msgspec.msgpack.encode(content))

    return edit


def of_state(**changes):
    """Add to fields of the last committed trajectory."""

    def edit(keyframe):
        last = keyframe.state.committed[-1]
        for name, value in changes.items():
            setattr(last, name, getattr(last, name) + value)

    return edit


def floor_seen(change):
    return of_filter("missing_floor", change)


def changed_byte(data, place, value):
    return data[:place] + bytes([value(data[place])]) + data[place + 1 :]


FALSE = {
    # Another map with the sizes of the right one: that of the keyframe before.
    "a wall moved": lambda one: setattr(one.map, "ticks", one.map.ticks + 1),
    "a hole": floor_seen(
        lambda seen: (changed_byte(seen[0], 80 * 161 + 80, lambda n: n + 1), seen[1])
    ),
    "walked off": floor_seen(lambda seen: (seen[0], (seen[1][0] + 1, seen[1][1]))),
    "nothing heard": of_filter(
        "lost_patches",
        lambda echoes: {
            sensor: (changed_byte(silent, 7, lambda n: 10 - n), steady)
            for sensor, (silent, steady) in echoes.items()
        },
    ),
    "another sensor": of_filter(
        "lost_patches", lambda echoes: {"another": next(iter(echoes.values()))}
    ),
    "hurried": of_state(start_ns=1),
    "forgotten": lambda one: setattr(one.state.tries, "backtracks", one.state.tries.backtracks + 1),
    "renamed": lambda one: setattr(one, "chain", "0" * 32),
}

BROKEN = {
    "cut": lambda one: setattr(one.map, "records", one.map.records[:-9]),
    "inflated": lambda one: setattr(one.map, "bricks", 2**31),
    "garbled": lambda one: setattr(one.map, "records", bytes(reversed(one.map.records))),
    "a filter lost": lambda one: one.map.filters.pop(),
    "a filter twice": lambda one: one.map.filters.append(one.map.filters[0]),
    "a tile lost": floor_seen(lambda seen: (seen[0][1:], seen[1])),
    "heard too long": of_filter(
        "lost_patches",
        lambda echoes: {sensor: (silent, 11) for sensor, (silent, _) in echoes.items()},
    ),
    "remembered too much": lambda one: setattr(
        one.map.filters[0], "content", zstandard.compress(bytes(2**20 + 1))
    ),
    "a number lost": lambda one: one.state.committed[-1].path.coordinates.pop(),
    "no number": lambda one: one.state.committed[-1].path.coordinates.__setitem__(0, math.nan),
}
OF_STATE = ("a number lost", "no number")
"""Broken in what a card is not made of."""


@pytest.mark.parametrize(
    ("name", "jobs"), [("a wall moved", 1), ("hurried", 1), *((one, 3) for one in FALSE)]
)
def test_a_false_keyframe_is_found_and_no_decision_is_blamed(recorded, tmp_path, name, jobs):
    log = open_log(Path(recorded(*BRIEFLY).log))
    number = next(one.sequence for one in log.keyframes() if one.HasField("map"))

    def falsify(message):
        if isinstance(message, pb.Keyframe) and message.sequence == number:
            FALSE[name](message)

    again = replay(altered(log.path, tmp_path / "false.mcap", falsify), jobs=jobs)
    assert not again.identical
    assert again.differing == 0
    assert any(one.field.startswith(f"/keyframe[{number}].") for one in again.contradictions)


@pytest.mark.parametrize(
    ("name", "jobs"), [("cut", 1), ("a number lost", 1), *((one, 3) for one in BROKEN)]
)
def test_a_broken_keyframe_is_a_difference_of_the_log(recorded, tmp_path, capsys, name, jobs):
    log = open_log(Path(recorded(*BRIEFLY).log))

    def damage(message):
        if isinstance(message, pb.Keyframe) and message.HasField("map"):
            BROKEN[name](message)

    path = altered(log.path, tmp_path / "broken.mcap", damage)
    again = replay(path, jobs=jobs)
    assert not again.identical
    assert again.differing == 0
    assert any(one.field.startswith("/keyframe[") for one in again.contradictions)
    assert not verify(path, simulate=False).verified
    if name not in OF_STATE:
        assert main(["explain", str(path), "18", "--unchecked"]) == 2
        assert "wayproof: keyframe after decision" in capsys.readouterr().err


def test_a_keyframe_where_the_settings_have_none_is_a_difference(recorded, tmp_path):
    path = Path(recorded(*EPISODES["quadruped"]).log)

    def misplace(message):
        if isinstance(message, pb.Keyframe):
            message.sequence += 1000

    again = replay(altered(path, tmp_path / "misplaced.mcap", misplace))
    assert {one.recomputed for one in again.contradictions} >= {"no such decision"}


def test_a_card_is_the_same_from_a_keyframe_as_from_the_start(recorded, capsys):
    path = Path(recorded(*EPISODES["drone"]).log)
    log = open_log(path)
    case = read_case(log)
    assert case.keyframe_at(3) is None
    number = len(case.moments) - 1
    assert main(["explain", str(path), str(number), "--json"]) == 0
    card = json.loads(capsys.readouterr().out)
    assert card.pop("keyframe") == case.keyframe_at(number).sequence > 0
    whole = json.loads(json.dumps(make_card(case, number).document()))
    assert whole.pop("keyframe") is None
    assert card == whole


def test_keyframes_before_a_fork_are_compared_but_not_started_from(recorded, tmp_path):
    path = Path(recorded(*EPISODES["quadruped"]).log)
    target = tmp_path / "fork.mcap"
    fork(path, 12, ["costmap.localization_margin=0.06"], target)
    log = open_log(target)
    assert startable(log, log.keyframes())[0].sequence >= 12 > log.keyframes()[0].sequence
    assert replay(target, jobs=3).identical
    assert simulate_again(target).identical


def test_no_keyframes_are_written_without_a_period_or_with_decisions_alone(recorded):
    for setting in ("keyframe_period=0", "record=decisions"):
        path = Path(recorded("empty", "drone", 1, "episode.time_limit=1", setting).log)
        messages = open_log(path).messages()
        assert not any(isinstance(message, pb.Keyframe) for message in messages)


def test_the_last_decision_is_explained_from_its_own_map(recorded):
    log = open_log(Path(recorded("empty", "drone", 1).log))
    case = read_case(log)
    last = len(case.moments) - 1
    assert [one.sequence for one in log.keyframes() if one.HasField("map")] == [last]
    keyframe = case.keyframe_at(last)
    assert keyframe is not None
    assert keyframe.sequence == last
    card = make_card(case, last, case.navigator_at(last, keyframe))
    assert card == make_card(case, last)
    assert case.keyframe_at(last - 1) is None


def test_a_log_without_room_ends_without_a_map(monkeypatch, tmp_path):
    monkeypatch.setattr(schedule, "LAST_SHARE", 0.001)
    settings = ("episode.time_limit=3", "keyframe_period=10")
    path = tmp_path / "log.mcap"
    run = ["run", "empty", "--robot", "drone", "--seed", "1", "--log", str(path)]
    main([*run, *(word for one in settings for word in ("--set", one))])
    log = open_log(path)
    keyframes = log.keyframes()
    assert [one.sequence for one in keyframes] == [25]
    assert not any(one.HasField("map") for one in keyframes)
    assert replay(path).identical


@pytest.mark.parametrize(
    ("kind", "message"),
    [
        (PlannerState, pb.PlannerState),
        (Exploration, pb.Exploration),
        (PathLoss, pb.PathLoss),
        (Route, pb.Route),
        (Tries, pb.Tries),
        (Trails, pb.Trails),
        (Narrows, pb.Narrows),
        (ClosedGap, pb.ClosedGap),
        (LostWay, pb.LostWay),
        (Trajectory, pb.CommittedTrajectory),
        (Profile, pb.Profile),
    ],
)
def test_a_keyframe_holds_every_field_of_the_state(kind, message):
    assert [one.name for one in fields(kind)] == [one.name for one in message.DESCRIPTOR.fields]


def test_closed_gaps_come_back_as_they_were_and_damaged_ones_are_refused():
    gaps = (ClosedGap((1.0, 0.1, 0.3), 1), ClosedGap((-2.0, 7.0, 0.3), 3))
    lost = LostWay((0.1, 0.2, 0.3), 4.5, 1_700_000_000)
    state = PlannerState((hold(np.zeros(3), 0, 0.0),), narrows=Narrows(True, gaps, lost))
    message = state_message(state)
    back = read_state(message)
    assert back.narrows == state.narrows
    for change in (
        lambda one: one.narrows.closed[0].place.append(1.0),
        lambda one: setattr(one.narrows.closed[1], "tries", 0),
        lambda one: setattr(one.narrows.lost, "length_m", math.nan),
        lambda one: one.narrows.closed.extend([one.narrows.closed[0]] * 1001),
    ):
        damaged = pb.PlannerState.FromString(message.SerializeToString())
        change(damaged)
        with pytest.raises(ValueError, match=r"place|closed|length_m"):
            read_state(damaged)
