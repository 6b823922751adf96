"""Kernels of distances that are computed on request: which blocks, and optimistic distances.

Blocks, planes and sections are those of the distance transform, see `edt`.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wayproof.maps._jit import kernel


@kernel
def find_needed(
    requested: NDArray[np.bool_],  # (blocks, nx) of the field
    pending: NDArray[np.bool_],  # (blocks, nx)
    reach: int,
    needed: NDArray[np.bool_],  # (blocks, nx) out
) -> None:
    """Find the outdated sections within reach of requested blocks of the field."""
    blocks, nx = requested.shape
    for b in range(blocks):
        # From the nearest request at lower x, then from the one at higher x.
        last = -reach
        for x in range(nx):
            last = x if requested[b, x] else last
            needed[b, x] = pending[b, x] and x - last < reach
        last = nx - 1 + reach
        for x in range(nx - 1, -1, -1):
            last = x if requested[b, x] else last
            needed[b, x] |= pending[b, x] and last - x < reach


@kernel
def dilate(
    marked: NDArray[np.bool_],  # (blocks, nx)
    blocks_beside: int,
    planes_beside: int,
    dilated: NDArray[np.bool_],  # (blocks, nx) out: marked, or that near to one that is
) -> None:
    """Mark the blocks around marked ones as well."""
    blocks, nx = marked.shape
    dilated[:] = False
    for b in range(blocks):
        last = -planes_beside - 1
        for x in range(-planes_beside, nx):
            ahead = x + planes_beside
            if ahead < nx and marked[b, ahead]:
                last = ahead
            if x >= 0 and x - last <= planes_beside:
                for c in range(max(0, b - blocks_beside), min(blocks, b + blocks_beside + 1)):
                    dilated[c, x] = True


@kernel
def write_optimistic(
    shape: tuple[int, int, int],  # (nx, ny, nz)
    block_rows: int,
    requested: NDArray[np.bool_],  # (blocks, nx) where to write anew
    to_obstacles: NDArray[np.uint16],  # (nx * ny * nz,)
    to_not_free: NDArray[np.uint16],  # (nx * ny * nz,)
    limits: tuple[int, int],  # `edge`, and the greatest of all distances
    optimistic: NDArray[np.uint16],  # (nx * ny * nz,) in, out
) -> None:
    """Write distances to obstacles, cut off at `edge` where anything not free is nearer."""
    nx, ny, nz = shape
    edge, far = np.uint16(limits[0]), np.uint16(limits[1])
    for b in range(requested.shape[0]):
        first, end = b * block_rows, min(ny, (b + 1) * block_rows)
        for x in range(nx):
            if not requested[b, x]:
                continue
            # Unsigned: in whole vectors.
            for k in range(np.uint64((x * ny + first) * nz), np.uint64((x * ny + end) * nz)):
                limit = min(edge, far) if to_not_free[k] < edge else far
                optimistic[k] = min(to_obstacles[k], limit)
