"""`wayproof bench barn`: the worlds of the BARN Challenge, crossed by the quadruped.

Perille et al., "Benchmarking Metric Ground Navigation", SSRR 2020; score and limits of the
challenge's own runner: success within 1 m of the goal, OT / clip(AT, 2 OT, 8 OT), where OT is the
time for the published reference path at 2 m/s and AT the time taken, here from the first decision.
The folder holds `world_N.world` and `path_N.npy`, as published.
"""

from __future__ import annotations

import json
import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wayproof.harness.bench.published.files import Files, files_named
from wayproof.harness.bench.published.trials import (
    Finished,
    Trial,
    refuse_unknown_stack,
    run_trials,
)
from wayproof.harness.bench.table import Progress
from wayproof.harness.config import Config
from wayproof.harness.config_document import override
from wayproof.harness.errors import InputError
from wayproof.models.robots import FAST_ROBOTS, ROBOTS, RobotSpec
from wayproof.models.world_files import (
    FileWorld,
    ImportOptions,
    WorldFileError,
    world_of,
    world_text,
)
from wayproof.models.world_files.importer import complete
from wayproof.models.world_files.sdf import read_sdf
from wayproof.models.worlds import shortest_path_length

ROBOT = "quadruped"
START = (-2.25, 3.0, 0.0)
GOAL = (-2.25, 13.0, 0.0)
HEADING = np.pi / 2
LOW = (-5.0, -0.5, -0.5)
HIGH = (0.5, 15.0, 3.0)
"""Operating area, m: it leaves no way around the walls of cylinders."""

SPEED = 2.0  # m/s, of the reference
FASTEST, SLOWEST = 2.0, 8.0  # times OT: clipped to these
REACHED = 1.0  # m from the goal: there a trial is over
LIMIT = 50.0  # s
CELLS_PER_RADIUS = 5
"""Least number of map cells within the body's inscribed radius."""

UNCERTAINTIES = (
    "map.half_life=0",
    "pose_model.bias_sigma=0",
    "pose_model.yaw_bias_sigma=0",
    "pose_model.leg_height_sigma=0",
    f"episode.time_limit={LIMIT:g}",
)


@dataclass(frozen=True)
class BarnRow:
    """One episode.

    Attributes:
        world: Name of the file.
        seed: Seed of the episode; the world is the same for all.
        outcome: Outcome of the episode; `impossible` where truth closes the world for this body and
            margin, and `refused` where the episode could not start.
        score: Success x OT / clip(AT, 2 OT, 8 OT).
        best: Score of the shortest way at the body's greatest speed.
        time_s: AT, until the goal is 1 m away; else until the episode ended.
        optimal_s: OT.
        clip: Bounds of AT, in OT.
        path_m: Distance travelled.
        clearance_m: Least true distance to a cylinder.
        collisions: Times that it started to touch one before that.
    """

    world: str
    seed: int
    outcome: str
    score: float
    best: float
    time_s: float
    optimal_s: float
    clip: str
    path_m: float
    clearance_m: float
    collisions: int


@dataclass(frozen=True)
class BarnSummary:
    """All episodes.

    Attributes:
        episodes: Number of episodes, impossible ones included.
        impossible: Number of episodes in worlds closed for this body.
        success: Share of all.
        success_possible: Share of those that are possible.
        mean_score: Over all.
        mean_score_possible: Over those that are possible.
        total_collisions: Number of collisions in all episodes.
    """

    episodes: int
    impossible: int
    success: float
    success_possible: float
    mean_score: float
    mean_score_possible: float
    total_collisions: int


def bench_barn(
    files: Files, repeats: int, seed: int, progress: Progress
) -> list[BarnRow | BarnSummary]:
    """Cross every world of a folder with `repeats` seeds; a row for each, and a summary.

    Raises:
        InputError: No worlds, one that cannot be read, or no such stack.
    """
    refuse_unknown_stack(files.stack)
    worlds = [read_barn(path) for path in files_named(files.path, "world_*.world")]
    progress("barn: which worlds are open for this body")
    ways = {world.name: shortest_way(world) for world in worlds}
    seeds = range(seed, seed + repeats)
    trials = (
        Trial(
            world,
            replace(barn_config(world, number), stack=files.stack),
            files.log_folder("barn") / f"{world.name}-{number}.mcap",
        )
        for world in worlds
        if ways[world.name] is not None
        for number in seeds
    )
    rows = [
        _row(finished, ways[finished.trial.world.name]) for finished in run_trials(trials, progress)
    ]
    rows += [
        _unrun(world, number, "impossible", None)
        for world in worlds
        if ways[world.name] is None
        for number in seeds
    ]
    return [*rows, summarise(rows)]


def read_barn(path: Path) -> FileWorld:
    """Return one world with its protocol, of which the published reference path is part.

    Raises:
        InputError: The world or its path cannot be read.
    """
    route = path.with_name(path.stem.replace("world", "path") + ".npy")
    try:
        found = read_sdf(path, ImportOptions())
        cells = np.load(route, allow_pickle=False)
    except WorldFileError as error:
        raise InputError(str(error)) from None
    except (OSError, ValueError, EOFError) as error:
        raise InputError(f"{route}: {' '.join(str(error).split())[:100]}") from None
    if cells.ndim != 2 or cells.shape[1] != 2:
        raise InputError(f"{route}: got {cells.shape}, expected cells (n, 2)")
    found = replace(found, start=START, start_heading=HEADING, goal=GOAL, low=LOW, high=HIGH)
    found.source = path.name
    found.protocol = json.dumps(
        {
            "name": "barn",
            "speed": SPEED,
            "clip": [FASTEST, SLOWEST],
            "reached": REACHED,
            "reference_m": reference_length(cells),
            "settings": settings(),
        }
    )
    text = world_text(found, complete(found), path.stem)
    return world_of(text, path)


