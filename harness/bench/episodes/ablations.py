"""Comparison of settings on the same seeds: unknown policies, planners, delays.

`wayproof bench policies`, `wayproof bench planners` and `wayproof bench delays` run whole episodes
in the warehouse. The arms of one seed run in succession, so that a load on the machine slows all of
them.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayproof.harness.bench.table import Progress
from wayproof.harness.config_document import from_document, override
from wayproof.harness.log.reader import Log, open_log
from wayproof.harness.result import Result
from wayproof.harness.runner import run_episode
from wayproof.harness.scenario.scenario import build
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.harness.stack.build import build_navigator
from wayproof.harness.warm_up import warm_up
from wayproof.maps import UNKNOWN, states_in

WORLD = "warehouse"


class Arm(NamedTuple):
    """Robot with settings."""

    robot: str
    name: str
    settings: tuple[str, ...]


POLICIES = tuple(
    Arm("drone", policy, (f"costmap.unknown_policy={policy}",))
    for policy in ("forbid", "penalize", "allow")
)
PLANNING = tuple(
    Arm(robot, name, (f"planner.name={name}",))
    for robot in ("drone", "quadruped")
    for name in ("astar", "rrtconnect")
)
DELAYS = tuple(
    Arm(robot, f"{3 * part:g} ms", (
        *(f"latency.{stage}={part * 1e-3}" for stage in ("sense", "map", "plan")),
        "latency.deadline=1.0",
    ))
    for robot in ("drone", "quadruped")
    for part in (20, 100, 200)
)  # fmt: skip


@dataclass(frozen=True)
class ArmRow:
    """Episodes of one arm.

    Attributes:
        robot: Name of the robot.
        arm: Name of the settings.
        episodes: Number of episodes, of seeds from the given one on.
        success: Share of episodes that ended in success.
        collisions: Number of episodes that ended in a collision.
        time_s: Mean simulated time of the successful ones.
        length_m: Mean distance travelled of these.
        speed_m_s: Mean distance over mean time of these.
        looks: Mean number of explorations that the robot started.
        edge_share: Share of decisions that drive up to the edge of known space: that explore, or
            follow with the reason `unknown_ahead`.
        least_clearance_m: Least true distance to an obstacle in all episodes.
        unknown_share: Share of decisions whose committed path leads through space not known to be
            free.
        unknown_cells: Mean number of cells of the map that were unknown when the body was in them;
            0 unless policies are compared.
        plan_ms_p50: Median wall time of a decision.
        plan_ms_p99: 99th percentile of the same.
    """

    robot: str
    arm: str
    episodes: int
    success: float
    collisions: int
    time_s: float
    length_m: float
    speed_m_s: float
    looks: float
    edge_share: float
    least_clearance_m: float
    unknown_share: float
    unknown_cells: float
    plan_ms_p50: float
    plan_ms_p99: float


class DecisionRecord(NamedTuple):
    """Record of one decision."""

    explores: bool  # starts an exploration
    at_edge: bool  # drives up to the edge of known space
    unknown: bool  # its committed path leads through space not known to be free
    plan_ms: float


class Trial(NamedTuple):
    """Record of one episode."""

    result: Result
    looks: int
    edge_share: float
    unknown_share: float
    unknown_cells: int
    plan_ms: list[float]


def bench_policies(repeats: int, seed: int, progress: Progress) -> list[ArmRow]:
    """Run a drone under each unknown policy; one row for each."""
    return _compare(POLICIES, repeats, seed, progress)


def bench_planners(repeats: int, seed: int, progress: Progress) -> list[ArmRow]:
    """Run both robots with the default planner and with RRT-Connect."""
    return _compare(PLANNING, repeats, seed, progress)


def bench_delays(repeats: int, seed: int, progress: Progress) -> list[ArmRow]:
    """Run both robots with delays of 60, 300 and 600 ms from a sweep to the decision's effect."""
    return _compare(DELAYS, repeats, seed, progress)


def _compare(arms: Iterable[Arm], repeats: int, seed: int, progress: Progress) -> list[ArmRow]:
    trials: dict[Arm, list[Trial]] = {arm: [] for arm in arms}
    with tempfile.TemporaryDirectory() as folder:
        for one in range(seed, seed + repeats):
            for arm, done in trials.items():
                progress(f"{arm.robot}, {arm.name}, seed {one}")
                done.append(_run(arm, one, Path(folder) / "episode.mcap"))
    return [_row(arm, done) for arm, done in trials.items()]


