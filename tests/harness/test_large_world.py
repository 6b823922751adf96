"""Episodes in areas larger than the rolling window: ways, replays, keyframes, causes."""

from dataclasses import replace
from pathlib import Path

import pytest

from tests.harness.halls import make_hall
from wayproof.harness.attribution import find_cause, read_case
from wayproof.harness.config import Config
from wayproof.harness.config_document import override
from wayproof.harness.log.reader import open_log
from wayproof.harness.recompute import keyframes as pieces
from wayproof.harness.replay.closed_loop import simulate_again
from wayproof.harness.replay.replay import replay
from wayproof.harness.runner import run_episode
from wayproof.harness.scenario.scenario import build
from wayproof.harness.stack import keyframe

LARGE = ("world.empty.length=60", "world.empty.width=40", "costmap.window=24")
ENDS = ("start=[20.0,10.0]", "goal=[34.5,12.0]")  # 14.6 m on, beyond the first window
BRIEF = ("episode.time_limit=10", "keyframe_period=1")
ROBOTS = ("quadruped", "drone")


@pytest.fixture(scope="module")
def large(once):
    """Record a brief episode of a robot, with a map in each keyframe that is due one."""

    def record(robot, *others):
        config = override(Config("empty", robot, 0), [*LARGE, *ENDS, *BRIEF, *others])

        def run(path):
            with pytest.MonkeyPatch.context() as patch:
                patch.setattr(keyframe, "MAP_SHARE", 1.0)
                return run_episode(build(config), path)

        return Path(once(("large", robot, others), run).log)

    return record


@pytest.mark.few(1)
@pytest.mark.parametrize("robot", ROBOTS)
def test_an_episode_replays_from_its_start_and_in_pieces(large, robot, monkeypatch):
    path = large(robot)
    log = open_log(path)
    windows = {tuple(one.map.window) for one in log.keyframes() if one.HasField("map")}
    assert len(windows) > 1  # it has moved, and lies in the log
    assert replay(path).identical
    monkeypatch.setattr(pieces, "LEAST_DECISIONS", 4)
    assert replay(path, jobs=3).identical
    assert not simulate_again(path).differences


@pytest.mark.large
def test_a_robot_goes_about_as_far_as_with_the_whole_area_planned(tmp_path):
    lengths = []
    for window in (24, 0):
        settings = [f"costmap.window={window}", "start=[6.0,10.0]", "goal=[26.0,22.0]"]
        config = override(Config("hall", "drone", 0), settings)
        result = run_episode(build(config, make_hall(40.0, 1)), tmp_path / f"{window}.mcap")
        assert result.outcome == "success"
        assert result.collisions == 0
        lengths.append(result.path_length_m)
    rolling, whole = lengths
    assert rolling < 1.1 * whole


def test_a_failure_is_explained_by_the_whole_area(large):
    log = open_log(large("quadruped", "goal=[56.0,30.0]", "episode.time_limit=3"))
    assert log.result["outcome"] == "timeout"
    case = read_case(log)
    finding = find_cause(case)
    assert finding.cause == "impossible"
    assert "the shortest way takes" in finding.evidence  # to a goal far beyond the window
    vast = replace(case.mission, high=(9000.0, 9000.0, 3.0))
    segments = tuple(replace(one, mission=vast) for one in case.segments)
    finding = find_cause(replace(case, segments=segments))
    assert finding.cause == "unexplained"
    assert "too large to search" in finding.evidence
