"""Compiled kernels of distances that are worked out where wanted: which, and presumed ones.

Blocks, planes and sections are those of `_field_kernels`. None of these kernels calls another.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wayproof.maps._jit import kernel


@kernel
def find_needed(
    wanted: NDArray[np.bool_],  # (blocks, nx) of the field
    pending: NDArray[np.bool_],  # (blocks, nx)
    reach: int,
    needed: NDArray[np.bool_],  # (blocks, nx) out
) -> None:
    """Find the outdated sections from which values may lead to blocks of the field."""
    blocks, nx = wanted.shape
    for b in range(blocks):
        last = -reach
        for x in range(nx):
            last = x if wanted[b, x] else last
            needed[b, x] = pending[b, x] and x - last < reach
        last = nx - 1 + reach
        for x in range(nx - 1, -1, -1):
            last = x if wanted[b, x] else last
            needed[b, x] |= pending[b, x] and last - x < reach


@kernel
def widen(
    marked: NDArray[np.bool_],  # (blocks, nx)
    blocks_beside: int,
    planes_beside: int,
    wide: NDArray[np.bool_],  # (blocks, nx) out: marked, or so near to one that is
) -> None:
    """Mark the blocks around marked ones, too."""
    blocks, nx = marked.shape
    wide[:] = False
    for b in range(blocks):
        last = -planes_beside - 1
        for x in range(-planes_beside, nx):
            ahead = x + planes_beside
            if ahead < nx and marked[b, ahead]:
                last = ahead
            if x >= 0 and x - last <= planes_beside:
                for c in range(max(0, b - blocks_beside), min(blocks, b + blocks_beside + 1)):
                    wide[c, x] = True


@kernel
def presume(
    part: tuple[int, int],  # first and one past the last block along y
    shape: tuple[int, int, int],  # (nx, ny, nz)
    block_rows: int,
    wanted: NDArray[np.bool_],  # (blocks, nx) where to write anew
    to_obstacles: NDArray[np.uint16],  # (nx * ny * nz,)
    to_not_free: NDArray[np.uint16],  # (nx * ny * nz,)
    edge: int,
    greatest: int,
    presumed: NDArray[np.uint16],  # (nx * ny * nz,) in, out
) -> None:
    """Distances to obstacles, at most `edge` where something not free is nearer than that."""
    nx, ny, nz = shape
    most, far = np.uint16(edge), np.uint16(greatest)
    for b in range(part[0], part[1]):
        first, end = b * block_rows, min(ny, (b + 1) * block_rows)
        for x in range(nx):
            if not wanted[b, x]:
                continue
            # Unsigned: in whole vectors.
            for k in range(np.uint64((x * ny + first) * nz), np.uint64((x * ny + end) * nz)):
                limit = min(most, far) if to_not_free[k] < most else far
                presumed[k] = min(to_obstacles[k], limit)
