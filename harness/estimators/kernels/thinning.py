"""Choice of points that keep a distance from each other."""

from __future__ import annotations

from math import floor

import numpy as np
from numpy.typing import NDArray

from wayproof.harness.estimators.kernels.voxels import EMPTY, slot_of, voxel_key
from wayproof.models._jit import kernel
from wayproof.models.arrays import Array


@kernel
def spread_out(
    points: Array,
    spacing: float,
    keys: NDArray[np.int64],
    heads: NDArray[np.int64],
    following: NDArray[np.int64],
    chosen: NDArray[np.int64],
) -> int:
    """Choose each point in turn that no chosen one is near (dart throwing, Cook 1986, TOG 5).

    One point for each cell of a grid would be biased: where noise puts a few points of a wall into
    the next cell, these would count as much as all others.

    Args:
        points: (n, 3) m.
        spacing: Least distance between two chosen points, m.
        keys: (m,) scratch, m a power of 2 above n; written.
        heads: (m,) likewise.
        following: (n,) likewise.
        chosen: (n,) indices of the chosen points, in their order; written.

    Returns:
        Number of them.
    """
    keys[:] = EMPTY
    count, inverse = 0, 0.5 / spacing
    for index in range(len(points)):
        x, y, z = points[index, 0], points[index, 1], points[index, 2]
        key = voxel_key(x, y, z, inverse)
        i, j, k = beside(x, inverse) << 42, beside(y, inverse) << 21, beside(z, inverse)
        free = True
        for cell in range(8):  # as wide as two spacings: what is near lies in one of these
            other = key
            if cell & 1:
                other += i
            if cell & 2:
                other += j
            if cell & 4:
                other += k
            if is_near(points, index, spacing, other, keys, heads, following):
                free = False
                break
        if not free:
            continue
        slot = slot_of(keys, key)
        following[index] = EMPTY if keys[slot] == EMPTY else heads[slot]
        keys[slot], heads[slot] = key, index
        chosen[count] = index
        count += 1
    return count


@kernel
def beside(x: float, inverse: float) -> np.int64:
    """Step, 1 or -1, to the voxel that is nearer to a coordinate than the one on the other side."""
    place = x * inverse + 0.5
    return np.int64(1) if place - floor(place) >= 0.5 else np.int64(-1)


@kernel
def is_near(
    points: Array,
    index: int,
    spacing: float,
    key: np.int64,
    keys: NDArray[np.int64],
    heads: NDArray[np.int64],
    following: NDArray[np.int64],
) -> bool:
    """Return whether a cell has a chosen point within `spacing` of a point; see `spread_out`."""
    slot = slot_of(keys, key)
    if keys[slot] == EMPTY:
        return False
    other = heads[slot]
    while other != EMPTY:
        dx = points[index, 0] - points[other, 0]
        dy = points[index, 1] - points[other, 1]
        dz = points[index, 2] - points[other, 2]
        if dx * dx + dy * dy + dz * dz < spacing * spacing:
            return True
        other = following[other]
    return False
