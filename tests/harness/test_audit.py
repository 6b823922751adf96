"""The audit finds nothing wrong where nothing is, and each thing that was planted."""

import json
from pathlib import Path

import numpy as np
import pytest

from harness.cli import main
from harness.config import Config
from harness.evidence import audit as audits
from harness.evidence.audit import audit, densely
from harness.logs.reader import open_log
from harness.mission import Mission
from harness.schema import wayproof_pb2 as pb
from harness.stack.decision import path_of
from harness.stack.navigator import build_navigator
from maps import VoxelMap

SHORT = "episode.time_limit=12"


@pytest.mark.parametrize("robot", ["quadruped", "drone"])
def test_real_episodes_break_no_rule(recorded, robot):
    found = audit(Path(recorded("warehouse", robot, 1, SHORT).log))
    assert found.violations == ()
    assert found.policy == "forbid"
    assert found.decisions > 100
    assert found.swept > 50


def test_unknown_space_entered_by_leave_would_break_forbid(recorded):
    log = Path(recorded("warehouse", "drone", 1, SHORT, "map.unknown_policy=allow").log)
    assert audit(log).violations == ()
    broken = audit(log, "forbid").violations
    assert {violation.rule for violation in broken} == {"swept"}
    assert all("unknown" in violation.text for violation in broken)


def test_the_command_tells_what_broke(recorded, capsys):
    log = recorded("warehouse", "drone", 1, SHORT, "map.unknown_policy=allow").log
    assert main(["audit", log]) == 0
    assert "no violation" in capsys.readouterr().out
    assert main(["audit", log, "--policy", "forbid", "--json"]) == 1
    document = json.loads(capsys.readouterr().out)
    assert document["violations"][0]["rule"] == "swept"
    assert main(["audit", "nothing.mcap"]) == 2


@pytest.fixture
def checked(recorded):
    """Check one decision of a real log after something was done to it."""
    log = open_log(Path(recorded("warehouse", "quadruped", 1, SHORT).log))
    navigator = build_navigator(log.config, log.mission, log.beams)
    body = audits._Body(log.config, log.mission, "forbid")
    committed, target = [], None
    for record in log.records():
        version = navigator.commit(navigator.step(record.inputs), record.latency.delay_s)
        target = record.decision
        path = path_of(target.trajectory.path)
        arcs = target.trajectory.arc_length
        half = len(arcs) // 2  # it is moving there, at more than half a metre a second
        if target.action in ("follow", "explore") and min(len(path), len(arcs)) > 20:
            if arcs[half] - arcs[half - 1] > 0.05:
                break
        committed = [target.trajectory]
    else:
        raise AssertionError("no decision of the log is one to plant faults in")

    def check(change):
        changed = pb.Decision()
        changed.CopyFrom(target)
        change(changed)
        _, found = audits._check(changed, version.map_version, navigator.map, body, committed)
        return {rule for rule, _ in found}

    return check


def nothing(decision):
    del decision


def another_map(decision):
    decision.map_version = "0" * 32


def through_the_wall(decision):
    for k, point in enumerate(decision.trajectory.path):
        point.y += 0.1 * k


def recovers_into_the_wall(decision):
    decision.action = "recover"
    through_the_wall(decision)


def stops_in_the_wall(decision):
    decision.action = "stop_and_wait"
    through_the_wall(decision)


