"""A pattern of beams cut into tiles of neighbours, each inside a cone that is found once."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from models.rays.kernels import Pattern

TILE = 8
"""Beams along each side of a tile: enough to fill vector registers, few enough to be narrow."""

BLOCK = 4
"""Tiles along each side of a block, which rules geoms out for all its tiles at once."""

CONE_MARGIN = 1e-12
"""Taken off the cosine, so that rounding never puts a beam outside its cone."""


def cut(directions: NDArray[np.float64], rows: int, columns: int) -> Pattern:
    """Cut a row-major grid of unit directions (rows * columns, 3) into tiles and blocks.

    Raises:
        ValueError: There is no beam, or one is no unit vector; MuJoCo ends the process on a ray
            without length.
    """
    if rows * columns == 0:
        raise ValueError(f"beams: got {rows} rows x {columns} columns, expected at least one each")
    length = np.linalg.norm(directions, axis=1)
    if not (np.abs(length - 1.0) < 1e-9).all():
        worst = int(np.argmax(np.abs(length - 1.0)))
        raise ValueError(f"beam {worst}: got length {length[worst]:g}, expected 1")
    places, tile_starts, block_starts = _order(rows, columns)
    beams = directions[places]
    return Pattern(
        beams=np.ascontiguousarray(beams.T),
        places=places,
        tile_starts=tile_starts,
        tile_cones=_cones(beams, tile_starts),
        block_starts=block_starts,
        block_cones=_cones(beams, tile_starts[block_starts]),
    )


def _order(
    rows: int, columns: int
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
    """Places block by block and, inside a block, tile by tile; starts of tiles and of blocks."""
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


def _cones(beams: NDArray[np.float64], starts: NDArray[np.int64]) -> NDArray[np.float64]:
    """Cone about the mean direction of each run of beams, (len(starts) - 1, 5)."""
    cones = np.empty((len(starts) - 1, 5))
    for cone, start, stop in zip(cones, starts[:-1], starts[1:], strict=True):
        run = beams[start:stop]
        axis = run.sum(axis=0)
        length = np.linalg.norm(axis)
        axis = axis / length if length > 1e-9 else run[0]
        cosine = max(float((run @ axis).min()) - CONE_MARGIN, -1.0)
        cone[:] = *axis, cosine, np.sqrt(1.0 - cosine**2)
    return cones
