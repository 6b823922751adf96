"""`wayproof bench crossing`: whether a robot among people and forklifts runs into any of them.

Each seed is run with the traffic, on a map that forgets slowly and on one that sees what moves, and
once without it: what the traffic costs is the time beyond that.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

from wayproof.harness.bench.jobs import KeptRows, rows_of, unlogged
from wayproof.harness.bench.table import Progress
from wayproof.harness.config import Config, override
from wayproof.harness.scenario.worlds import find_world

ROBOTS = ("quadruped", "drone")

WAYS: dict[str, tuple[str, ...]] = {
    "voxel": (),
    "dynamic": ("map.kind=dynamic", "map.dynamic.prediction_horizon=1.0"),
}
"""Name -> settings. A second is what the faster robot takes to stop from full speed: 1.01 s from
2 m/s at 2.5 m/s^2 and 12 m/s^3; until then, what comes to its stopping place is foretold."""

ALONE = "alone"
"""The episode on the `voxel` map without what moves."""


@dataclass(frozen=True)
class CrossingRow:
    """One episode.

    Attributes:
        robot: Its name.
        way: A key of `WAYS`, or `ALONE`.
        seed: Of the world and of all else.
        outcome: How it ended.
        own: Collisions that the robot ran into, in motion.
        at_rest: How often a mover ran into the robot at rest.
        time_s: Simulated time.
        clearance_m: Least true distance to anything but the floor.
        reason: In words.
        cause: Of what was no success or a near miss, with its evidence; empty if there is none.
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
        """What it is the row of."""
        return self.robot, self.way, self.seed


@dataclass(frozen=True)
class CrossingSummary:
    """All seeds of one robot in one way.

    Attributes:
        robot: Its name.
        way: A key of `WAYS`, or `ALONE`.
        episodes: How many.
        reached: Of these, how many ended in success.
        own_collisions: Episodes that the robot's own motion ended in a collision.
        hit_at_rest: Episodes that ended as a mover ran into the robot at rest.
        mean_time_s: Mean simulated time of the successes; None without any.
        lost_s: Mean time beyond that of the same seed alone, where both succeeded.
        most_lost_s: The most.
        least_clearance_m: Over all episodes.
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
        repeats: Seeds.
        seed: The first.
        progress: Told what is done.
        kept: File of the rows that are there already, and to come.

    Raises:
        InputError: That file is none.
    """
    seeds = range(seed, seed + repeats)
    pairs = [(robot, way) for robot in ROBOTS for way in (ALONE, *WAYS)]
    jobs = [(*pair, each) for each in seeds for pair in pairs]
    rows = rows_of(jobs, run_one, KeptRows(kept, CrossingRow), progress)
    alone = {(row.robot, row.seed): row for row in rows if row.way == ALONE}
    summaries = [
        summarise([row for row in rows if (row.robot, row.way) == pair], alone) for pair in pairs
    ]
    return [*rows, *summaries]


def run_one(robot: str, way: str, seed: int) -> CrossingRow:
    """One episode, its log thrown away."""
    settings = () if way == ALONE else WAYS[way]
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
    """Of one robot in one way, against the same seeds alone."""
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
