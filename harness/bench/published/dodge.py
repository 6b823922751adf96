"""`wayproof bench dodge`: flight through fields of spheres, by the drone with its depth camera.

The static fields of the DodgeDrone challenge (ICRA 2022) as its evaluations use them: fly from the
origin to x >= 17 m within 35 s, inside x -5..25, y -15..15, z 0..15 m; touching a sphere is a
failure, and so is leaving the box. Here a seed chooses the height of the start, and the goal is the
free point at x = 18 m that is nearest to straight ahead. The folder holds the fields as `.csv`.
"""

from __future__ import annotations

import json
from collections import defaultdict
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

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
from wayproof.models.robots import ROBOTS
from wayproof.models.world_files import (
    FileWorld,
    ImportOptions,
    WorldFileError,
    world_of,
    world_text,
)
from wayproof.models.world_files.importer import complete
from wayproof.models.world_files.tables import read_table

ROBOT = "drone"
LOW = (-5.0, -15.0, 0.0)
HIGH = (25.0, 15.0, 15.0)
FINISH = 17.0  # m along x
GOAL_X = 18.0  # m: a little behind, as the drone comes to rest there
LIMIT = 35.0  # s
START_HEIGHTS = (2.0, 8.0)  # m
START_ROOM = 1.3  # m from the body to every sphere: more than what is declared free
GOAL_ROOM = 1.0  # m

SETTINGS = (
    "sensors.lidar=ideal-depth-camera",  # on both mounts: it sees nothing else
    "motion.altitude_high=15",
    f"episode.time_limit={LIMIT:g}",
    "episode.start_clear_radius=0.9",  # a body wider than the cone of sight begins in known space
    "episode.goal_tolerance=0.5",
)

Point = tuple[float, float, float]


@dataclass(frozen=True)
class DodgeRow:
    """One flight.

    Attributes:
        field: Name of the file.
        seed: Chooses the height.
        outcome: `success` beyond the finish; else as the episode ended.
        time_s: Time at the finish, or at the end of the episode, s.
        limit_s: Time limit, s.
        finish_x_m: x of the finish, m.
        start_z_m: Height of the start.
        clearance_m: Least true distance to a sphere.
        collisions: Times that it started to touch one before the finish.
    """

    field: str
    seed: int
    outcome: str
    time_s: float
    limit_s: float
    finish_x_m: float
    start_z_m: float
    clearance_m: float
    collisions: int


@dataclass(frozen=True)
class DodgeSummary:
    """All flights in one field, or in `all`.

    Attributes:
        fields: Name of the field, or `all`.
        flights: Number of flights.
        success: Share of them.
        mean_time_s: Mean time of the successes, s.
        restricted_mean_s: Over all, a failure counted at the limit.
        total_collisions: Number of collisions in all flights.
    """

    fields: str
    flights: int
    success: float
    mean_time_s: float
    restricted_mean_s: float
    total_collisions: int


def bench_dodge(
    files: Files, repeats: int, seed: int, progress: Progress
) -> list[DodgeRow | DodgeSummary]:
    """Fly through every field of a folder with `repeats` seeds; a row for each, and summaries.

    Raises:
        InputError: No fields, one that cannot be read, or no such stack.
    """
    refuse_unknown_stack(files.stack)
    worlds = [read_field(path) for path in files_named(files.path, "*.csv")]
    trials = (
        Trial(
            world,
            replace(dodge_config(world, number), stack=files.stack),
            files.log_folder("dodge") / f"{world.name}-{number}.mcap",
        )
        for world in worlds
        for number in range(seed, seed + repeats)
    )
    rows = [_row(finished) for finished in run_trials(trials, progress)]
    groups: dict[str, list[DodgeRow]] = defaultdict(list)
    for row in rows:
        groups[row.field].append(row)
    groups["all"] = rows
    summaries = [summarise(name, some) for name, some in groups.items()]
    return [*rows, *summaries]


def read_field(path: Path) -> FileWorld:
    """Return one field with its protocol.

    Raises:
        InputError: Naming the line that is no sphere.
    """
    try:
        found = read_table(path, ImportOptions())
        ends: dict[str, Any] = {"start": (0.0, 0.0, 0.0), "goal": (GOAL_X, 0.0, 0.0)}
        found = replace(found, low=LOW, high=HIGH, start_heading=0.0, **ends)
        found.source = path.name
        limits = {"finish_x": FINISH, "limit": LIMIT, "settings": SETTINGS}
        found.protocol = json.dumps({"name": "dodge", **limits})
        text = world_text(found, complete(found), path.stem)
        return world_of(text, path)
    except WorldFileError as error:
        raise InputError(str(error)) from None


def dodge_config(world: FileWorld, seed: int) -> Config:
    """Return the protocol's settings, and the start and goal of a seed."""
    start, goal = flight_ends(world, seed)
    config = override(Config(world.name, ROBOT, seed), SETTINGS)
    return replace(config, start=start, goal=goal)


def flight_ends(world: FileWorld, seed: int) -> tuple[Point, Point]:
    """Return a start over the origin that is free, and the free goal nearest to straight ahead.

    Raises:
        InputError: The field leaves no such place.
    """
    radius, rng = ROBOTS[ROBOT].spec.radius, np.random.default_rng([seed, *b"dodge"])
    for height in np.round(rng.uniform(*START_HEIGHTS, size=100), 3).tolist():
        if world.contains_obstacle((0.0, 0.0, height), radius + START_ROOM) is None:
            break
    else:
        raise InputError(f"field '{world.name}': no free start over the origin")
    steps = np.linspace(-5.0, 5.0, 21)
    places = [(y, height + z) for y in steps for z in steps if 1.0 <= height + z <= 14.0]
    places.sort(key=lambda place: (np.hypot(place[0], place[1] - height), place))
    for y, z in places:
        goal = (GOAL_X, float(y), float(z))
        if world.contains_obstacle(goal, radius + GOAL_ROOM) is None:
            return (0.0, 0.0, height), goal
    raise InputError(f"field '{world.name}': no free goal at x = {GOAL_X:g} m")


def summarise(name: str, rows: list[DodgeRow]) -> DodgeSummary:
    """Return shares and means of some flights."""
    times = [row.time_s for row in rows if row.outcome == "success"]
    limited = [row.time_s if row.outcome == "success" else LIMIT for row in rows]
    return DodgeSummary(
        fields=name,
        flights=len(rows),
        success=len(times) / len(rows),
        mean_time_s=float(np.mean(times)) if times else LIMIT,
        restricted_mean_s=float(np.mean(limited)),
        total_collisions=sum(row.collisions for row in rows),
    )


def _row(finished: Finished) -> DodgeRow:
    trial, result = finished.trial, finished.result
    height = trial.config.start[2] if trial.config.start else 0.0
    row = DodgeRow(
        field=trial.world.name,
        seed=trial.config.seed,
        outcome="refused",
        time_s=0.0,
        limit_s=LIMIT,
        finish_x_m=FINISH,
        start_z_m=height,
        clearance_m=0.0,
        collisions=0,
    )
    if result is None:
        return row
    passed = finished.first(lambda x, y, z: x >= FINISH)
    if passed is not None and passed <= LIMIT:
        outcome, time, collisions = "success", passed, 0  # an episode ends at its first collision
    else:
        outcome, time, collisions = result.outcome, result.sim_time_s, result.collisions
        outcome = "timeout" if outcome == "success" else outcome
    return replace(
        row,
        outcome=outcome,
        time_s=time,
        clearance_m=result.min_clearance_m,
        collisions=collisions,
    )
