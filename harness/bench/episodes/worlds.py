"""`wayproof bench worlds`: both robots in every world, for some seeds."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from wayproof.harness.bench.jobs import KeptRows, rows_of, unlogged
from wayproof.harness.bench.table import Progress
from wayproof.harness.config import Config
from wayproof.models.worlds import WORLDS

ROBOTS = ("quadruped", "drone")


@dataclass(frozen=True)
class WorldRow:
    """One episode with the default settings.

    Attributes:
        world: Name of the world.
        robot: Name of the robot.
        seed: Seed of the world and of all randomness.
        outcome: Outcome of the episode.
        time_s: Simulated time, s.
        clearance_m: Least true distance to anything but the floor, m.
        spl: Success weighted by path length (Anderson et al. 2018): the shortest path over the one
            travelled, at most 1; 0 for a failure.
        struck: Number of times that a mover hit the robot at rest.
        reason: Reason of the outcome.
    """

    world: str
    robot: str
    seed: int
    outcome: str
    time_s: float
    clearance_m: float
    spl: float
    struck: int
    reason: str

    @property
    def job(self) -> tuple[str, str, int]:
        """Arguments of the job that the row is the result of."""
        return self.world, self.robot, self.seed


@dataclass(frozen=True)
class WorldSummary:
    """All episodes of one robot in one world.

    Attributes:
        world: Name of the world.
        robot: Name of the robot.
        episodes: Number of episodes.
        reached: Number of episodes that ended in success.
        mean_time_s: Mean simulated time of the successes, s; None without any.
        mean_spl: Mean SPL of all episodes.
        least_clearance_m: Least true distance in all episodes, m.
    """

    world: str
    robot: str
    episodes: int
    reached: int
    mean_time_s: float | None
    mean_spl: float
    least_clearance_m: float


def bench_worlds(
    repeats: int, seed: int, progress: Progress, kept: Path | None = None
) -> list[WorldRow | WorldSummary]:
    """Run every world with both robots; a `WorldRow` for each episode, then `WorldSummary` rows.

    Args:
        repeats: Number of seeds of each pair.
        seed: First seed.
        progress: Called with a line after each episode.
        kept: File of rows to continue from.

    Raises:
        InputError: The file is not such a file of rows.
    """
    seeds = range(seed, seed + repeats)
    pairs = [(world, robot) for world in WORLDS for robot in ROBOTS]
    jobs = [(*pair, each) for each in seeds for pair in pairs]
    rows = rows_of(jobs, run_one, KeptRows(kept, WorldRow), progress)
    rows.sort(key=lambda row: pairs.index((row.world, row.robot)))  # seeds stay in order
    summaries = [
        _summarise([row for row in rows if (row.world, row.robot) == pair]) for pair in pairs
    ]
    return [*rows, *summaries]


def run_one(world: str, robot: str, seed: int) -> WorldRow:
    """Run one episode without keeping its log."""
    result = unlogged(Config(world, robot, seed))
    success = result.outcome == "success"
    shortest = result.route_length_m or 0.0
    longest = max(result.path_length_m, shortest)
    return WorldRow(
        world=world,
        robot=robot,
        seed=seed,
        outcome=result.outcome,
        time_s=result.sim_time_s,
        clearance_m=result.min_clearance_m,
        spl=shortest / longest if success and longest else 0.0,
        struck=result.struck,
        reason=result.reason,
    )


def _summarise(rows: list[WorldRow]) -> WorldSummary:
    times = [row.time_s for row in rows if row.outcome == "success"]
    return WorldSummary(
        world=rows[0].world,
        robot=rows[0].robot,
        episodes=len(rows),
        reached=len(times),
        mean_time_s=sum(times) / len(times) if times else None,
        mean_spl=sum(row.spl for row in rows) / len(rows),
        least_clearance_m=min(row.clearance_m for row in rows),
    )
