"""Kernels of the 2D grid: the cells that the beams of a sweep cross and hit in a band of heights.

Positions are whole 1/1024 of a cell, and so is every comparison that decides.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wayproof.kernel_compiler import kernel

HALVES_BITS = 10
HALVES = 1 << HALVES_BITS  # to a cell

CROSSED = np.uint8(1)
HIT = np.uint8(2)


@kernel
def clip_to_band(
    start: int,  # heights, odd
    end: int,
    band: tuple[int, int],  # even
) -> tuple[int, int]:
    """Find where along its climb, from 0 to |end - start|, a beam enters the band and leaves it.

    The second is not more than the first if it never is in the band. A level beam has a climb of 0;
    if it is in the band, that is (0, 1).
    """
    if start == end:
        return 0, 1 if band[0] < start < band[1] else 0
    if start < end:
        first, last = band[0] - start, band[1] - start
    else:
        first, last = start - band[1], start - band[0]
    return max(first, 0), min(last, abs(end - start))


@kernel
def trace_flat(
    start: tuple[int, int],  # from the window's corner, odd
    end: tuple[int, int],  # odd
    inside: NDArray[np.int64],  # (2, 2) least cell to be marked and one past the greatest
    marks: NDArray[np.uint8],  # (nx, ny) in, out
) -> None:
    """Mark the cells between two points (Amanatides & Woo 1987, in integers)."""
    # Along each axis: the extent, the direction, and how far it is to the next face.
    run_x, run_y = abs(end[0] - start[0]), abs(end[1] - start[1])
    step_x, step_y = 1 if end[0] > start[0] else -1, 1 if end[1] > start[1] else -1
    x, y = start[0] >> HALVES_BITS, start[1] >> HALVES_BITS
    to_x = (x + 1) * HALVES - start[0] if step_x > 0 else start[0] - x * HALVES
    to_y = (y + 1) * HALVES - start[1] if step_y > 0 else start[1] - y * HALVES
    steps = abs((end[0] >> HALVES_BITS) - x) + abs((end[1] >> HALVES_BITS) - y)
    for _ in range(steps + 1):
        if inside[0, 0] <= x < inside[1, 0] and inside[0, 1] <= y < inside[1, 1]:
            marks[x, y] |= CROSSED
        # Where two faces are met at once, x goes first.
        if to_x * run_y <= to_y * run_x and run_x > 0:
            x += step_x
            to_x += HALVES
        else:
            y += step_y
            to_y += HALVES


@kernel
def trace_all(
    starts: NDArray[np.int64],  # (k, 3) 1/1024 of a cell from the window's corner, odd
    ends: NDArray[np.int64],  # (k, 3)
    returned: NDArray[np.bool_],  # (k,)
    band: tuple[int, int],  # heights, even
    inside: NDArray[np.int64],  # (2, 2)
    marks: NDArray[np.uint8],  # (nx, ny) out
) -> None:
    """Mark the cells that beams cross within the band, and those that they hit there."""
    for i in range(starts.shape[0]):
        z, end_z = starts[i, 2], ends[i, 2]
        first, last = clip_to_band(z, end_z, band)
        if first >= last:
            continue
        climb = abs(end_z - z) if end_z != z else 1
        # The part of the beam within the band.
        run_x, run_y = ends[i, 0] - starts[i, 0], ends[i, 1] - starts[i, 1]
        enter = (
            (starts[i, 0] + run_x * first // climb) | 1,  # odd: never on a face
            (starts[i, 1] + run_y * first // climb) | 1,
        )
        leave = (
            (starts[i, 0] + run_x * last // climb) | 1,
            (starts[i, 1] + run_y * last // climb) | 1,
        )
        trace_flat(enter, leave, inside, marks)
        x, y = ends[i, 0] >> HALVES_BITS, ends[i, 1] >> HALVES_BITS
        is_inside = inside[0, 0] <= x < inside[1, 0] and inside[0, 1] <= y < inside[1, 1]
        if returned[i] and is_inside and band[0] < end_z < band[1]:
            marks[x, y] |= HIT
