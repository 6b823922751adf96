import json
import math

import pytest

from tests.harness.bench.published.benchmark_files import barn_folder, finished
from wayproof.harness.bench.published import barn
from wayproof.harness.bench.published.trials import Trial, run_trial
from wayproof.harness.cli.main import main
from wayproof.harness.config import Config
from wayproof.harness.config_document import override
from wayproof.harness.log.codec.messages import read_messages
from wayproof.harness.log.reader import open_log
from wayproof.harness.replay.audit import audit
from wayproof.harness.replay.replay import replay
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.models.robots import ROBOTS


def test_barn_scores_by_hand():
    assert barn.barn_score(True, 4.0, 5.0) == 0.5  # faster than 2 OT counts as 2 OT
    assert barn.barn_score(True, 20.0, 5.0) == 0.25
    assert barn.barn_score(True, 49.0, 5.0) == 0.125  # slower than 8 OT counts as 8 OT
    assert barn.barn_score(False, 4.0, 5.0) == 0.0


def test_cells_and_margin_follow_from_the_body():
    spec = ROBOTS[barn.ROBOT].spec
    cell = barn.cell_size(barn.inscribed_radius(spec))
    assert cell == 0.04  # five of 0.047 m fit into 0.235 m
    assert barn.cell_size(spec.radius) == 0.09
    assert barn.margin_of(cell) == pytest.approx(math.hypot(0.02, 0.02), abs=1e-4)
    config = override(Config("warehouse", barn.ROBOT, 0), barn.settings())
    assert config.map.resolution == cell
    assert config.costmap.localization_margin == barn.margin_of(cell)


def test_a_reference_path_is_measured_from_start_to_goal(tmp_path):
    world = barn.read_barn(barn_folder(tmp_path, gap=1.6) / "world_7.world")
    by_hand = math.hypot(0.075, 2.075) + 4.5 + math.hypot(0.075, 3.425)
    assert barn.optimal_time(world) == pytest.approx(by_hand / 2.0, abs=1e-9)
    protocol = json.loads(world.protocol)
    assert (protocol["name"], protocol["speed"], protocol["clip"]) == ("barn", 2.0, [2.0, 8.0])
    assert (world.start, world.goal) == ((-2.25, 3.0, 0.0), (-2.25, 13.0, 0.0))


# The pillars leave 0.3, 0.6 and 1.5 m; the body's least disc with its margin takes 0.52 m.
@pytest.mark.parametrize(("gap", "is_open"), [(0.4, False), (0.6, True), (1.6, True)])
def test_worlds_are_open_where_the_body_fits(tmp_path, gap, is_open):
    world = barn.read_barn(barn_folder(tmp_path, gap) / "world_7.world")
    assert (barn.shortest_way(world) is not None) is is_open


@pytest.mark.parametrize("verb", ["bench", "study"])
def test_a_closed_world_is_impossible_and_not_left_out(tmp_path, capsys, verb):
    folder = str(barn_folder(tmp_path, gap=0.3))
    assert main([verb, "barn", "--worlds", folder, "--repeats", "2", "--json"]) == 0
    *rows, summary = json.loads(capsys.readouterr().out)["rows"]
    assert [(row["outcome"], row["seed"]) for row in rows] == [("impossible", 0), ("impossible", 1)]
    assert (summary["episodes"], summary["impossible"], summary["success"]) == (2, 2, 0.0)


def test_a_barn_trial_ends_a_metre_from_the_goal(tmp_path):
    world = barn.read_barn(barn_folder(tmp_path, gap=1.6) / "world_7.world")
    config = barn.barn_config(world, 4)
    track = ((0.0, -2.25, 3.0, 0.3), (14.0, -2.25, 11.9, 0.3), (14.1, -2.25, 12.1, 0.3))
    row = barn._row(finished(world, config, "collision", 15.0, track), 11.0)
    assert (row.outcome, row.time_s, row.collisions) == ("success", 14.1, 0)
    assert row.score == pytest.approx(barn.optimal_time(world) / 14.1)
    # 10 m at 1.5 m/s take less than 2 OT; OT is 10.0 m / 2 m/s = 5.0 s
    assert row.best == pytest.approx(0.5, abs=0.01)
    row = barn._row(finished(world, config, "collision", 9.0, track[:2]), 11.0)
    assert (row.outcome, row.score, row.collisions) == ("collision", 0.0, 1)


def test_a_long_body_goes_through_a_gap_in_which_it_cannot_turn(tmp_path):
    """As a disc where that leads on, as its discs in the gap; and the audit agrees."""
    world = barn.read_barn(barn_folder(tmp_path, gap=1.0) / "world_7.world")
    done = run_trial(Trial(world, barn.barn_config(world, 1), tmp_path / "a.mcap"))
    assert done.result is not None
    assert (done.result.outcome, done.result.collisions) == ("success", 0)
    decisions = [m for m in read_messages(tmp_path / "a.mcap") if isinstance(m, pb.Decision)]
    slender, wide = sorted({round(decision.inflation_radius_m, 6) for decision in decisions})
    assert wide - slender == pytest.approx(0.245)
    found = audit(tmp_path / "a.mcap")
    assert found.violations == ()
    assert found.swept > 50
    assert replay(tmp_path / "a.mcap").identical


def test_a_stack_on_trial_drives_the_trials(tmp_path, capsys):
    folder = str(barn_folder(tmp_path, gap=3.0))
    command = ["study", "barn", "--worlds", folder, "--repeats", "1", "--out", str(tmp_path)]
    assert main([*command, "--stack", "blind", "--json"]) == 0
    row, summary = json.loads(capsys.readouterr().out)["rows"]
    assert (row["outcome"], row["collisions"], summary["success"]) == ("success", 0, 1.0)
    log = open_log(tmp_path / "barn-blind" / "world_7-0.mcap")
    assert log.config.stack.name == "blind"
    assert main([*command, "--stack", "nobody"]) == 2
    assert "unknown stack.name 'nobody' (available: blind, builtin, dwa, gap" in (
        capsys.readouterr().err
    )
