"""Cards, stories and pictures of recorded episodes."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest

from wayproof.harness.attribution import read_case
from wayproof.harness.cli.main import main
from wayproof.harness.explain import make_card, phases
from wayproof.harness.log.reader import open_log
from wayproof.harness.replay.fork import fork
from wayproof.harness.schema import wayproof_pb2 as pb


@pytest.fixture
def stopped(planted, tmp_path):
    """Log of a drone before a wall across the room."""
    return Path(shutil.copyfile(planted("impossible", 1)[0], tmp_path / "wall.mcap"))


def decisions(*actions):
    found = []
    for number, action in enumerate(actions):
        decision = pb.Decision(sequence=number, action=action, reason=f"r{number}")
        decision.timestamp.FromNanoseconds(number * 10**8)
        found.append(decision)
    return found


def truths(count):
    places = ([0.1 * number, 0.0, 1.0] for number in range(count))
    return [pb.Truth(position=place, clearance_m=1.0) for place in places]


def test_a_story_joins_decisions_of_one_action():
    found = phases(decisions(*"aaaabaaaacccc"), truths(13))
    assert [(one.action, one.first, one.last) for one in found] == [("a", 0, 8), ("c", 9, 12)]
    assert found[0].distance_m == pytest.approx(0.9)
    assert (found[0].start_s, found[0].end_s) == (0.0, pytest.approx(0.9))
    assert found[0].reason == "r8"


def test_a_card_names_the_cells_in_the_way(stopped):
    case = read_case(open_log(stopped))
    card = make_card(case, len(case.moments) - 1)
    assert card.version_holds
    assert card.decision.action == "abort"
    assert card.decision.label == "no_path"
    assert 0.0 < card.mean_entropy_bits < 1.0
    assert card.oldest_evidence_s <= card.time_s
    assert {cell.state for cell in card.blocking} == {"occupied"}
    for cell in card.blocking:
        distance, name = case.space.distance(np.array(cell.place))
        assert name.startswith("partition")
        assert distance < 0.1
        assert cell.probability > 0.5


@pytest.mark.large
def test_a_card_of_a_forked_log_has_the_settings_of_its_side(recorded, tmp_path):
    log = Path(recorded("empty", "quadruped", 1, "episode.time_limit=1.5").log)
    first, again = tmp_path / "first.mcap", tmp_path / "again.mcap"
    fork(log, 6, ["map.resolution=0.08", "latency.plan=0.05"], first)
    fork(first, 9, ["sensors.lidar=velodyne-vlp16", "goal=[3.0,3.0]"], again)
    case = read_case(open_log(again))
    cards = [make_card(case, number) for number in (5, 6, 8, 9, 11)]
    assert all(card.version_holds for card in cards)
    assert [card.decision.resolution_m for card in cards] == [0.1, 0.08, 0.08, 0.08, 0.08]
    delays = [card.config.latency.expected for card in cards]
    assert delays == pytest.approx([0.05, 0.08, 0.08, 0.08, 0.08])
    assert [case.as_of(n).mission.goal[:2] == (3.0, 3.0) for n in (8, 9)] == [False, True]


def test_explain_prints_and_draws(stopped, tmp_path, capsys):
    assert main(["explain", str(stopped)]) == 0
    text = capsys.readouterr().out
    assert "cause: impossible" in text
    assert "gave up [no_path]" in text
    picture = tmp_path / "moment.png"
    assert main(["explain", str(stopped), "3", "--json", "--png", str(picture)]) == 0
    document = json.loads(capsys.readouterr().out)
    assert document["sequence"] == 3
    assert picture.read_bytes().startswith(b"\x89PNG")


def test_a_clearance_that_is_a_cap_says_so():
    from wayproof.harness.clearance import in_metres, map_clearance_is_bound, true_in_metres
    from wayproof.harness.schema import wayproof_pb2 as pb
    from wayproof.harness.viewer.words import describe

    decision = pb.Decision(resolution_m=0.1, inflation_radius_m=0.15, least_clearance_m=0.8)
    assert map_clearance_is_bound(decision, cost_range=0.6)
    assert "least clearance >= 0.80 m" in describe(decision, cost_range=0.6)
    decision.least_clearance_m = 0.1 * 63**0.5  # of 8 cells
    assert not map_clearance_is_bound(decision, cost_range=0.6)
    assert in_metres(decision.least_clearance_m, False) == "0.79 m"
    assert (true_in_metres(2.0), true_in_metres(1.04)) == (">= 2.00 m", "1.04 m")


def test_a_log_of_decisions_keeps_its_cause(recorded, capsys):
    result = recorded(
        "empty", "drone", 1, "record=decisions", "latency.plan=0.4", "episode.stuck_after=2"
    )
    assert result.cause == "latency"
    assert main(["explain", result.log]) == 0
    text = capsys.readouterr().out
    assert "cause: latency" in text
    x, y, z = list(open_log(Path(result.log)).truth())[-1].position
    assert f"at decision {result.cause_decision}; at ({x:.2f}, {y:.2f}, {z:.2f})" in text
    assert main(["explain", result.log, "3"]) == 2
    assert "sweeps were left out" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["999999"], "decision 999999: expected a decision's number, 0 to"),
        (["3", "--check"], "--check: goes with the whole episode"),
        (["--png", "/nowhere/at/all.png"], "expected a file in a folder that exists"),
        (["--png", "moment.svg"], "--png: got 'moment.svg', expected a name that ends in .png"),
        (["--png", "moment"], "--png: got 'moment', expected a name that ends in .png"),
    ],
)
def test_bad_input_is_one_line(stopped, arguments, message, capsys):
    assert main(["explain", str(stopped), *arguments]) == 2
    error = capsys.readouterr().err
    assert message in error
    assert error.count("\n") == 1