def never_at_rest(decision):
    samples = decision.trajectory.arc_length
    del samples[len(samples) // 2 :]


def beyond_its_path(decision):
    decision.trajectory.arc_length[-1] += 0.05


def too_fast(decision):
    samples = decision.trajectory.arc_length
    for k, arc in enumerate(samples):
        samples[k] = 3.0 * arc


def without_headings(decision):
    del decision.trajectory.heading[:]


def with_a_heading_less(decision):
    del decision.trajectory.heading[-1]


def from_elsewhere(decision):
    decision.trajectory.path[0].x += 0.3


@pytest.mark.parametrize(
    ("change", "rules"),
    [
        (nothing, set()),
        (another_map, {"version"}),
        (through_the_wall, {"swept"}),
        (recovers_into_the_wall, {"swept"}),
        (stops_in_the_wall, {"swept"}),
        (never_at_rest, {"rest"}),
        (beyond_its_path, {"rest"}),
        (too_fast, {"limits", "rest"}),
        (from_elsewhere, {"joined"}),
        (without_headings, {"swept"}),
        (with_a_heading_less, {"swept"}),
    ],
)
def test_each_planted_fault_is_found(checked, change, rules):
    assert rules <= checked(change)
    assert bool(rules) == bool(checked(change))


def test_a_column_by_hand():
    """Ten-centimetre layers from 17.5 cm below the floor: what a walker of 0.4 m meets."""
    mission = Mission(
        "ground", 0.3, 0.4, 0.03, 1.0, 1.0, 10.0, 1.0,
        (0.0, 0.0, -0.2), (1.0, 1.0, 2.0), (0.5, 0.5, 0.3), 0.0, (0.5, 0.5, 0.3),
    )  # fmt: skip
    body = object.__new__(audits._Body)
    body.mission = mission
    unknown, free, occupied = 0, 1, 2
    clear = [unknown, occupied, free, free, free, free, unknown]
    columns = {
        "clear": (clear, free),
        "no floor seen": ([unknown, unknown, *clear[2:]], unknown),
        "a beam through the floor": ([free, *clear[1:]], occupied),
        "a box": ([*clear[:3], occupied, *clear[4:]], occupied),
        "under a board": ([*clear[:6], occupied], free),
        "not all seen": ([*clear[:5], unknown, unknown], unknown),
    }
    states = np.array([[column for column, _ in columns.values()]], np.uint8)
    told = body._columns(states, -0.175, 0.1)
    assert told[0].tolist() == [expected for _, expected in columns.values()]


def test_only_the_discs_of_a_long_body_have_slack():
    """Free is x < 1; 0.295 m and half a diagonal of 10-cm cells are 3 cells from one's own."""
    mission = Mission(
        "ground", 0.3, 0.4, 0.03, 1.0, 1.0, 10.0, 1.0,
        (-3.0, -3.0, -0.2), (3.0, 3.0, 2.0), (0.0, 0.0, 0.3), 0.0, (0.5, 0.5, 0.3),
        discs=((-0.1, 0.2), (0.1, 0.2)),
    )  # fmt: skip
    config = Config("empty", "quadruped", 1)
    voxel_map = VoxelMap(config.map, 1, mission.low, mission.high)
    voxel_map.mark_floor((-1.0, -1.0), (1.0, 1.0), 0)
    voxel_map.mark_free((-1.0, -1.0, 0.0), (1.0, 1.0, 0.6), 0)
    body = audits._Body(config, mission, "forbid")

    def met(x, slack):
        return body._first_overlap(voxel_map, np.array([[x, 0.05, 0.3]]), 0.295, slack)

    assert met(0.695, 0.0) is None
    assert met(0.705, 0.0)[1] == "unknown"
    assert met(0.705, audits.BESIDE) is None
    assert met(0.715, audits.BESIDE)[1] == "unknown"


def test_a_stop_leaves_the_way_only_where_that_is_blocked_and_comes_no_nearer():
    """Free is x < 1 and what is beside; a ball of 0.2 m flew along x."""
    mission = Mission(
        "air", 0.2, 0.2, 0.0, 2.0, 2.0, 10.0, 1.0,
        (-3.0, -3.0, -3.0), (3.0, 3.0, 3.0), (0.0, 0.0, 1.0), 0.0, (2.0, 0.0, 1.0),
    )  # fmt: skip
    config = Config("empty", "drone", 1)
    voxel_map = VoxelMap(config.map, 1, mission.low, mission.high)
    voxel_map.mark_free((-2.0, -2.0, -0.5), (1.0, 2.0, 2.5), 0)
    body = audits._Body(config, mission, "forbid")

    def is_last_resort(way, stop):
        way, stop = (np.array([[0.2, 0.0, 1.0], *points]) for points in (way, stop))
        before = pb.Trajectory(path=[pb.Point(x=x, y=y, z=z) for x, y, z in way])
        poses = np.column_stack((stop, np.zeros(len(stop))))
        return audits._is_last_resort(stop, poses, [before], voxel_map, body, 0.1)

    ahead, short, aside = [(0.9, 0.0, 1.0)], [(0.5, 0.0, 1.0)], [(0.6, 0.3, 1.0), (0.75, 0.9, 1.0)]
    beyond = [(0.6, 0.3, 1.0), (0.98, 0.6, 1.0)]
    assert is_last_resort(ahead, aside)
    assert is_last_resort(ahead, [(0.8, 0.0, 1.0)])  # along it
    assert not is_last_resort(ahead, beyond)
    assert not is_last_resort(short, aside)


def test_points_lie_densely():
    path = densely(np.array([[0.0, 0, 0], [1.0, 0, 0], [1.0, 0.5, 0]]), 0.3)
    assert np.linalg.norm(np.diff(path, axis=0), axis=1).max() <= 0.3
    assert path[[0, 4, -1]].tolist() == [[0, 0, 0], [1, 0, 0], [1, 0.5, 0]]
