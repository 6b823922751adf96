"""Cutting of beam patterns into tiles of neighbours, each inside a cone."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wayproof.kernel_compiler import kernel
from wayproof.models.rays.bounds import fit_cones
from wayproof.models.rays.records import Pattern

TILE = 8
"""Beams along each side of a tile: enough to fill vector registers, few enough to be narrow."""

BLOCK = 4
"""Tiles along each side of a block, which rules geoms out for all its tiles at once."""

CURVE_BITS = 8
"""Bits of each cell coordinate on the sphere: 2^8 x 2^8 cells are as many as 16 bits number, which
numpy sorts fastest, and far smaller than a tile of any sensor."""


def cut_grid(
    directions: NDArray[np.float64],
    rows: int,
    columns: int,
    pose_indices: NDArray[np.int32] | None = None,
) -> Pattern:
    """Cut a grid of beams into square tiles and blocks.

    Args:
        directions: (rows * columns, 3) unit vectors, sensor frame, row-major.
        rows: Number of rows of the grid.
        columns: Number of columns.
        pose_indices: (rows * columns,) scan pose that each beam leaves from; all from one if left
            out.

    Raises:
        ValueError: There is no beam, or one is no unit vector; MuJoCo ends the process on a ray
            without length. Or a shape is wrong, or a pose index negative.
    """
    if rows * columns == 0:
        raise ValueError(f"beams: got {rows} rows x {columns} columns, expected at least one each")
    if len(directions) != rows * columns:
        raise ValueError(f"beams: got {len(directions)}, expected {rows} rows x {columns} columns")
    places, tile_starts, block_starts = _order(rows, columns)
    return _pattern(directions, pose_indices, places, tile_starts, block_starts)


def cut_scattered(
    directions: NDArray[np.float64], pose_indices: NDArray[np.int32] | None = None
) -> Pattern:
    """Cut beams in any order into tiles of neighbours; cheap enough to do it for every sweep.

    Beams are sorted along a Hilbert curve, on which what is near is near on the sphere, and cut
    into runs.

    Args:
        directions: (n, 3) unit vectors, sensor frame.
        pose_indices: (n,) as for `cut_grid`.

    Raises:
        ValueError: As for `cut_grid`.
    """
    if len(directions) == 0:
        raise ValueError("beams: got 0, expected at least one")
    cells = np.empty(len(directions), np.uint16)
    number_cells(np.array(directions, np.float64, order="C"), cells)
    places = np.argsort(cells, kind="stable")
    tile_starts = _runs(len(places), TILE * TILE)
    return _pattern(
        directions, pose_indices, places, tile_starts, _runs(len(tile_starts) - 1, BLOCK**2)
    )


def _pattern(
    directions: NDArray[np.float64],
    pose_indices: NDArray[np.int32] | None,
    places: NDArray[np.int64],
    tile_starts: NDArray[np.int64],
    block_starts: NDArray[np.int64],
) -> Pattern:
    _check(directions, pose_indices)
    if pose_indices is None:
        pose_indices = np.zeros(len(places), np.int32)
    beams = np.ascontiguousarray(np.asarray(directions, np.float64)[places].T)
    tile_cones, block_cones = (
        np.empty((len(tile_starts) - 1, 5)),
        np.empty((len(block_starts) - 1, 5)),
    )
    fit_cones(beams, tile_starts, tile_cones)
    fit_cones(beams, tile_starts[block_starts], block_cones)
    return Pattern(
        beams=beams,
        places=places,
        tile_starts=tile_starts,
        tile_cones=tile_cones,
        block_starts=block_starts,
        block_cones=block_cones,
        pose_indices=np.asarray(pose_indices, np.int32)[places],
    )


def _check(directions: NDArray[np.float64], pose_indices: NDArray[np.int32] | None) -> None:
    squared = np.einsum("ij,ij->i", directions, directions)
    if not (np.abs(squared - 1.0) < 2e-9).all():
        worst = int(np.argmax(np.abs(squared - 1.0)))
        raise ValueError(f"beam {worst}: got length {np.sqrt(squared[worst]):g}, expected 1")
    if pose_indices is not None:
        if np.shape(pose_indices) != (len(directions),):
            raise ValueError(
                f"pose_indices: got shape {np.shape(pose_indices)}, expected one a beam"
            )
        if np.min(pose_indices) < 0:
            raise ValueError(f"pose_indices: got {np.min(pose_indices)}, expected none below 0")


def _order(
    rows: int, columns: int
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
    """Return places block by block, inside them tile by tile, and starts of tiles and blocks."""
    grid = np.arange(rows * columns).reshape(rows, columns)
    tiles: list[NDArray[np.int64]] = []
    block_starts = [0]
    for block in _squares(grid, TILE * BLOCK):
        tiles += [tile.ravel() for tile in _squares(block, TILE)]
        block_starts.append(len(tiles))
    tile_starts = np.cumsum([0, *(len(tile) for tile in tiles)])
    return np.concatenate(tiles), tile_starts, np.array(block_starts)


def _squares(grid: NDArray[np.int64], side: int) -> list[NDArray[np.int64]]:
    """Cut a grid into squares; those at the far edges are smaller."""
    return [
        grid[row : row + side, column : column + side]
        for row in range(0, grid.shape[0], side)
        for column in range(0, grid.shape[1], side)
    ]


def _runs(count: int, length: int) -> NDArray[np.int64]:
    """Return the starts of runs of `length`, the last one shorter, and the count."""
    return np.append(np.arange(0, count, length), count)


@kernel
def number_cells(directions: NDArray[np.float64], cells: NDArray[np.uint16]) -> None:
    """Number each direction's cell along a Hilbert curve over the octahedral map of the sphere.

    The map (Cigolle et al. 2014, "A survey of efficient representations for independent unit
    vectors") has its seam behind the sensor. The walk down the curve is that of Hilbert 1891.
    """
    side = 1 << CURVE_BITS
    for i in range(len(directions)):
        x, y, z = directions[i, 0], directions[i, 1], directions[i, 2]
        total = abs(x) + abs(y) + abs(z)
        e, f = y / total, z / total
        if x < 0.0:
            e, f = np.copysign(1.0 - abs(f), e), np.copysign(1.0 - abs(e), f)
        column = min(int((e + 1.0) * 0.5 * side), side - 1)
        row = min(int((f + 1.0) * 0.5 * side), side - 1)
        place = 0
        half = side >> 1
        while half > 0:
            right, upper = (column & half) > 0, (row & half) > 0
            place += half * half * ((3 * right) ^ upper)
            if not upper:
                if right:
                    column, row = ~column, ~row
                column, row = row, column
            half >>= 1
        cells[i] = place
