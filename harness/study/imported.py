"""Worlds of a study from a folder of the user, as those of a published benchmark."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import msgspec
import numpy as np

from wayproof.harness.config import Config
from wayproof.harness.errors import InputError
from wayproof.harness.scenario.robots import find_robot
from wayproof.models.robots import RobotSpec
from wayproof.models.world_files import (
    FileWorld,
    ImportOptions,
    WorldFileError,
    world_of,
    world_text,
)
from wayproof.models.world_files.ends import complete
from wayproof.models.world_files.importer import FORMATS

WORLDS = Path("worlds")
"""Folder of the world files, one folder in it for each study."""

Point = tuple[float, float, float]
Ends = tuple[Point, Point]

DRAWS = 100
"""Heights that are drawn for a start before a world is refused."""

SIDEWAYS = tuple(np.linspace(-5.0, 5.0, 21).tolist())
"""Places beside straight ahead, and above and below it, where a goal may be, m."""

LOWEST = 1.0
"""Least distance of a goal from the bottom and top of the area, m."""


class Imports(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Import of a folder: what its files do not say, the same for all of them.

    Attributes:
        folder: The folder, `--set import.folder=DIR`.
        files: Pattern of the files' names, with one `*`; their endings say the format.
        start: Start on the floor, m.
        goal: Goal, m.
        heading: Heading at the start, rad.
        low: Least corner of the operating area, m.
        high: Greatest corner, m.
        way: Name of the file of a published way from start to goal, with a `*` as in `files`: an
            array (n, 2) of cells. Its length is that of the world's shortest way.
        way_cell: Side of a cell, m.
        way_origin: Centre of the cell (0, 0), m.
        heights: Least and greatest height of a start in the air, m: each seed draws one, and its
            goal is the free place that is nearest to straight ahead.
        start_room: Least distance of a drawn start from everything, from the body on, m.
        goal_room: Likewise of a goal.
        ends: World -> start and goal of each seed; filled in where heights are drawn.
    """

    folder: str = ""
    files: str = "*"
    start: Point = (0.0, 0.0, 0.0)
    goal: Point = (0.0, 0.0, 0.0)
    heading: float = 0.0
    low: Point = (0.0, 0.0, 0.0)
    high: Point = (0.0, 0.0, 0.0)
    way: str = ""
    way_cell: float = 1.0
    way_origin: tuple[float, float] = (0.0, 0.0)
    heights: tuple[float, float] | None = None
    start_room: float = 1.0
    goal_room: float = 1.0
    ends: dict[str, dict[int, Ends]] = {}


def import_worlds(
    imports: Imports, study: str, robot: str, seeds: list[int]
) -> tuple[list[str], Imports]:
    """Import all files of a folder, and write a world file of each.

    Args:
        imports: The import.
        study: Name of the study.
        robot: Name of the robot whose body the ends must leave room for.
        seeds: Seeds that heights are drawn for.

    Returns:
        The names of the world files, numbers by value, and the import with all ends.

    Raises:
        InputError: No folder, no such file in it, or one that cannot be taken.
    """
    if not imports.folder:
        raise InputError(f"study '{study}': expected --set import.folder=DIR, where its worlds are")
    folder = Path(imports.folder)
    found = sorted(folder.glob(imports.files), key=lambda path: (len(path.name), path.name))
    if not found:
        raise InputError(f"import.folder: no '{imports.files}' in '{folder}'")
    (WORLDS / study).mkdir(parents=True, exist_ok=True)
    spec = find_robot(Config("", robot, 0)).spec
    names, ends = [], {}
    for path in found:
        world = _import_one(imports, path)
        target = WORLDS / study / f"{path.stem}.xml"
        target.write_text(world.text, encoding="utf-8")
        names.append(str(target))
        if imports.heights is not None:
            ends[names[-1]] = {seed: flight_ends(imports, world, spec, seed) for seed in seeds}
    return names, msgspec.structs.replace(imports, ends=ends)


def _import_one(imports: Imports, path: Path) -> FileWorld:
    try:
        if path.suffix not in FORMATS:
            raise InputError(f"'{path}': expected one of {', '.join(FORMATS)}")
        found = FORMATS[path.suffix](path, ImportOptions())
        found = replace(
            found,
            start=imports.start,
            goal=imports.goal,
            start_heading=imports.heading,
            low=imports.low,
            high=imports.high,
        )
        found.source = path.name
        if imports.way:
            found.route_length = way_length(imports, path)
        return world_of(world_text(found, complete(found), path.stem), path)
    except WorldFileError as error:
        raise InputError(str(error)) from None


def way_length(imports: Imports, path: Path) -> float:
    """Return the length of the published way of a world, from start to goal, m.

    Raises:
        InputError: It cannot be read.
    """
    before, _, after = imports.files.partition("*")
    part = path.name.removeprefix(before).removesuffix(after)
    file = path.with_name(imports.way.replace("*", part))
    try:
        cells = np.load(file, allow_pickle=False)
    except (OSError, ValueError, EOFError) as error:
        raise InputError(f"{file}: {' '.join(str(error).split())[:100]}") from None
    if cells.ndim != 2 or cells.shape[1] != 2:
        raise InputError(f"{file}: got {cells.shape}, expected cells (n, 2)")
    between = imports.way_cell * cells + imports.way_origin
    way = np.vstack([imports.start[:2], between, imports.goal[:2]])
    return float(np.linalg.norm(np.diff(way, axis=0), axis=1).sum())


def flight_ends(imports: Imports, world: FileWorld, spec: RobotSpec, seed: int) -> Ends:
    """Return a free start above the world's own, and the free goal nearest to straight ahead.

    Raises:
        InputError: The world leaves no such place.
    """
    assert imports.heights is not None
    (x, y, _), (far, _, _) = imports.start, imports.goal
    rng = np.random.default_rng([seed, *b"dodge"])
    for height in np.round(rng.uniform(*imports.heights, size=DRAWS), 3).tolist():
        room = spec.radius + imports.start_room
        if world.contains_obstacle((x, y, height), room) is None:
            break
    else:
        raise InputError(f"world '{world.name}': no free start above {x:g},{y:g}")
    bottom, top = imports.low[2] + LOWEST, imports.high[2] - LOWEST
    places = [
        (y + aside, height + above)
        for aside in SIDEWAYS
        for above in SIDEWAYS
        if bottom <= height + above <= top
    ]
    places.sort(key=lambda place: (np.hypot(place[0] - y, place[1] - height), place))
    for across, up in places:
        goal = (far, float(across), float(up))
        if world.contains_obstacle(goal, spec.radius + imports.goal_room) is None:
            return (x, y, height), goal
    raise InputError(f"world '{world.name}': no free goal at x = {far:g} m")
