"""Kernels of inflation: a ball grown around every set bit (a dilation), 64 cells at a time."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wayproof.maps._jit import kernel


@kernel
def grow_along_z(
    blocked: NDArray[np.uint64],  # (ny, words) one plane of constant x
    reach: int,
    grown: NDArray[np.uint64],  # (reach + 1, words, reach + ny + reach) out
) -> None:
    """Grow a plane along z by 0, 1, ..., reach cells; z-words first, y contiguous and padded."""
    ny, words = blocked.shape
    for w in range(words):
        for y in range(ny):
            grown[0, w, reach + y] = blocked[y, w]
    one, last = np.uint64(1), np.uint64(63)
    for h in range(1, reach + 1):
        for w in range(words):
            # One cell more up and down, with the bits that cross over from the words beside.
            before, after = grown[h - 1, w], grown[h, w]
            for k in range(before.shape[0]):
                after[k] = before[k] | (before[k] << one) | (before[k] >> one)
            if w > 0:
                carry = grown[h - 1, w - 1]
                for k in range(after.shape[0]):
                    after[k] |= carry[k] >> last
            if w + 1 < words:
                carry = grown[h - 1, w + 1]
                for k in range(after.shape[0]):
                    after[k] |= carry[k] << last


@kernel
def unite(
    target: NDArray[np.uint64],  # (ny,) in, out
    below: NDArray[np.uint64],  # (reach + ny + reach,) the plane dx before
    above: NDArray[np.uint64],  # and dx after
    middle: int,
    dy: int,
) -> None:
    """Add the rows at (dx, dy) in all four quadrants, where the ball has one height."""
    ny = target.shape[0]
    a, b = below[middle - dy : middle - dy + ny], below[middle + dy : middle + dy + ny]
    c, d = above[middle - dy : middle - dy + ny], above[middle + dy : middle + dy + ny]
    for k in range(ny):
        target[k] |= a[k] | b[k] | c[k] | d[k]


@kernel
def inflate_planes(
    blocked: NDArray[np.uint64],  # (nx, ny, words)
    half_heights: NDArray[np.int64],  # (reach + 1, reach + 1) of the ball over dx, dy; -1 outside
    first: int,
    end: int,
    inflated: NDArray[np.uint64],  # (nx, ny, words) out: planes first to end
) -> None:
    """Unite balls around the blocked cells, in the planes first <= x < end."""
    nx, ny, words = blocked.shape
    reach = half_heights.shape[0] - 1
    slots = 2 * reach + 1
    # The grown planes around the current one, in a ring; the last slot stays empty and stands for
    # planes outside the window.
    grown = np.zeros((slots + 1, reach + 1, words, reach + ny + reach), np.uint64)
    united = np.zeros((words, ny), np.uint64)
    for plane in range(max(0, first - reach), end + reach):
        if plane < nx:
            grow_along_z(blocked[plane], reach, grown[plane % slots])
        x = plane - reach
        if x < first:
            continue
        for w in range(words):
            target = united[w]
            for k in range(ny):
                target[k] = np.uint64(0)
            for dx in range(reach + 1):
                below = (x - dx) % slots if x >= dx else slots
                above = (x + dx) % slots if x + dx < nx else slots
                for dy in range(min(reach + 1, ny)):
                    h = half_heights[dx, dy]
                    if h >= 0:
                        unite(target, grown[below, h, w], grown[above, h, w], reach, dy)
            for y in range(ny):
                inflated[x, y, w] = target[y]
