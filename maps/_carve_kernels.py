"""Compiled kernels of a sweep: the cells that its beams cross, marked in a dense window.

The cells are defined in `_beam_kernels`. All kernels that call each other live in this file because
a cached kernel is not recompiled when another file changes.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from maps._beam_kernels import FULL, HALVES, HALVES_BITS, MAX_BEAM_CELLS, ONE, SUBCELLS
from maps._jit import kernel

WAY_BITS = 40  # a fraction of the way times a height of 2^21 stays below 2^63
WHOLE_WAY = 1 << WAY_BITS
HALF_PITCH = 2.0 ** (WAY_BITS + HALVES_BITS - 1)  # of faces, on a beam of 1/1024 of a cell
MAX_STEPS = 2 * MAX_BEAM_CELLS + 18
LANES = 16  # columns are looked at in whole vectors, also beyond the last one
TWO = np.uint64(2)


@kernel
def faces_before(way: int, half: int) -> int:
    """How many faces along an axis a beam meets before a point of its way."""
    return ((way - 1) // half + 1) >> 1 if way > 0 else 0


@kernel
def clip_axis(cell: int, steps: int, target: int, low: int, high: int) -> tuple[int, int]:
    """Faces to cross along an axis before a beam is within limits, and before it leaves them.

    Where it ends before it leaves, the latter is `steps`.
    """
    enter = low - cell if target > cell else cell - high
    leave = high - cell if target > cell else cell - low
    if target == cell and not low <= cell <= high:
        return 1, 0
    return max(enter, 0), min(leave, steps)


@kernel
def way_to_layers(end: int, sensor: int, low: int, high: int) -> int:
    """Least way at which a beam is within layers `low` to `high`; beyond its end if it never is.

    Args:
        end: Layer that it ends in.
        sensor: Height of the sensor, 1/1024 of a cell.
        low: Least layer.
        high: Greatest layer.
    """
    if low <= end <= high:
        return 0
    middle = end * HALVES + SUBCELLS
    if end > high:
        if sensor >= (high + 1) * HALVES:
            return WHOLE_WAY + 1
        return ((middle - (high + 1) * HALVES) << WAY_BITS) // (middle - sensor) + 1
    if sensor < low * HALVES:
        return WHOLE_WAY + 1
    return -(((middle - low * HALVES) << WAY_BITS) // (sensor - middle))


@kernel
def clip(
    end: tuple[int, int, int],  # cell
    sensor: tuple[int, int, int],  # 1/1024 of a cell
    halves: tuple[int, int],  # way from the end to the first face along x and y
    box: tuple[int, int, int, int, int, int],  # least and greatest cell that may be marked
) -> tuple[int, int, int]:
    """The columns of a beam that lie in a box, by the number of faces crossed before them.

    Returns:
        The first and the last; 0 and -1 if there are none. Then the way to the box's layers.
    """
    x, y, z = end
    half_x, half_y = halves
    steps_x, steps_y = abs((sensor[0] >> HALVES_BITS) - x), abs((sensor[1] >> HALVES_BITS) - y)
    enter_x, leave_x = clip_axis(x, steps_x, sensor[0] >> HALVES_BITS, box[0], box[3])
    enter_y, leave_y = clip_axis(y, steps_y, sensor[1] >> HALVES_BITS, box[1], box[4])
    to_layers = way_to_layers(z, sensor[2], box[2], box[5])
    if enter_x > leave_x or enter_y > leave_y or to_layers > WHOLE_WAY:
        return 0, -1, 0

    i, j = enter_x, enter_y
    way_x, way_y = (2 * i - 1) * half_x, (2 * j - 1) * half_y
    if way_x > way_y and i > 0:
        j = faces_before(way_x, half_y)
    elif j > 0:
        i = faces_before(way_y + 1, half_x)  # where both are equal, x goes first
    i, j = max(i, faces_before(to_layers, half_x)), max(j, faces_before(to_layers, half_y))

    last_i, last_j = leave_x, leave_y
    way_x, way_y = (2 * leave_x + 1) * half_x, (2 * leave_y + 1) * half_y
    if leave_x < steps_x and (way_x <= way_y or leave_y == steps_y):
        last_j = faces_before(way_x, half_y)
    elif leave_y < steps_y:
        last_i = faces_before(way_y + 1, half_x)
    if i > last_i or j > last_j:
        return 0, -1, 0
    return i + j, last_i + last_j, to_layers


@kernel
def trace(
    first: int,  # faces crossed before the first column
    halves: tuple[int, int],  # way from the end to the first face along x and y
    start: int,  # word of the end's column
    jumps: tuple[int, int],  # words from column to column along x and y
    places: NDArray[np.int64],  # (n,) out: word of each column
    ways: NDArray[np.int64],  # (n,) out: where the beam enters it; beyond its way, the whole way
) -> None:
    """Find the columns that a beam crosses, from its end on.

    After s faces it has crossed the i along x with (2 i - 1) half_x <= (2 j + 1) half_y and
    (2 j - 1) half_y < (2 i + 1) half_x, where j = s - i. Solved for i that is
    floor(s half_y / (half_x + half_y) + 1/2): no column waits for the one before. Worked out in
    floating point, a little low, that is i or one less; which of them, integers decide.
    """
    half_x, half_y = halves
    pitch_x, pitch_y, turn = 2 * half_x, 2 * half_y, jumps[0] - jumps[1]
    slope, offset = pitch_y / (pitch_x + pitch_y), 0.5 - 1e-6
    for k in range(places.shape[0]):
        s = first + k
        i = int(s * slope + offset)  # or one less than it should be
        way_x, way_y = i * pitch_x + half_x, (s - i) * pitch_y - half_y
        one_less = way_x <= way_y
        place = start + s * jumps[1] + i * turn
        places[k] = place + turn if one_less else place
        way = max(way_x, way_y - pitch_y) if one_less else max(way_x - pitch_x, way_y)
        ways[k] = min(max(way, 0), WHOLE_WAY)


@kernel
def find_heights(
    ways: NDArray[np.int64],  # (n,)
    middle: int,  # height of the end, 1/1024 of a cell
    rise: int,  # from there to the sensor
    heights: NDArray[np.int64],  # (n,) out
) -> None:
    """The cells along z in which a beam enters columns."""
    base = middle << WAY_BITS
    for s in range(ways.shape[0]):
        heights[s] = (base + ways[s] * rise) >> (WAY_BITS + HALVES_BITS)


@kernel
def bits_from(height: int) -> np.uint64:
    """The bits of a word at a height from 0 to 64 and above it."""
    return FULL << np.uint64(height) if height < 64 else np.uint64(0)


@kernel
def mark_within(
    lower: NDArray[np.int64],  # (n + 1,) cells from the word's bottom, 0 to 63
    upper: NDArray[np.int64],  # (n + 1,)
    keep: np.uint64,  # cells that may be marked
    masks: NDArray[np.uint64],  # (n,) in, out
) -> None:
    """Mark in each column the cells between the heights at which beams enter and leave it."""
    for s in range(masks.shape[0]):
        low, high = min(lower[s], lower[s + 1]), max(upper[s], upper[s + 1])
        masks[s] |= ((TWO << np.uint64(high)) - (ONE << np.uint64(low))) & keep


@kernel
def mark_across(
    lower: NDArray[np.int64],  # (n + 1,) cells from the word's bottom
    upper: NDArray[np.int64],  # (n + 1,)
    keep: np.uint64,
    masks: NDArray[np.uint64],  # (n,) in, out
) -> None:
    """The same for beams that are also below or above the word."""
    for s in range(masks.shape[0]):
        low, high = min(lower[s], lower[s + 1]), max(upper[s], upper[s + 1])
        first, end = min(max(low, 0), 64), min(max(high + 1, 0), 64)
        masks[s] |= bits_from(first) & ~bits_from(end) & keep


@kernel
def mark_run(
    low: int,  # lowest and highest end, from the word's bottom
    high: int,
    top: int,  # height of the sensor, 1/1024 of a cell
    keep: np.uint64,
    ways: NDArray[np.int64],  # (n + 1,)
    lower: NDArray[np.int64],  # (n + 1,) scratch
    upper: NDArray[np.int64],  # (n + 1,) scratch
    masks: NDArray[np.uint64],  # (n,) in, out
) -> None:
    """Mark what the beams to a run of ends cross within one word of each column."""
    if max(high, top >> HALVES_BITS) < 0 or min(low, top >> HALVES_BITS) > 63 or keep == 0:
        return
    n = masks.shape[0]
    middle = low * HALVES + SUBCELLS
    find_heights(ways, middle, top - middle, lower)
    highest = lower
    if high > low:
        middle = high * HALVES + SUBCELLS
        find_heights(ways, middle, top - middle, upper)
        highest = upper
    # Beams rise or fall all along. Most stay within the word, as it is 64 cells high.
    if min(lower[0], lower[n]) >= 0 and max(highest[0], highest[n]) <= 63:
        mark_within(lower, highest, keep, masks)
    else:
        mark_across(lower, highest, keep, masks)


@kernel
def share_columns(
    runs: NDArray[np.int32],  # (n, 6)
    one: int,
    other: int,
    box: tuple[int, int, int, int, int, int],
) -> bool:
    """Whether all beams to two runs cross the same columns within the box."""
    for k in range(3):
        if runs[one, k] != runs[other, k]:
            return False
    low, high = box[2], box[5]
    return low <= int(runs[one, 3]) <= high and low <= int(runs[other, 3]) <= high


@kernel
def carve(
    runs: NDArray[np.int32],  # (n, 6)
    order: NDArray[np.int32],  # (n,)
    part: tuple[int, int],  # first and one past the last of these to carve
    sensors: NDArray[np.int64],  # (m, 3) 1/1024 of a cell, from the window's corner
    box: tuple[int, int, int, int, int, int],  # least and greatest cell that may be marked
    shape: tuple[int, int, int],  # (nx, ny, words)
    free: NDArray[np.uint64],  # (nx * ny * words,) out
) -> None:
    """Mark the cells that beams cross.

    Beams to a run of ends cross what lies between the lowest and the highest of them: neighbours
    end one cell apart and come closer on their way. All to one column cross the same columns.
    """
    _, ny, words = shape
    ways, places = np.empty(MAX_STEPS + 1, np.int64), np.empty(MAX_STEPS + 1, np.int64)
    lower, upper = np.empty(MAX_STEPS + 1, np.int64), np.empty(MAX_STEPS + 1, np.int64)
    masks = np.empty(MAX_STEPS, np.uint64)
    at = part[0]
    while at < part[1]:
        first_run = at
        run = order[at]
        x, y, k, low = int(runs[run, 0]), int(runs[run, 1]), runs[run, 2], int(runs[run, 3])
        at += 1
        while at < part[1] and share_columns(runs, run, order[at], box):
            at += 1
        sensor = (int(sensors[k, 0]), int(sensors[k, 1]), int(sensors[k, 2]))
        to_x, to_y = sensor[0] - x * HALVES - SUBCELLS, sensor[1] - y * HALVES - SUBCELLS  # odd
        halves = (int(HALF_PITCH / abs(to_x)), int(HALF_PITCH / abs(to_y)))
        first, last, to_layers = clip((x, y, low), sensor, halves, box)
        n = last + 1 - first
        if n <= 0:
            continue
        jumps = (ny * words if to_x > 0 else -ny * words, words if to_y > 0 else -words)
        padded = -(-n // LANES) * LANES
        end = padded + 1
        trace(first, halves, (x * ny + y) * words, jumps, places[:end], ways[:end])
        ways[0] = max(ways[0], to_layers)
        for word in range(box[2] >> 6, (box[5] >> 6) + 1):
            bottom = 64 * word
            for s in range(padded):
                masks[s] = 0
            for i in range(first_run, at):
                run = order[i]
                low, high = int(runs[run, 3]) - bottom, int(runs[run, 4]) - bottom
                least = min(max(max(int(runs[run, 5]), box[2]) - bottom, 0), 64)
                keep = bits_from(least) & (bits_from(min(box[5] + 1 - bottom, 64)) ^ FULL)
                top, across = sensor[2] - bottom * HALVES, masks[:padded]
                mark_run(low, high, top, keep, ways[:end], lower[:end], upper[:end], across)
            for s in range(n):
                free[np.uint64(places[s] + word)] |= masks[s]
