"""Import of worlds: from another tool's file to a world file."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from pathlib import Path

import numpy as np

from wayproof.models.arrays import Vector3
from wayproof.models.world_files.heights import read_heights
from wayproof.models.world_files.meshes import read_mesh
from wayproof.models.world_files.mjcf_scenes import read_mjcf
from wayproof.models.world_files.occupancy_maps import read_occupancy_map
from wayproof.models.world_files.octomaps import read_octomap
from wayproof.models.world_files.options import Ends, Found, ImportOptions
from wayproof.models.world_files.parts import bounds_of
from wayproof.models.world_files.reading import WorldFileError, check_file
from wayproof.models.world_files.sdf import read_sdf
from wayproof.models.world_files.solids import solid_of
from wayproof.models.world_files.tables import read_table
from wayproof.models.world_files.voxel_maps import read_voxel_map
from wayproof.models.world_files.world_file import FLOOR_KIND, FileWorld, world_of, world_text
from wayproof.models.worlds.solvability import RESOLUTION, free_cells, label_regions
from wayproof.models.worlds.world import World

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
"""Readers by the ending of a file's name."""

BORDER = 1.0
"""Border of the operating area around the solids, where a file gives no area, m."""

AREA_DEPTH = 0.5
"""Depth of the operating area below the floor, m."""

HEADROOM = 1.0
"""Above the highest thing, m; and at least this area's height is `LEAST_TOP`."""

LEAST_TOP = 3.0

END_CLEARANCE = 0.75
"""Clearance of chosen starts and goals from every solid, m, as in the generated worlds."""

MOST_FACES, MOST_AREA = 5000, 4_000_000
"""Triangles, and cells of the area, up to which ends are chosen: else it would take minutes."""

END_BAND = (0.03, 1.6)
"""Height band that is clear above chosen starts and goals, m: both robots'."""


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
    ending = path.suffix.lower()
    if ending not in FORMATS:
        raise WorldFileError(path, f"unknown format '{ending}' (available: {', '.join(FORMATS)})")
    check_file(path)
    found = FORMATS[ending](path, options or ImportOptions())
    if not found.parts:
        raise WorldFileError(path, "nothing solid in it")
    digest = hashlib.sha256(path.read_bytes()).hexdigest()[:16]
    found.source = found.source or f"{path.name}, sha256 {digest}"
    found.start, found.goal = start or found.start, goal or found.goal
    text = world_text(found, complete(found), path.stem)
    return world_of(text, path), found.notes


def complete(found: Found) -> Ends:
    """Operating area, start and goal: the file's own, or chosen and noted where it gives none.

    Raises:
        WorldFileError: There is too much to choose a start and a goal in.
    """
    low, high = bounds_of(found.parts)
    for point in (found.start, found.goal):
        if point is not None:
            low, high = np.minimum(low, point), np.maximum(high, point)
    if found.low is None:
        found.low = (float(low[0]) - BORDER, float(low[1]) - BORDER, -AREA_DEPTH)
    if found.high is None:
        top = max(LEAST_TOP, float(high[2]) + HEADROOM)
        found.high = (float(high[0]) + BORDER, float(high[1]) + BORDER, top)
    start, goal = found.start, found.goal
    if start is None or goal is None:
        chosen = _chosen_ends(found, found.low, found.high)
        for name, given, point in zip(("start", "goal"), (start, goal), chosen, strict=True):
            if given is None:
                found.notes.append(f"{name} chosen: ({point[0]:g}, {point[1]:g})")
        start, goal = start or chosen[0], goal or chosen[1]
    heading = found.start_heading
    if heading is None:
        heading = float(np.arctan2(goal[1] - start[1], goal[0] - start[0]))
    return Ends(found.low, found.high, start, heading, goal)


def _chosen_ends(found: Found, low: Vector3, high: Vector3) -> tuple[Vector3, Vector3]:
    """Start near the area's low corner, goal near its high one, in the largest region of space."""
    faces = sum(len(part.mesh.faces) for part in found.parts if part.mesh is not None)
    cells_wide = np.subtract(high, low)[:2] / RESOLUTION
    if faces > MOST_FACES or np.prod(cells_wide) > MOST_AREA:
        what = f"{faces} triangles, {cells_wide[0]:.0f} x {cells_wide[1]:.0f} cells"
        raise WorldFileError(
            found.source, f"{what}: too much to choose in; give --start and --goal"
        )
    middle = [(a + b) / 2.0 for a, b in zip(low, high, strict=True)]
    place: Vector3 = (middle[0], middle[1], 0.0)
    solids = tuple(solid_of(part) for part in found.parts if part.kind != FLOOR_KIND)
    area = World("area", 0, low, high, solids, place, 0.0, place)
    free = free_cells(area, END_CLEARANCE, END_BAND)
    rim = int(np.ceil(END_CLEARANCE / RESOLUTION))
    free[:rim] = free[-rim:] = free[:, :rim] = free[:, -rim:] = False
    labels = label_regions(free)
    sizes = np.bincount(labels.ravel())[1:]
    if not len(sizes):
        what = f"no space {END_CLEARANCE:g} m from everything: give --start and --goal"
        raise WorldFileError(found.source, what)
    cells = np.argwhere(labels == 1 + int(np.argmax(sizes)))
    order = cells.sum(axis=1)
    points = [
        np.round(np.array(low[:2]) + (cells[n] + 0.5) * RESOLUTION, 3).tolist()
        for n in (int(np.argmin(order)), int(np.argmax(order)))
    ]
    return (points[0][0], points[0][1], 0.0), (points[1][0], points[1][1], 0.0)
