"""Import of worlds: from another tool's file to a world file."""

from __future__ import annotations

import contextlib
import hashlib
from collections.abc import Callable
from pathlib import Path

import numpy as np

from wayproof.models.arrays import Vector3
from wayproof.models.world_files.clouds import read_las, read_pcd
from wayproof.models.world_files.ends import SHORT, Chosen, NoSpaceError, choose_ends
from wayproof.models.world_files.free_space import Ground
from wayproof.models.world_files.ground import FLOOR_KIND, raise_by, settle_ground
from wayproof.models.world_files.heights import read_heights
from wayproof.models.world_files.meshes import ENDINGS, read_mesh
from wayproof.models.world_files.mjcf_scenes import read_mjcf
from wayproof.models.world_files.movers import stood_on_ground
from wayproof.models.world_files.occupancy_maps import read_occupancy_map
from wayproof.models.world_files.octomaps import read_octomap
from wayproof.models.world_files.options import Ends, Found, ImportOptions
from wayproof.models.world_files.parts import bounds_of
from wayproof.models.world_files.reading import FARTHEST, WorldFileError, check_file
from wayproof.models.world_files.sdf import read_sdf
from wayproof.models.world_files.tables import read_table
from wayproof.models.world_files.voxel_maps import read_voxel_map
from wayproof.models.world_files.world_file import FileWorld, world_of, world_text

Reader = Callable[[Path, ImportOptions], Found]

FORMATS: dict[str, Reader] = {
    ".xml": read_mjcf,
    ".mjcf": read_mjcf,
    ".world": read_sdf,
    ".sdf": read_sdf,
    ".csv": read_table,
    ".3dmap": read_voxel_map,
    ".yaml": read_occupancy_map,
    ".bt": read_octomap,
    ".ot": read_octomap,
    ".pcd": read_pcd,
    ".las": read_las,
    ".laz": read_las,
    **dict.fromkeys(ENDINGS, read_mesh),
    ".urdf": read_sdf,
    ".npy": read_heights,
    ".png": read_heights,
}
"""Readers by the ending of a file's name."""

BORDER = 1.0
"""Border of the operating area around the solids, where a file gives no area, m."""

WIDE_BORDER = 5.0
"""Border on an infinite floor where there is little room within the other, m."""

AREA_DEPTH = 0.5
"""Depth of the operating area below the floor, m."""

HEADROOM = 1.0
"""Height of the area above the highest thing, m; and at least this area's height is `LEAST_TOP`."""

LEAST_TOP = 3.0

MOST_TOP = 12.0
"""Greatest height of the operating area, m: a map of it holds the cells up to there."""


def import_world(
    path: Path,
    options: ImportOptions | None = None,
    start: Vector3 | None = None,
    goal: Vector3 | None = None,
) -> tuple[FileWorld, list[str]]:
    """Read a file of any known format as a world.

    Args:
        path: The file; its ending says the format.
        options: Options for what the file does not contain.
        start: Start on the floor, in place of the file's own, m.
        goal: Goal on the floor, likewise, m.

    Returns:
        The world, and a line for everything that was left out or chosen.

    Raises:
        WorldFileError: Naming the file, and where it can the element and the line.
    """
    options = options or ImportOptions()
    found = read_scene(path, options)
    return world_from(path, found, options, start, goal), found.notes


def read_scene(path: Path, options: ImportOptions) -> Found:
    """Read a file of any known format as a scene with its floor settled, but without ends.

    Raises:
        WorldFileError: As `import_world`.
    """
    ending = path.suffix.lower()
    if ending not in FORMATS:
        raise WorldFileError(path, f"unknown format '{ending}' (available: {', '.join(FORMATS)})")
    check_file(path)
    found = FORMATS[ending](path, options)
    if found.parts and not (reach := float(np.abs(bounds_of(found.parts)).max())) <= FARTHEST:
        raise WorldFileError(path, f"a solid up to {reach:g} m away, expected {FARTHEST:g} at most")
    settle_ground(path, found, options)
    if not found.parts and found.low is None:
        raise WorldFileError(path, "nothing solid in it" + _left_out_notes(found))
    digest = hashlib.sha256(path.read_bytes()).hexdigest()[:16]
    found.source = found.source or f"{path.name}, sha256 {digest}"
    return found


def world_from(
    path: Path,
    found: Found,
    options: ImportOptions,
    start: Vector3 | None = None,
    goal: Vector3 | None = None,
) -> FileWorld:
    """Return a scene as a world; its start and goal are chosen where none is given.

    Adds notes to the scene.

    Raises:
        WorldFileError: There is no room for a start and a goal.
    """
    found.start, found.goal = start or found.start, goal or found.goal
    try:
        ends = complete(found, options)
    except NoSpaceError as error:
        raise WorldFileError(
            path, f"{error}, with the floor where it is; --floor for another"
        ) from None
    return world_of(world_text(found, ends, path.stem), path)


