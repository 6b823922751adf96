"""Voxel maps as text (`.3dmap`): a line `voxel X Y Z`, then the occupied cells, one a line."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from models.imports.options import Found, ImportOptions
from models.imports.parts import Part, Vector3, moved, turned_by, vector
from models.imports.reading import MOST_CELLS, Unreadable, read_text


def read_voxels(path: Path) -> NDArray[np.bool_]:  # (nx, ny, nz)
    """Occupied cells of a `.3dmap`.

    Source: Brewer and Sturtevant, "Benchmarks for Pathfinding in 3D Voxel Space", SoCS 2018.

    Raises:
        Unreadable: Naming the line that is no cell of the map.
    """
    lines = read_text(path).splitlines()
    head = lines[0].split()
    if len(head) != 4 or head[0] != "voxel" or not all(word.isdecimal() for word in head[1:]):
        raise Unreadable(path, f"got '{lines[0][:60]}', expected 'voxel X Y Z'", 1)
    shape = tuple(int(word) for word in head[1:])
    if min(shape) < 1 or shape[0] * shape[1] * shape[2] > MOST_CELLS:
        raise Unreadable(path, f"{shape} cells, expected 1 to {MOST_CELLS}", 1)
    occupied = np.zeros(shape, np.bool_)
    for number, line in enumerate(lines[1:], start=2):
        words = line.split()
        if not words:
            continue
        cell = tuple(int(word) for word in words if word.isdecimal())
        if len(words) != 3 or len(cell) != 3 or any(map(int.__ge__, cell, shape)):
            raise Unreadable(path, f"got '{line[:60]}', expected a cell within {shape}", number)
        occupied[cell] = True
    return occupied


def merged_boxes(occupied: NDArray[np.bool_]) -> NDArray[np.int64]:  # (n, 2, 3)
    """Few boxes that fill exactly the occupied cells: first cell, and the one past the last.

    Each box begins at the first cell that is not covered yet and grows along z, then y, then x for
    as long as all that it takes in is occupied and uncovered. Not the fewest, but disjoint.

    Args:
        occupied: (nx, ny, nz).
    """
    left = occupied.copy()
    boxes = []
    for i, j, k in np.argwhere(occupied).tolist():
        if not left[i, j, k]:
            continue
        z = k + _run(left[i, j, k:])
        y = j + _run(np.asarray(left[i, j:, k:z].all(axis=1)))
        x = i + _run(np.asarray(left[i:, j:y, k:z].all(axis=(1, 2))))
        left[i:x, j:y, k:z] = False
        boxes.append(((i, j, k), (x, y, z)))
    return np.array(boxes, np.int64).reshape(-1, 2, 3)


def _run(taken: NDArray[np.bool_]) -> int:
    """How many are true from the first on."""
    return len(taken) if taken.all() else int(np.argmin(taken))


def read_voxel_map(path: Path, options: ImportOptions) -> Found:
    """The occupied cells as merged boxes; the map's low corner is the world's origin.

    Raises:
        Unreadable: Naming the line that is no cell of the map.
    """
    return Found(parts=cell_boxes(read_voxels(path), options.resolution, (0.0, 0.0, 0.0)))


def cell_boxes(
    occupied: NDArray[np.bool_], resolution: float, origin: Vector3, yaw: float = 0.0
) -> list[Part]:
    """Merged boxes of a grid.

    Args:
        occupied: (nx, ny, nz).
        resolution: Side of a cell, m.
        origin: Low corner of the grid in the world, m.
        yaw: Turn of the grid about that corner, rad.
    """
    R = turned_by(0.0, 0.0, yaw)
    parts = []
    for low, high in merged_boxes(occupied):
        size, centre = (high - low) * (resolution / 2.0), (low + high) * (resolution / 2.0)
        parts.append(moved(Part("box", vector(size), vector(centre)), origin, R))
    return parts
