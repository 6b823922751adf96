"""Kernels over a range image: the beams of a grid, one row for each elevation."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wayproof.kernel_compiler import kernel

NO_RETURN_MM = 65535
DROPPED_MM = 0

BESIDE = 2
"""Beams to each side of a return that it is compared with."""


@kernel
def count_silent(
    image: NDArray[np.uint16] | NDArray[np.uint32],  # (r, c) ranges, mm
    closed: bool,  # whether the last column lies beside the first
) -> tuple[int, int]:
    """Count the beams with a return right beside on both sides, and those of them without one."""
    columns = image.shape[1]
    beside = silent = int(np.int64(0))
    for i in range(image.shape[0]):
        for j in range(0 if closed else 1, columns if closed else columns - 1):
            if _returned(image[i, j - 1]) and _returned(image[i, (j + 1) % columns]):
                beside += image[i, j] != DROPPED_MM
                silent += image[i, j] == NO_RETURN_MM
    return beside, silent


@kernel
def find_lost(
    image: NDArray[np.uint16] | NDArray[np.uint32],  # (r, c) ranges, mm
    reach: int,  # columns
    closed: bool,  # whether the last column lies beside the first
    lost: NDArray[np.bool_],  # (r, c) out
) -> int:
    """Find the beams without return that have returns to both sides; return their number."""
    found = int(np.int64(0))
    for i in range(image.shape[0]):
        for j in range(image.shape[1]):
            lost[i, j] = False
            if image[i, j] != NO_RETURN_MM:
                continue
            if _returned_beside(image[i], j, -1, reach, closed):
                lost[i, j] = _returned_beside(image[i], j, 1, reach, closed)
                found += lost[i, j]
    return found


@kernel
def _returned(range_mm: np.integer) -> bool:
    return bool(range_mm != NO_RETURN_MM and range_mm != DROPPED_MM)


@kernel
def _returned_beside(
    row: NDArray[np.uint16] | NDArray[np.uint32],  # (c,) mm
    column: int,
    step: int,  # 1 or -1
    reach: int,
    closed: bool,
) -> bool:
    """Return whether a beam to one side has a return, or the image ends there."""
    columns = row.shape[0]
    for k in range(1, reach + 1):
        beside = column + step * k
        if beside < 0 or beside >= columns:
            if not closed:
                return True
            beside %= columns
        if _returned(row[beside]):
            return True
    return False


@kernel
def find_protruding(
    image: NDArray[np.uint16] | NDArray[np.uint32],  # (r, c) ranges, mm
    farthest: int,  # mm
    depth: int,  # mm
    sky: bool,  # whether a beam without return is known to see far
    closed: bool,  # whether the last column lies beside the first
    protruding: NDArray[np.bool_],  # (r, c) out
) -> tuple[int, int]:
    """Find the returns up to a range that lie by a depth before all beside them, in their row.

    Returns:
        Number of returns of the image, and of these.
    """
    returns = found = int(np.int64(0))
    for i in range(image.shape[0]):
        for j in range(image.shape[1]):
            protruding[i, j] = False
            if not _returned(image[i, j]):
                continue
            returns += 1
            if image[i, j] <= farthest:
                beyond = int(image[i, j]) + depth
                protruding[i, j] = _sees_beyond(image[i], j, -1, beyond, sky, closed) and (
                    _sees_beyond(image[i], j, 1, beyond, sky, closed)
                )
                found += protruding[i, j]
    return returns, found


@kernel
def _sees_beyond(
    row: NDArray[np.uint16] | NDArray[np.uint32],  # (c,) mm
    column: int,
    step: int,  # 1 or -1
    beyond: int,  # mm
    sky: bool,
    closed: bool,
) -> bool:
    """Return whether the beams to one side, `BESIDE` of them, see far, or the image ends there."""
    columns = row.shape[0]
    seen = False
    for k in range(1, BESIDE + 1):
        beside = column + step * k
        if beside < 0 or beside >= columns:
            if not closed:
                return k == 1 or seen
            beside %= columns
        if _returned(row[beside]):
            if np.int64(row[beside]) <= beyond:
                return False
            seen = True
        elif sky and row[beside] == NO_RETURN_MM:
            seen = True
    return seen


@kernel
def find_isolated(
    image: NDArray[np.uint16] | NDArray[np.uint32],  # (r, c) ranges, mm
    protruding: NDArray[np.bool_],  # (r, c)
    near: int,  # mm
    closed: bool,  # whether the last column lies beside the first
    isolated: NDArray[np.bool_],  # (r, c) out
) -> int:
    """Find the protruding returns without one above or below at about their range; count them."""
    rows, columns = image.shape
    found = int(np.int64(0))
    for i in range(rows):
        for j in range(columns):
            isolated[i, j] = protruding[i, j]
            if not protruding[i, j]:
                continue
            for row in range(max(i - 1, 0), min(i + 2, rows)):
                for step in range(-1, 2):
                    beside = j + step
                    if row == i or (not closed and not 0 <= beside < columns):
                        continue
                    beside %= columns
                    apart = np.int64(image[row, beside]) - np.int64(image[i, j])
                    if protruding[row, beside] and abs(apart) <= near:
                        isolated[i, j] = False
            found += isolated[i, j]
    return found


@kernel
def count_bends(
    image: NDArray[np.uint16] | NDArray[np.uint32],  # (r, c) ranges, mm
    counts: NDArray[np.int64],  # (n,) out: number by second difference, mm; the last and beyond
) -> int:
    """Count the second differences of three neighbouring returns of a row; return their number."""
    most = counts.shape[0] - 1
    total = int(np.int64(0))
    counts[:] = 0
    for i in range(image.shape[0]):
        for j in range(1, image.shape[1] - 1):
            before, here = np.int64(image[i, j - 1]), np.int64(image[i, j])
            after = np.int64(image[i, j + 1])
            if not (_returned(before) and _returned(here) and _returned(after)):
                continue
            counts[min(abs(before - 2 * here + after), most)] += 1
            total += 1
    return total
