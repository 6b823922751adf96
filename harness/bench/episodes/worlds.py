"""How both robots fare in every world: one episode each of some seeds, and a summary."""

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
        world: Its name.
        robot: Its name.
        seed: Of the world and of all else.
        outcome: How it ended.
        time_s: Simulated time.
        clearance_m: Least true distance to anything but the floor.
        spl: Success weighted by path length (Anderson et al. 2018): the shortest way over the one
            travelled, at most 1; 0 for a failure.
        struck: How often a mover ran into the robot at rest.
        reason: In words.
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
        """What it is the row of."""
        return self.world, self.robot, self.seed


@dataclass(frozen=True)
class WorldSummary:
    """All episodes of one robot in one world.

    Attributes:
        world: Its name.
        robot: Its name.
        episodes: How many.
        reached: Of these, how many ended in success.
        mean_time_s: Mean simulated time of the successes; None without any.
        mean_spl: Over all episodes.
        least_clearance_m: Over all episodes.
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
        repeats: Seeds of each pair.
        seed: The first.
        progress: Told what is done.
        kept: File of the rows that are there already, and to come.

    Raises:
        InputError: That file is none.
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
    """One episode, its log thrown away."""
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
