"""Episodes on the other representations: they drive safely, replay, and refuse what they cannot."""

from pathlib import Path

import pytest

from wayproof.harness.config import Config
from wayproof.harness.config_document import override
from wayproof.harness.errors import InputError
from wayproof.harness.log.reader import open_log
from wayproof.harness.replay.replay import replay
from wayproof.harness.runner import run_episode
from wayproof.harness.scenario.scenario import build

NEAR = "goal=[4.5, 3.0]"


def test_a_quadruped_drives_through_the_corridor_on_a_flat_grid(recorded):
    result = recorded("corridor", "quadruped", 1, "map.kind=grid2d", "episode.time_limit=5")
    assert result.outcome == "timeout", result.reason
    assert result.collisions == 0
    assert result.path_length_m > 1.5
    assert result.min_clearance_m > 0.1
    again = replay(Path(result.log))
    assert again.identical
    decisions = [record.decision for record in open_log(Path(result.log)).records()]
    assert {decision.representation for decision in decisions} == {"grid2d"}
    assert len({decision.map_version for decision in decisions}) > 45


@pytest.mark.few(1)
@pytest.mark.parametrize(
    ("kind", "settings"), [("tsdf", ("goal=[6.0, 4.0]",)), ("octomap", ("map.half_life=0", NEAR))]
)
def test_a_drone_reaches_its_goal(recorded, kind, settings):
    chosen = (f"map.kind={kind}", "map.resolution=0.2", *settings)
    result = recorded("empty", "drone", 1, *chosen)
    assert result.outcome == "success", result.reason
    assert result.collisions == 0
    assert replay(Path(result.log)).identical
    decisions = [record.decision for record in open_log(Path(result.log)).records()]
    assert {decision.representation for decision in decisions} == {kind}


def test_decay_is_refused_where_there_is_none(tmp_path):
    scenario = build(override(Config("empty", "drone", 1), ["map.kind=octomap"]))
    with pytest.raises(InputError, match=r"half_life: got 30, expected 0 with map.kind 'octomap'"):
        run_episode(scenario, tmp_path / "refused.mcap")


def test_a_flat_grid_refuses_a_drone_in_one_line(tmp_path):
    scenario = build(override(Config("empty", "drone", 1), ["map.kind=grid2d"]))
    with pytest.raises(InputError, match=r"no map for this mission: map.kind: got 'grid2d' for a"):
        run_episode(scenario, tmp_path / "refused.mcap")