def _run(arm: Arm, seed: int, path: Path) -> Trial:
    config = override(
        from_document({"world": WORLD, "robot": arm.robot, "seed": seed}), arm.settings
    )
    warm_up(config)
    decisions: list[DecisionRecord] = []

    def note(decision: pb.Decision, _: pb.Truth) -> None:
        nearest = (decision.least_clearance_m / decision.resolution_m) ** 2
        unknown = round(nearest) <= decision.collision_distance_sq
        predicate = decision.predicate
        explores = decision.action == "explore" and predicate.since == decision.sequence
        at_edge = decision.action == "follow" and predicate.kind == "unknown_ahead"
        at_edge = at_edge or decision.action == "explore"
        decisions.append(DecisionRecord(explores, at_edge, unknown, decision.stages.plan_ms))

    result = run_episode(build(config), path, note)
    return Trial(
        result,
        looks=sum(one.explores for one in decisions),
        edge_share=sum(one.at_edge for one in decisions) / len(decisions),
        unknown_share=sum(one.unknown for one in decisions) / len(decisions),
        unknown_cells=entered_unknown(open_log(path)) if arm in POLICIES else 0,
        plan_ms=[one.plan_ms for one in decisions],
    )


def entered_unknown(log: Log) -> int:
    """Return the number of cells that were unknown in the map while the flying body was in them.

    The map is rebuilt from the log, and read around the true place at each decision. 0 for a robot
    on the ground, whose body is not one ball.
    """
    mission = log.mission
    if mission.planar:
        return 0
    navigator = build_navigator(log.config, mission, log.beams)
    entered: set[bytes] = set()
    for record in log.records():
        navigator.commit(navigator.step(record.inputs), record.latency.delay_s)
        place = record.inputs.pose.position
        entered |= {cell.tobytes() for cell in _unknown_in(navigator.map, place, mission.radius)}
    return len(entered)


def _unknown_in(voxel_map: Any, place: NDArray[np.float64], radius: float) -> NDArray[np.int64]:
    """Return the unknown cells whose centres are in a ball, (n, 3)."""
    size = voxel_map.resolution
    first = np.floor((place - radius) / size + (0.0, 0.0, 0.75))
    end = np.ceil((place + radius) / size + (0.0, 0.0, 0.75))
    corner = (first - (0.0, 0.0, 0.75)) * size
    top = (end - (0.0, 0.0, 0.75)) * size
    states = states_in(voxel_map, corner + 0.25 * size, top - 0.25 * size)
    cells = np.argwhere(states == UNKNOWN)
    centres = corner + (cells + 0.5) * size
    inside = ((centres - place) ** 2).sum(axis=1) <= radius * radius
    return np.asarray(cells[inside] + first.astype(np.int64), np.int64)


def _row(arm: Arm, trials: list[Trial]) -> ArmRow:
    reached = [trial.result for trial in trials if trial.result.outcome == "success"]
    time_s = float(np.mean([result.sim_time_s for result in reached])) if reached else 0.0
    length = float(np.mean([result.path_length_m for result in reached])) if reached else 0.0
    plan_ms = np.concatenate([trial.plan_ms for trial in trials])
    return ArmRow(
        robot=arm.robot,
        arm=arm.name,
        episodes=len(trials),
        success=len(reached) / len(trials),
        collisions=sum(trial.result.outcome == "collision" for trial in trials),
        time_s=time_s,
        length_m=length,
        speed_m_s=length / time_s if reached else 0.0,
        looks=float(np.mean([trial.looks for trial in trials])),
        edge_share=float(np.mean([trial.edge_share for trial in trials])),
        least_clearance_m=min(trial.result.min_clearance_m for trial in trials),
        unknown_share=float(np.mean([trial.unknown_share for trial in trials])),
        unknown_cells=float(np.mean([trial.unknown_cells for trial in trials])),
        plan_ms_p50=float(np.median(plan_ms)),
        plan_ms_p99=float(np.percentile(plan_ms, 99)),
    )