def optimal_time(world: FileWorld) -> float:
    """Return OT, s: for the published reference path, not the shortest one, at 2 m/s."""
    return float(json.loads(world.protocol)["reference_m"]) / SPEED


def reference_length(cells: NDArray[Any]) -> float:
    """Return the length of the published path from start to goal, m.

    Args:
        cells: (n, 2) as published, 0.15 m each.
    """
    between = np.column_stack([0.15 * cells[:, 0] - 4.575, 0.15 * cells[:, 1] + 5.075])
    route = np.vstack([START[:2], between, GOAL[:2]])
    return float(np.linalg.norm(np.diff(route, axis=0), axis=1).sum())


def shortest_way(world: FileWorld) -> float | None:
    """Return the length of the shortest way for the body with its margin, by the truth, m."""
    spec = ROBOTS[ROBOT].spec
    radius = inscribed_radius(spec)
    return shortest_path_length(
        world,
        radius,
        band_low=spec.step_height,
        band_high=spec.height,
        start=world.start,
        goal=world.goal,
        clearance=margin_of(cell_size(radius)),
    )


def best_score(world: FileWorld, way: float | None) -> float:
    """Return the score of the shortest way at the body's greatest speed from the first moment."""
    if way is None:
        return 0.0
    return barn_score(
        True, (way - REACHED) / FAST_ROBOTS[ROBOT].spec.max_speed, optimal_time(world)
    )


def inscribed_radius(spec: RobotSpec) -> float:
    """Return the radius that the stack keeps free, m, for which a way has to be wide enough.

    Of a body of discs the least one: where that does not get through, the body does not.
    """
    return min((radius for _, radius in spec.discs), default=spec.radius)


def cell_size(radius: float) -> float:
    """Return the greatest cell size, m, in whole centimetres, of which enough fit in a radius."""
    return math.floor(100.0 * radius / CELLS_PER_RADIUS) / 100.0


def margin_of(cell: float) -> float:
    """Return the margin for the place of an echo within its cell, m: half a diagonal in the plane.

    The pose is exact, as in the published simulation, so nothing else is to be covered; inflation
    itself covers the place of the body's centre within its cell.
    """
    return round(0.5 * math.sqrt(2.0) * cell, 4)


def settings() -> tuple[str, ...]:
    """Return the protocol's settings for the robot: cells and margin follow from its body."""
    cell = cell_size(inscribed_radius(ROBOTS[ROBOT].spec))
    sizes = (f"map.resolution={cell:g}", f"costmap.localization_margin={margin_of(cell):g}")
    return (*sizes, *UNCERTAINTIES)


def barn_config(world: FileWorld, seed: int) -> Config:
    """Return the protocol's settings."""
    return override(Config(world.name, ROBOT, seed), settings())


def barn_score(success: bool, time_s: float, optimal_s: float) -> float:
    """Return OT / clip(AT, 2 OT, 8 OT) for a success, else 0."""
    taken = min(max(time_s, FASTEST * optimal_s), SLOWEST * optimal_s)
    return success * optimal_s / taken


def summarise(rows: list[BarnRow]) -> BarnSummary:
    """Return means over all episodes, and over those in worlds that are open."""
    possible = [row for row in rows if row.outcome != "impossible"]
    of = [[row.outcome == "success" for row in some] for some in (rows, possible)]
    scores = [[row.score for row in some] for some in (rows, possible)]
    return BarnSummary(
        episodes=len(rows),
        impossible=len(rows) - len(possible),
        success=_mean(of[0]),
        success_possible=_mean(of[1]),
        mean_score=_mean(scores[0]),
        mean_score_possible=_mean(scores[1]),
        total_collisions=sum(row.collisions for row in rows),
    )


def _mean(values: list[bool] | list[float]) -> float:
    return float(np.mean(values)) if values else 0.0


def _row(finished: Finished, way: float | None) -> BarnRow:
    trial, result = finished.trial, finished.result
    world, seed = trial.world, trial.config.seed
    if result is None:
        return _unrun(world, seed, "refused", way)
    optimal, best = optimal_time(world), best_score(world, way)
    passed = finished.first(lambda x, y, z: math.dist((x, y), GOAL[:2]) <= REACHED)
    success = passed is not None and passed <= LIMIT
    time = passed if passed is not None and success else result.sim_time_s
    outcome = "success" if success else result.outcome
    return BarnRow(
        world=world.name,
        seed=seed,
        outcome=outcome,
        score=barn_score(success, time, optimal),
        best=best,
        time_s=time,
        optimal_s=optimal,
        clip=_CLIP,
        path_m=result.path_length_m,
        clearance_m=result.min_clearance_m,
        collisions=0 if success else result.collisions,
    )


def _unrun(world: FileWorld, seed: int, outcome: str, way: float | None) -> BarnRow:
    optimal, best = optimal_time(world), best_score(world, way)
    return BarnRow(
        world=world.name,
        seed=seed,
        outcome=outcome,
        score=0.0,
        best=best,
        time_s=0.0,
        optimal_s=optimal,
        clip=_CLIP,
        path_m=0.0,
        clearance_m=0.0,
        collisions=0,
    )


_CLIP = f"{FASTEST:g}-{SLOWEST:g} OT"
