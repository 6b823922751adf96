"""Episodes from start to end: goals, replays, large areas, other maps, another sensor."""

import gc
import itertools
from dataclasses import dataclass, replace
from pathlib import Path
from typing import ClassVar

import numpy as np
import pytest

from wayproof.harness import config_document as settings
from wayproof.harness.attribution import find_cause, read_case
from wayproof.harness.config import Config
from wayproof.harness.config_document import override
from wayproof.harness.errors import InputError
from wayproof.harness.log.codec.container import walk
from wayproof.harness.log.codec.messages import read_messages
from wayproof.harness.log.copy import write_copy
from wayproof.harness.log.head import read_head
from wayproof.harness.log.reader import open_log
from wayproof.harness.recompute import keyframes as pieces
from wayproof.harness.replay.closed_loop import simulate_again
from wayproof.harness.replay.replay import replay
from wayproof.harness.runner import run_episode
from wayproof.harness.scenario.scenario import build
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.harness.stack import keyframe
from wayproof.harness.stack.pipeline import Navigator
from wayproof.maps import FREE
from wayproof.models.robots import ROBOTS
from wayproof.models.sensors.beams import BeamTable
from wayproof.models.sensors.devices import DEVICES, OWN, Device, RangeNoise
from wayproof.models.worlds import WORLDS, Box, World
from wayproof.models.worlds.layout import room_walls

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


LARGE = ("world.empty.length=60", "world.empty.width=40", "costmap.window=24")
ENDS = ("start=[20.0,10.0]", "goal=[34.5,12.0]")  # 14.6 m on, beyond the first window
BRIEF = ("episode.time_limit=5", "keyframe_period=1")


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
@pytest.mark.parametrize("robot", ["quadruped", "drone"])
def test_an_episode_simulates_again_and_replays_in_pieces(large, robot, monkeypatch):
    path = large(robot)
    log = open_log(path)
    windows = {tuple(one.map.window) for one in log.keyframes() if one.HasField("map")}
    assert len(windows) > 1  # it has moved, and lies in the log
    monkeypatch.setattr(pieces, "LEAST_DECISIONS", 4)
    assert replay(path, jobs=3).identical
    assert not simulate_again(path).differences


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


@pytest.mark.parametrize(("kind", "robot"), [("grid2d", "quadruped"), ("tsdf", "drone")])
def test_an_episode_drives_safely_and_replays(recorded, kind, robot):
    result = recorded("corridor", robot, 1, f"map.kind={kind}", "episode.time_limit=2.5")
    assert (result.outcome, result.collisions) == ("timeout", 0), result.reason
    assert result.path_length_m > 0.7
    assert result.min_clearance_m > 0.1
    assert replay(Path(result.log)).identical
    decisions = list(open_log(Path(result.log)).decisions())
    assert {decision.representation for decision in decisions} == {kind}
    assert len({decision.map_version for decision in decisions}) > 20


@pytest.mark.large
@pytest.mark.parametrize("kind", ["tsdf", "octomap"])
def test_a_drone_reaches_its_goal(recorded, kind):
    chosen = f"map.kind={kind}", "map.resolution=0.2", "map.half_life=0", "goal=[6.0, 4.0]"
    result = recorded("empty", "drone", 1, *chosen)
    assert (result.outcome, result.collisions) == ("success", 0), result.reason
    assert replay(Path(result.log)).identical


def test_decay_is_refused_where_there_is_none(tmp_path):
    scenario = build(override(Config("empty", "drone", 1), ["map.kind=octomap"]))
    with pytest.raises(InputError, match=r"half_life: got 30, expected 0 with map.kind 'octomap'"):
        run_episode(scenario, tmp_path / "refused.mcap")


def test_a_flat_grid_refuses_a_drone_in_one_line(tmp_path):
    scenario = build(override(Config("empty", "drone", 1), ["map.kind=grid2d"]))
    with pytest.raises(InputError, match=r"no map for this mission: map.kind: got 'grid2d' for a"):
        run_episode(scenario, tmp_path / "refused.mcap")


LOW, HIGH = (0.0, 0.0, -0.5), (7.0, 5.0, 3.0)
WALL = Box.between((4.0, 0.0, 0.0), (4.2, 5.0, 3.0), "partition")
PILLAR = Box.between((4.8, 1.2, 0.0), (5.2, 1.6, 3.0), "crate")
SHORT = ("episode.time_limit=40", "behaviour.wait_timeout=0.5", "behaviour.max_recoveries=3")


def small_world(*boxes):
    return World(
        name="small",
        seed=0,
        low=LOW,
        high=HIGH,
        solids=(*room_walls(LOW, HIGH), *boxes),
        start=(1.5, 2.5, 0.0),
        start_heading=0.0,
        goal=(5.5, 2.5, 0.0),
    )


