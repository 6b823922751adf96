"""Cells of grids as merged boxes: of point clouds, and of voxel maps as text (`.3dmap`)."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wayproof.models.arrays import Vector3
from wayproof.models.world_files.options import Found, ImportOptions
from wayproof.models.world_files.parts import Part, moved, turned_by, vector
from wayproof.models.world_files.reading import MAX_CELLS, MAX_SOLIDS, WorldFileError, read_text

MAX_HEAD = 200
"""Maximum length of the first line, characters."""


def read_voxels(path: Path) -> NDArray[np.bool_]:  # (nx, ny, nz)
    """Read the occupied cells of a `.3dmap`: a line `voxel X Y Z`, then one cell a line.

    Source: Brewer and Sturtevant, "Benchmarks for Pathfinding in 3D Voxel Space", SoCS 2018.

    Raises:
        WorldFileError: Naming the line that is no cell of the map.
    """
    text = read_text(path)
    first = text[:MAX_HEAD].partition("\n")[0]
    head = first.split()
    if len(head) != 4 or head[0] != "voxel" or not all(word.isdecimal() for word in head[1:]):
        raise WorldFileError(path, f"got '{first[:60]}', expected 'voxel X Y Z'", 1)
    shape = tuple(int(word) for word in head[1:])
    if min(shape) < 1 or shape[0] * shape[1] * shape[2] > MAX_CELLS:
        raise WorldFileError(path, f"{shape} cells, expected 1 to {MAX_CELLS}", 1)
    occupied = np.zeros(shape, np.bool_)
    lines = io.StringIO(text)
    next(lines)
    for number, line in enumerate(lines, start=2):
        words = line.split()
        if not words:
            continue
        cell = tuple(int(word) for word in words if word.isdecimal())
        if len(words) != 3 or len(cell) != 3 or any(map(int.__ge__, cell, shape)):
            raise WorldFileError(
                path, f"got '{line[:60].strip()}', expected a cell within {shape}", number
            )
        occupied[cell] = True
    return occupied


def merged_boxes(occupied: NDArray[np.bool_]) -> NDArray[np.int64]:  # (n, 2, 3)
    """Merge the occupied cells exactly into few boxes: first cell, and the one past the last.

    Each box begins at the first cell that is not covered yet and grows along z, then y, then x for
    as long as all that it takes in is occupied and uncovered. Not the fewest, but disjoint.

    Args:
        occupied: (nx, ny, nz).

    Raises:
        ValueError: They are more than a world may hold.
    """
    left = occupied.copy()
    boxes = []
    for i in range(len(left)):
        for j, k in np.argwhere(left[i]).tolist():
            if not left[i, j, k]:
                continue
            z = k + _run(left[i, j, k:])
            y = j + _run(np.asarray(left[i, j:, k:z].all(axis=1)))
            x = i + _run(np.asarray(left[i:, j:y, k:z].all(axis=(1, 2))))
            left[i:x, j:y, k:z] = False
            boxes.append(((i, j, k), (x, y, z)))
            if len(boxes) > MAX_SOLIDS:
                raise ValueError(f"more than {MAX_SOLIDS} boxes")
    return np.array(boxes, np.int64).reshape(-1, 2, 3)


def _run(taken: NDArray[np.bool_]) -> int:
    """Return the length of the run of true values from the first on."""
    return len(taken) if taken.all() else int(np.argmin(taken))


def read_voxel_map(path: Path, options: ImportOptions) -> Found:
    """Read occupied cells as merged boxes; the map's low corner is the world's origin.

    Raises:
        WorldFileError: Naming the line that is no cell of the map.
    """
    parts = cell_boxes(path, read_voxels(path), options.resolution, (0.0, 0.0, 0.0))
    return Found(parts=parts, plane=True, closed=True)


def cell_boxes(
    path: Path,
    occupied: NDArray[np.bool_],
    resolution: ArrayLike,
    origin: Vector3,
    yaw: float = 0.0,
) -> list[Part]:
    """Merge the cells of a grid into boxes.

    Args:
        path: Path of the map's file.
        occupied: (nx, ny, nz).
        resolution: Side of a cell, or (3,) sides, m.
        origin: Low corner of the grid in the world, m.
        yaw: Turn of the grid about that corner, rad.

    Raises:
        WorldFileError: They are more than a world may hold.
    """
    try:
        boxes = merged_boxes(occupied)
    except ValueError as error:
        raise WorldFileError(path, str(error)) from None
    R, half = turned_by(0.0, 0.0, yaw), np.multiply(resolution, 0.5)
    return [
        moved(Part("box", vector((high - low) * half), vector((low + high) * half)), origin, R)
        for low, high in boxes
    ]


def cells_of_points(path: Path, points: NDArray[np.float64], options: ImportOptions) -> Found:
    """Return the cells that hold points (n, 3), m, as merged boxes.

    Args:
        path: The file.
        points: Points that are not finite are left out and counted.
        options: Side of a cell, and scale.

    Raises:
        WorldFileError: No point, or more cells than allowed.
    """
    finite = points[np.isfinite(points).all(axis=1)] * options.scale
    if not len(finite):
        raise WorldFileError(path, "no finite point")
    with np.errstate(over="ignore"):  # too many cells are refused below
        cells = np.floor(finite / options.resolution)
        low, shape = cells.min(axis=0), np.ptp(cells, axis=0) + 1
        count = float(np.prod(shape))
    if not count <= MAX_CELLS:
        listed = " x ".join(f"{size:.0f}" for size in shape)
        raise WorldFileError(
            path, f"{listed} cells, expected at most {MAX_CELLS}: a larger --resolution, or cut it"
        )
    occupied = np.zeros(tuple(shape.astype(np.int64)), np.bool_)
    occupied[tuple((cells - low).astype(np.int64).T)] = True
    found = Found(grid=True, closed=True)
    origin = vector(low * options.resolution)
    found.parts = cell_boxes(path, occupied, options.resolution, origin)
    found.notes.append(
        f"{len(finite)} points as {int(occupied.sum())} cells of {options.resolution:g} m"
    )
    if left_out := len(points) - len(finite):
        found.notes.append(f"{left_out} points are not finite: left out")
    return found