def area_of(found: Found) -> tuple[Vector3, Vector3]:
    """Return the corners of a scene's operating area, m: its own, or about the solids."""
    _bound_area(found, BORDER)
    return _area(found)


def _left_out_notes(found: Found) -> str:
    """Return the notes on all that was left out of a file in which nothing is left."""
    if found.missing:
        names = ", ".join(dict.fromkeys(found.missing))
        count = len(found.missing)
        return f": {count} models or files are not there, expected --model-path to {names[:300]}"
    if without := [note for note in found.notes if "--visuals" in note]:
        return f": {'; '.join(without)[:300]}"
    return ", expected a model with a collision, or a plane as the floor"


def complete(found: Found, options: ImportOptions | None = None) -> Ends:
    """Return the area, start and goal: the file's own, or chosen and noted where it gives none.

    A scene with terrain is moved so that the ground is at 0 where the robot starts.

    Raises:
        NoSpaceError: There is no room for a start and a goal.
    """
    given = found.low, found.high
    _bound_area(found, BORDER)
    ground = Ground(found.parts)
    start, goal = (_grounded(point, ground) for point in (found.start, found.goal))
    if start is None or goal is None:
        endless = found.plane or not ground.floors
        wider = endless and not found.closed and bool(found.parts) and given == (None, None)
        chosen = _chosen(found, options or ImportOptions(), start, goal, wider=wider)
        found.notes += chosen.notes
        start, goal = chosen.start, chosen.goal
    if ground.fields and start[2]:
        rise = -start[2]
        raise_by(found, rise)
        start, goal = (start[0], start[1], 0.0), (goal[0], goal[1], goal[2] + rise)
        found.notes.append(
            f"ground at {-rise:g} m at the start: the scene is moved by {rise:g} m in z"
        )
    _stand_movers(found)
    heading = found.start_heading
    if heading is None:
        heading = float(np.arctan2(goal[1] - start[1], goal[0] - start[0]))
    return Ends(*_area(found), start, heading, goal)


def _stand_movers(found: Found) -> None:
    """Put the movers on the floor, and note those that are on another one."""
    if not found.movers:
        return
    found.movers, above = stood_on_ground(found.movers, Ground(found.parts))
    if above:
        found.notes.append(f"{len(above)} actors that are not on this floor: left out")


def _chosen(
    found: Found, options: ImportOptions, start: Vector3 | None, goal: Vector3 | None, *,
    wider: bool,
) -> Chosen:  # fmt: skip
    """Choose ends; where there is little room and the floor goes on, in a wider area.

    Raises:
        NoSpaceError: There is no room in either.
    """
    if wider:
        with contextlib.suppress(NoSpaceError):
            chosen = choose_ends(found, *_area(found), options, start, goal)
            if chosen.way >= SHORT:
                return chosen
        found.low = found.high = None
        _bound_area(found, WIDE_BORDER)
        found.notes.append(
            f"little room in the scene itself: {WIDE_BORDER:g} m of floor around it too"
        )
    return choose_ends(found, *_area(found), options, start, goal)


def _area(found: Found) -> tuple[Vector3, Vector3]:
    assert found.low is not None
    assert found.high is not None
    return found.low, found.high


def _bound_area(found: Found, border: float) -> None:
    """Set the operating area where the file gives none: about all that is solid, or its floor."""
    if found.low is not None and found.high is not None:
        return
    low, high = bounds_of(found.parts) if found.extent is None else np.array(found.extent)
    floors = [part for part in found.parts if part.kind == FLOOR_KIND]
    bottom = 0.0
    if floors and not found.plane:
        (low[:2], high[:2]), border = bounds_of(floors)[:, :2], 0.0
        bottom = min(0.0, float(bounds_of(floors)[0, 2]))
    for point in (found.start, found.goal):
        if point is not None:
            low[:2], high[:2] = np.minimum(low[:2], point[:2]), np.maximum(high[:2], point[:2])
    if found.low is None:
        found.low = (float(low[0]) - border, float(low[1]) - border, bottom - AREA_DEPTH)
    if found.high is None:
        top = float(np.clip(float(high[2]) + HEADROOM, LEAST_TOP, MOST_TOP))
        found.high = (float(high[0]) + border, float(high[1]) + border, top)


def _grounded(point: Vector3 | None, ground: Ground) -> Vector3 | None:
    """Return a point at the floor's height, where the floor is terrain."""
    if point is None or not ground.fields:
        return point
    return point[0], point[1], float(ground.height(np.array([point[:2]]))[0])