@pytest.fixture
def episode(monkeypatch, tmp_path):
    """Run in a room of 7 x 5 m with some boxes: the result and the decisions."""

    def run(boxes, robot, *settings):
        monkeypatch.setitem(WORLDS, "small", lambda *_: small_world(*boxes))
        config = override(Config("small", robot, 0), (*SHORT, *settings))
        result = run_episode(build(config), tmp_path / "episode.mcap")
        log = open_log(tmp_path / "episode.mcap")
        assert replay(tmp_path / "episode.mcap").identical
        return result, [record.decision for record in log.records()]

    return run


EXACT = ("pose_model.bias_sigma=0", "pose_model.yaw_bias_sigma=0")


# With an exact pose, beams miss some cells under the ceiling for good: there might be a way for a
# drone.
@pytest.mark.few(1)
@pytest.mark.parametrize(
    ("robot", "settings", "label"),
    [
        ("drone", EXACT, "unknown_ahead"),
        ("quadruped", (), "no_path"),
    ],
)
def test_a_sealed_room_ends_in_an_abort_that_says_why(episode, robot, settings, label):
    result, decisions = episode([WALL], robot, *settings)
    assert result.outcome == "aborted", result.reason
    assert decisions[-1].label == label
    assert result.sim_time_s < 40.0
    assert result.collisions == 0
    back = [d for d in decisions if d.action == "recover" and d.predicate.kind == "going_back"]
    assert robot == "drone" or 0 < len({d.predicate.since for d in back}) <= 2


def test_a_goal_inside_the_inflation_is_approached_and_then_given_up(episode):
    # 0.45 m from the pillar: the body of 0.36 m would fit, but not with its margin.
    result, decisions = episode([PILLAR], "drone", "goal=[5.0,2.0]", "episode.goal_tolerance=0.05")
    assert result.outcome == "aborted", result.reason
    assert decisions[-1].label == "goal_blocked"
    assert result.goal_distance_m < 0.5
    waited = [d for d in decisions if d.label == "goal_blocked"]
    assert len(waited) * 0.1 == pytest.approx(5.0, abs=0.3)


@pytest.fixture
def registered(monkeypatch):
    """The line in `DEVICES`, from which the setting's names are taken as config is imported."""
    monkeypatch.setitem(DEVICES, "sonar-ring", SONAR_RING)
    monkeypatch.setitem(settings.NAMED, "sensors.lidar", (OWN, *DEVICES))


def test_a_new_kind_drives_an_episode_that_replays(registered, tmp_path):
    chosen = ["sensors.lidar=sonar-ring", "episode.time_limit=1"]
    scenario = build(override(Config("corridor", "quadruped", 1), chosen))
    log = tmp_path / "sonars.mcap"
    result = run_episode(scenario, log)
    messages = list(read_messages(log))
    (info,) = (message for message in messages if isinstance(message, pb.SensorInfo))
    assert (info.name, info.kind, info.device) == ("lidar", "sonar_ring", "sonar-ring")
    sweeps = [message for message in messages if isinstance(message, pb.Sweep)]
    assert {(sweep.rows, sweep.columns) for sweep in sweeps} == {(1, 80)}
    assert len(sweeps) == result.decisions
    assert replay(log).identical
    assert simulate_again(log).identical


def test_every_kind_names_itself():
    kinds = {type(device) for device in (*DEVICES.values(), SONAR_RING)}
    assert {kind.kind for kind in kinds} == {"depth_camera", "lidar", "rangefinder", "sonar_ring"}


@dataclass(frozen=True, kw_only=True)
class SonarRing(Device):
    """Sonars in a ring, each with a fan of beams over its cone, fired one after another.

    Attributes:
        sonars: Number of sonars around the z axis.
        cone: Full opening angle of each, rad.
        rays: Number of beams over each cone.
    """

    kind: ClassVar[str] = "sonar_ring"

    sonars: int
    cone: float
    rays: int

    def beam_table(self) -> BeamTable:
        """Return one row, with the beams of every sonar side by side."""
        centres = np.arange(self.sonars) * (2.0 * np.pi / self.sonars)
        fan = np.linspace(-0.5 * self.cone, 0.5 * self.cone, self.rays)
        azimuth = (centres[:, None] + fan).ravel()
        return BeamTable(
            rows=np.array([[1.0, 0.0]]),
            columns=np.stack([np.cos(azimuth), np.sin(azimuth)], axis=1),
            beams=len(azimuth),
            scan_poses=self.sonars,
            measures=self.measures,
        )


SONAR_RING = SonarRing(
    sonars=16,
    cone=0.26,
    rays=5,
    range=5.0,
    minimum_range=0.15,
    rate=10.0,
    noise=RangeNoise(sigma_proportional=0.01),
    no_return_is_free=True,
    source="assumed: sixteen sonars as robots of the nineties carried them",
)
