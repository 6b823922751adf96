import gc
import itertools
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from wayproof.harness.config import Config
from wayproof.harness.config_document import override
from wayproof.harness.log.codec.container import walk
from wayproof.harness.log.codec.messages import read_messages
from wayproof.harness.log.copy import write_copy
from wayproof.harness.log.head import read_head
from wayproof.harness.log.reader import open_log
from wayproof.harness.replay.replay import replay
from wayproof.harness.runner import run_episode
from wayproof.harness.scenario.scenario import build
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.harness.stack.pipeline import Navigator
from wayproof.maps import FREE
from wayproof.models.robots import ROBOTS

DRIVING = ("follow", "slow", "explore")

EPISODES = [("empty", "drone", 1), ("empty", "quadruped", 1)]


@pytest.mark.parametrize("episode", EPISODES)
def test_reaches_the_goal_and_replays_identically(recorded, episode):
    result = recorded(*episode)
    assert result.outcome == "success", result.reason
    assert result.goal_distance_m <= 0.25
    assert result.collisions == 0
    again = replay(Path(result.log))
    assert again.identical
    assert again.decisions == result.decisions
    assert again.chain == result.chain


def test_same_seed_gives_the_same_chain(recorded, tmp_path):
    episode = EPISODES[1]
    first = recorded(*episode, "episode.time_limit=1")
    config = override(Config(*episode), ["episode.time_limit=1"])
    second = run_episode(build(config), tmp_path / "again.mcap")
    assert second.chain == first.chain
    third = run_episode(build(replace(config, seed=config.seed + 1)), tmp_path / "other.mcap")
    assert third.chain != first.chain


@pytest.mark.few(1)
@pytest.mark.parametrize("robot", sorted(ROBOTS))
def test_unknown_space_is_never_entered_under_forbid(recorded, robot):
    """Each driven path against the very map it was decided on, cell by cell, by slow code."""
    result = recorded("warehouse", robot, 1, "episode.time_limit=5")
    log = open_log(Path(result.log))
    assert log.config.costmap.unknown_policy == "forbid"
    navigator = Navigator(log.config, log.mission, log.beams)
    driven = 0
    for record in log.records():
        decision = navigator.commit(navigator.step(record.inputs), record.latency.delay_s)
        assert decision.map_version == record.decision.map_version
        if decision.action not in DRIVING:
            continue
        driven += 1
        path = np.array([(p.x, p.y, p.z) for p in record.decision.trajectory.path])
        assert_swept_cells_are_free(navigator.costmap, path, decision.inflation_radius_m)
    assert driven > 30


def assert_swept_cells_are_free(costmap, path, radius):
    """Every cell centre within `radius` of a cell that the path touches is FREE."""
    cells = np.unique(
        np.floor((densely(path) - costmap.origin) / costmap.resolution).astype(int), axis=0
    )
    reach = int(radius / costmap.resolution)
    flat = costmap.state.shape[2] == 1
    steps = np.arange(-reach, reach + 1)
    offsets = np.stack(np.meshgrid(steps, steps, [0] if flat else steps), -1).reshape(-1, 3)
    offsets = offsets[(offsets**2).sum(1) * costmap.resolution**2 <= radius**2]
    for cell in cells:
        around = cell + offsets
        assert (around >= 0).all()
        assert (around < costmap.state.shape).all()
        assert (costmap.state[tuple(around.T)] == FREE).all(), cell


def densely(path):
    pieces = [path[:1]]
    for a, b in itertools.pairwise(path):
        count = max(int(np.linalg.norm(b - a) / 0.01), 1)
        pieces.append(a + np.linspace(0, 1, count + 1)[1:, None] * (b - a))
    return np.concatenate(pieces)


def test_a_late_decision_is_labelled_and_discarded(recorded):
    result = recorded(
        "empty", "drone", 2, "latency.plan=0.5", "latency.deadline=0.1", "episode.time_limit=1"
    )
    decisions = [record.decision for record in open_log(Path(result.log)).records()]
    assert {d.label for d in decisions} == {"deadline_missed"}
    assert {d.action for d in decisions} == {"stop_and_wait"}
    assert result.deadline_misses == len(decisions)
    assert result.path_length_m < 0.1
    assert replay(Path(result.log)).identical


def test_no_decision_reads_the_truth(recorded, tmp_path):
    """With the truth cut from the log, the replay still gives every decision."""
    result = recorded(*EPISODES[0], "episode.time_limit=2")
    source, path = Path(result.log), tmp_path / "without_truth.mcap"
    kept = [one for one in read_messages(source) if not isinstance(one, pb.Truth)]
    head = read_head(walk(source, head_only=True), source, allow_plugins=False)
    write_copy(path, head, kept, open_log(source).result)
    replayed = replay(path)
    assert (replayed.differing, replayed.decisions) == (0, result.decisions)


@pytest.mark.few(1)
@pytest.mark.parametrize("robot", ROBOTS)
def test_an_episode_frees_all_that_it_took_as_it_ends(robot, tmp_path):
    """Nothing is left for the collector of garbage: a worker of a study runs thousands of them."""
    config = override(Config("empty", robot, 0), ["episode.time_limit=0.5"])
    run_episode(build(config), tmp_path / "first.mcap")  # modules are loaded meanwhile
    gc.collect()
    gc.disable()
    try:
        run_episode(build(config), tmp_path / "second.mcap")
        assert gc.collect() == 0
    finally:
        gc.enable()
