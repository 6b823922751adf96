"""From a file that others made to a world file."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from pathlib import Path

import numpy as np

from models.imports.heights import read_heights
from models.imports.meshes import read_mesh
from models.imports.mjcf_scenes import read_mjcf
from models.imports.occupancy_maps import read_occupancy_map
from models.imports.octomaps import read_octomap
from models.imports.options import Found, ImportOptions
from models.imports.parts import Vector3, bounds_of
from models.imports.reading import Unreadable, check_file
from models.imports.sdf import read_sdf
from models.imports.solids import solid_of
from models.imports.tables import read_table
from models.imports.voxel_maps import read_voxel_map
from models.imports.world_file import FileWorld, world_of, world_text
from models.worlds.solvability import RESOLUTION, free_cells, label_regions
from models.worlds.world import World

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
    ".obj": read_mesh,
    ".stl": read_mesh,
    ".npy": read_heights,
    ".png": read_heights,
}
"""Ending of a file's name -> what reads it."""

BORDER = 1.0
"""Of the operating area beyond what stands in it, where a file tells none, m."""

BELOW = 0.5
"""How far the operating area goes below the floor, m."""

HEADROOM = 1.0
"""Above the highest thing, m; and at least this area's height is `LEAST_TOP`."""

LEAST_TOP = 3.0

ROOM = 0.75
"""Distance that chosen starts and goals keep from everything, m: the generated worlds' own."""

BAND = (0.03, 1.6)
"""Height band that is kept free there, m: both robots'."""


def import_world(
    path: Path,
    options: ImportOptions | None = None,
    start: Vector3 | None = None,
    goal: Vector3 | None = None,
) -> tuple[FileWorld, list[str]]:
    """Read a file of any known format as a world.

    Args:
        path: The file; its ending says the format.
        options: What the file does not say.
        start: On the floor, in place of the file's own, m.
        goal: Likewise.

    Returns:
        The world, and a line for everything that was left out or chosen.

    Raises:
        Unreadable: Naming the file, and where it can the element and the line.
    """
    ending = path.suffix.lower()
    if ending not in FORMATS:
        raise Unreadable(path, f"unknown format '{ending}' (available: {', '.join(FORMATS)})")
    check_file(path)
    found = FORMATS[ending](path, options or ImportOptions())
    if not found.parts:
        raise Unreadable(path, "nothing solid in it")
    digest = hashlib.sha256(path.read_bytes()).hexdigest()[:16]
    found.source = found.source or f"{path.name}, sha256 {digest}"
    found.start, found.goal = start or found.start, goal or found.goal
    complete(found)
    return world_of(world_text(found, path.stem), path.stem, path), found.notes


def complete(found: Found) -> None:
    """Settle the operating area, the start and the goal where a file tells none."""
    low, high = bounds_of(found.parts)
    for point in (found.start, found.goal):
        if point is not None:
            low, high = np.minimum(low, point), np.maximum(high, point)
    if found.low is None:
        found.low = (float(low[0]) - BORDER, float(low[1]) - BORDER, -BELOW)
    if found.high is None:
        top = max(LEAST_TOP, float(high[2]) + HEADROOM)
        found.high = (float(high[0]) + BORDER, float(high[1]) + BORDER, top)
    if found.start is None or found.goal is None:
        _choose_ends(found)
    if found.start_heading is None and found.start is not None and found.goal is not None:
        ahead = np.subtract(found.goal, found.start)
        found.start_heading = float(np.arctan2(ahead[1], ahead[0]))


def _choose_ends(found: Found) -> None:
    """Start near the area's low corner, goal near its high one, in the largest region of space."""
    assert found.low is not None and found.high is not None
    middle = (np.add(found.low, found.high) / 2.0).tolist()
    place: Vector3 = (middle[0], middle[1], 0.0)
    solids = tuple(solid_of(part) for part in found.parts)
    area = World("area", 0, found.low, found.high, solids, place, 0.0, place)
    free = free_cells(area, ROOM, BAND)
    rim = int(np.ceil(ROOM / RESOLUTION))
    free[:rim] = free[-rim:] = free[:, :rim] = free[:, -rim:] = False
    labels = label_regions(free)
    sizes = np.bincount(labels.ravel())[1:]
    if not len(sizes):
        found.start, found.goal = found.start or place, found.goal or place
        found.notes.append(f"no space {ROOM:g} m from everything: give --start and --goal")
        return
    cells = np.argwhere(labels == 1 + int(np.argmax(sizes)))
    order = cells.sum(axis=1)
    ends = [cells[int(np.argmin(order))], cells[int(np.argmax(order))]]
    points = [np.round(np.array(found.low[:2]) + (end + 0.5) * RESOLUTION, 3) for end in ends]
    for name, (x, y) in zip(("start", "goal"), points, strict=True):
        if getattr(found, name) is None:
            setattr(found, name, (float(x), float(y), 0.0))
            found.notes.append(f"{name} chosen: ({x:g}, {y:g})")
