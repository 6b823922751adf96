"""`wayproof bench crossing`: collisions of a robot among people and forklifts.

Each seed is run with the traffic, on a map that forgets slowly and on one that tracks what moves,
and once without traffic: the time beyond that is the cost of the traffic.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

from wayproof.harness.bench.jobs import KeptRows, rows_of, unlogged
from wayproof.harness.bench.table import Progress
from wayproof.harness.config import Config
from wayproof.harness.config_document import override
from wayproof.harness.scenario.worlds import find_world

ROBOTS = ("quadruped", "drone")

MAPS: dict[str, tuple[str, ...]] = {
    "voxel": (),
    "dynamic": ("map.kind=dynamic", "map.dynamic.prediction_horizon=1.0"),
}
"""Name -> settings of the map. The faster robot stops within a second from full speed (1.01 s from
2 m/s at 2.5 m/s^2 and 12 m/s^3), hence the prediction horizon."""

ALONE = "alone"
"""Name of the episode on the `voxel` map without traffic."""


@dataclass(frozen=True)
class CrossingRow:
    """One episode.

    Attributes:
        robot: Name of the robot.
        way: Key of `MAPS`, or `ALONE`.
        seed: Seed of the world and of all randomness.
        outcome: Outcome of the episode.
        own: Number of collisions caused by the robot's own motion.
        at_rest: Number of times that a mover hit the robot at rest.
        time_s: Simulated time, s.
        clearance_m: Least true distance to anything but the floor, m.
        reason: Reason of the outcome.
        cause: Cause of a failure with its evidence; empty without one.
    """

    robot: str
    way: str
    seed: int
    outcome: str
    own: int
    at_rest: int
    time_s: float
    clearance_m: float
    reason: str
    cause: str

    @property
    def job(self) -> tuple[str, str, int]:
        """Arguments of the job that the row is the result of."""
        return self.robot, self.way, self.seed


@dataclass(frozen=True)
class CrossingSummary:
    """All seeds of one robot on one map.

    Attributes:
        robot: Name of the robot.
        way: Key of `MAPS`, or `ALONE`.
        episodes: Number of episodes.
        reached: Number of episodes that ended in success.
        own_collisions: Episodes that ended in a collision by the robot's own motion.
        hit_at_rest: Episodes that ended when a mover hit the robot at rest.
        mean_time_s: Mean simulated time of the successes, s; None without any.
        lost_s: Mean time beyond that of the same seed without traffic, of joint successes, s.
        most_lost_s: Greatest such time, s.
        least_clearance_m: Least true distance in all episodes, m.
    """

    robot: str
    way: str
    episodes: int
    reached: int
    own_collisions: int
    hit_at_rest: int
    mean_time_s: float | None
    lost_s: float | None
    most_lost_s: float | None
    least_clearance_m: float


def bench_crossing(
    repeats: int, seed: int, progress: Progress, kept: Path | None = None
) -> list[CrossingRow | CrossingSummary]:
    """Run world `crossing` with both robots on all maps; a row for each episode, then summaries.

    Args:
        repeats: Number of seeds.
        seed: First seed.
        progress: Called with a line after each episode.
        kept: File of rows to continue from.

    Raises:
        InputError: The file is not such a file of rows.
    """
    seeds = range(seed, seed + repeats)
    pairs = [(robot, way) for robot in ROBOTS for way in (ALONE, *MAPS)]
    jobs = [(*pair, each) for each in seeds for pair in pairs]
    rows = rows_of(jobs, run_one, KeptRows(kept, CrossingRow), progress)
    alone = {(row.robot, row.seed): row for row in rows if row.way == ALONE}
    summaries = [
        summarise([row for row in rows if (row.robot, row.way) == pair], alone) for pair in pairs
    ]
    return [*rows, *summaries]


def run_one(robot: str, way: str, seed: int) -> CrossingRow:
    """Run one episode without keeping its log."""
    settings = () if way == ALONE else MAPS[way]
    config = override(Config("crossing", robot, seed), settings)
    world = find_world(config)
    if way == ALONE:
        world = replace(world, movers=())
    result = unlogged(config, world)
    return CrossingRow(
        robot=robot,
        way=way,
        seed=seed,
        outcome=result.outcome,
        own=result.collisions,
        at_rest=result.struck,
        time_s=result.sim_time_s,
        clearance_m=result.min_clearance_m,
        reason=result.reason,
        cause=f"{result.cause}: {result.cause_evidence}" if result.cause else "",
    )


def summarise(
    rows: list[CrossingRow], alone: dict[tuple[str, int], CrossingRow]
) -> CrossingSummary:
    """Summarise the episodes of one robot and map against the same seeds without traffic."""
    reached = [row for row in rows if row.outcome == "success"]
    pairs = [(row, alone[row.robot, row.seed]) for row in reached]
    lost = [row.time_s - free.time_s for row, free in pairs if free.outcome == "success"]
    return CrossingSummary(
        robot=rows[0].robot,
        way=rows[0].way,
        episodes=len(rows),
        reached=len(reached),
        own_collisions=sum(row.own > 0 for row in rows),
        hit_at_rest=sum(row.at_rest > 0 for row in rows),
        mean_time_s=sum(row.time_s for row in reached) / len(reached) if reached else None,
        lost_s=sum(lost) / len(lost) if lost else None,
        most_lost_s=max(lost, default=None),
        least_clearance_m=min(row.clearance_m for row in rows),
    )
