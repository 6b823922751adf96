from pathlib import Path

import pytest

from wayproof.harness.config import Config
from wayproof.harness.config_document import override
from wayproof.harness.errors import InputError
from wayproof.harness.log.reader import open_log
from wayproof.harness.replay.replay import replay
from wayproof.harness.runner import run_episode
from wayproof.harness.scenario.scenario import build

OCTOMAP = ("map.kind=octomap", "map.half_life=0", "map.resolution=0.2", "goal=[4.5, 3.0]")


def test_an_episode_on_octomap_reaches_its_goal_and_replays(recorded):
    result = recorded("empty", "drone", 1, *OCTOMAP)
    assert result.outcome == "success", result.reason
    assert result.collisions == 0
    assert replay(Path(result.log)).identical
    decisions = [record.decision for record in open_log(Path(result.log)).records()]
    assert {decision.representation for decision in decisions} == {"octomap"}
    assert len({decision.map_version for decision in decisions}) > 10


def test_decay_is_refused_where_there_is_none(tmp_path):
    scenario = build(override(Config("empty", "drone", 1), ["map.kind=octomap"]))
    with pytest.raises(InputError, match=r"half_life: got 30, expected 0 with map.kind 'octomap'"):
        run_episode(scenario, tmp_path / "refused.mcap")
