"""Compiled kernels of a sweep: the cells that its beams cross, marked in a dense window.

The cells are defined in `_beam_kernels`. All kernels that call each other live in this file because
a cached kernel is not recompiled when another file changes.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wayproof.maps._jit import inlined, kernel
from wayproof.maps.kernels.beams import (
    HALVES,
    HALVES_BITS,
    MAX_BEAM_CELLS,
    ONE,
    OUTSIDE,
    SPARING,
    SUBCELLS,
)
from wayproof.maps.kernels.work_queue import Queue, take_item

WAY_BITS = 40  # a fraction of the way times a height of 2^21 stays below 2^63
WHOLE_WAY = 1 << WAY_BITS
HALF_PITCH = 2.0 ** (WAY_BITS + HALVES_BITS - 1)  # of faces, on a beam of 1/1024 of a cell
MAX_STEPS = 2 * MAX_BEAM_CELLS + 18
LANES = 8  # columns are looked at in whole vectors, also beyond the last one
MAX_RUNS = 33  # of ends in a word; one may be cut in two
EVERY_LAYER = -(1 << 30)  # below all that a beam may mark

SLOPES = 64  # classes of beams of a wedge
STEEPEST = 1.5  # cells along z to one along the wedge's longer axis
SCOUTS = 8  # beams
SHARE = 3
ROUNDING = 0.01  # of a cell: far more than a beam in integers is off its straight line

TWO = np.uint64(2)
FULL = np.uint64(0xFFFFFFFFFFFFFFFF)
B01, B55, B33, B0F = (np.uint64(0x0101010101010101 * byte) for byte in (0x01, 0x55, 0x33, 0x0F))


@inlined
def faces_before(way: int, half: int) -> int:
    """How many faces along an axis a beam meets before a point of its way."""
    return ((way - 1) // half + 1) >> 1 if way > 0 else 0


@inlined
def clip_axis(cell: int, steps: int, target: int, low: int, high: int) -> tuple[int, int]:
    """Faces to cross along an axis before a beam is within limits, and before it leaves them.

    Where it ends before it leaves, the latter is `steps`.
    """
    enter = low - cell if target > cell else cell - high
    leave = high - cell if target > cell else cell - low
    if target == cell and not low <= cell <= high:
        return 1, 0
    return max(enter, 0), min(leave, steps)


@inlined
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


@inlined
def clip(
    end: tuple[int, int, int],  # cell
    sensor: tuple[int, int, int],  # 1/1024 of a cell
    halves: tuple[int, int],  # way from the end to the first face along x and y
    box: tuple[int, int, int, int, int, int],  # least and greatest cell that may be marked
    most: tuple[int, int],  # faces along x and y that are crossed at most
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
    leave_x, leave_y = min(leave_x, most[0]), min(leave_y, most[1])
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


@inlined
def trace(
    first: int,  # faces crossed before the first column
    n: int,  # columns
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
    for k in range(n):
        s = first + k
        i = int(s * slope + offset)  # or one less than it should be
        way_x, way_y = i * pitch_x + half_x, (s - i) * pitch_y - half_y
        one_less = way_x <= way_y
        place = start + s * jumps[1] + i * turn
        places[k] = place + turn if one_less else place
        way = max(way_x, way_y - pitch_y) if one_less else max(way_x - pitch_x, way_y)
        ways[k] = min(max(way, 0), WHOLE_WAY)


@inlined
def find_heights(
    ways: NDArray[np.int64],  # (n,)
    n: int,
    middle: int,  # height of the end, 1/1024 of a cell
    rise: int,  # from there to the sensor
    heights: NDArray[np.int64],  # (n,) out
) -> None:
    """The cells along z in which a beam enters columns."""
    base = middle << WAY_BITS
    for s in range(n):
        heights[s] = (base + ways[s] * rise) >> (WAY_BITS + HALVES_BITS)


@inlined
def bits_from(height: int) -> np.uint64:
    """The bits of a word at a height from 0 to 64 and above it."""
    return FULL << np.uint64(height) if height < 64 else np.uint64(0)


@inlined
def mark_within(
    n: int,
    lower: NDArray[np.int64],  # (n + 1,) cells from the word's bottom, 0 to 63
    upper: NDArray[np.int64],  # (n + 1,)
    keep: np.uint64,  # cells that may be marked
    masks: NDArray[np.uint64],  # (n,) in, out
) -> None:
    """Mark in each column the cells between the heights at which beams enter and leave it."""
    for s in range(n):
        low, high = min(lower[s], lower[s + 1]), max(upper[s], upper[s + 1])
        masks[s] |= ((TWO << np.uint64(high)) - (ONE << np.uint64(low))) & keep


@inlined
def mark_across(
    n: int,
    lower: NDArray[np.int64],  # (n + 1,) cells from the word's bottom
    upper: NDArray[np.int64],  # (n + 1,)
    keep: np.uint64,
    masks: NDArray[np.uint64],  # (n,) in, out
) -> None:
    """The same for beams that are also below or above the word."""
    for s in range(n):
        low, high = min(lower[s], lower[s + 1]), max(upper[s], upper[s + 1])
        first, end = min(max(low, 0), 64), min(max(high + 1, 0), 64)
        masks[s] |= bits_from(first) & ~bits_from(end) & keep


@inlined
def mark_run(
    low: int,  # lowest and highest end, from the word's bottom
    high: int,
    top: int,  # height of the sensor, 1/1024 of a cell
    keep: np.uint64,
    n: int,  # columns
    ways: NDArray[np.int64],  # (n + 1,)
    lower: NDArray[np.int64],  # (n + 1,) scratch
    upper: NDArray[np.int64],  # (n + 1,) scratch
    masks: NDArray[np.uint64],  # (n,) in, out
) -> None:
    """Mark what the beams to a run of ends cross within one word of each column.

    Neither another name for an array nor an early return: either would have references counted, at
    some nanoseconds each time.
    """
    middle = low * HALVES + SUBCELLS
    find_heights(ways, n + 1, middle, top - middle, lower)
    # Most runs are of one end, on a floor or a ceiling, and most beams stay within the word, as it
    # is 64 cells high. They rise or fall all along.
    alone = low == high and min(lower[0], lower[n]) >= 0 and max(lower[0], lower[n]) <= 63
    if not alone:
        middle = high * HALVES + SUBCELLS
        find_heights(ways, n + 1, middle, top - middle, upper)
    if alone:
        mark_within(n, lower, lower, keep, masks)
    elif min(lower[0], lower[n]) >= 0 and max(upper[0], upper[n]) <= 63:
        mark_within(n, lower, upper, keep, masks)
    else:
        mark_across(n, lower, upper, keep, masks)


@inlined
def first_bit(word: np.uint64) -> int:
    """Index of the lowest set bit of a word that is not 0."""
    bits = (word & (~word + ONE)) - ONE  # as many ones as there are zeros below it
    bits = bits - ((bits >> ONE) & B55)
    bits = (bits & B33) + ((bits >> np.uint64(2)) & B33)
    bits = (bits + (bits >> np.uint64(4))) & B0F
    return int(np.int64((bits * B01) >> np.uint64(56)))


@inlined
def next_run(bits: np.uint64) -> tuple[int, int]:
    """First and last of the lowest run of set bits in a word that is not 0."""
    low = first_bit(bits)
    clear = ~(bits >> np.uint64(low))
    return low, (low + first_bit(clear) if clear != 0 else 64) - 1


@inlined
def list_runs(
    bits: np.uint64,  # cells of a word that beams end in
    bottom: int,  # its least cell
    guarded_layer: int,
    sparing: bool,  # whether beams to the guarded layer spare it
    runs: NDArray[np.int64],  # (n, 3) out: low, high, least to be marked
    count: int,  # of the runs so far
) -> int:
    """List the runs of ends without a gap; return the number of runs with these."""
    while bits != 0:
        first, last = next_run(bits)
        low, high = bottom + first, bottom + last
        spared = sparing and low <= guarded_layer <= high
        if spared and low < guarded_layer:  # those that end below it are not spared
            high, spared = guarded_layer - 1, False
        bits &= ~((FULL >> np.uint64(63 - high + low)) << np.uint64(low - bottom))
        runs[count, 0], runs[count, 1] = low, high
        runs[count, 2] = guarded_layer + 1 if spared else EVERY_LAYER
        count += 1
    return count


@kernel
def slope_range(
    targets: NDArray[np.int32],  # (n, 5)
    order: NDArray[np.int32],  # (k,)
    sensor: tuple[int, int, int],
) -> tuple[bool, bool, float, float]:
    """Where the targets of a wedge lie.

    Returns:
        Whether its longer axis is x, whether they lie along that axis; the least and the greatest
        slope of the shorter axis over the longer one.
    """
    x, y = int(targets[order[0], 0]), int(targets[order[0], 1])
    to_x, to_y = x * HALVES + SUBCELLS - sensor[0], y * HALVES + SUBCELLS - sensor[1]
    along_x = abs(to_x) > abs(to_y)
    forward = to_x > 0 if along_x else to_y > 0
    least, most = np.inf, -np.inf
    for i in range(order.shape[0]):
        x, y = int(targets[order[i], 0]), int(targets[order[i], 1])
        to_x, to_y = x * HALVES + SUBCELLS - sensor[0], y * HALVES + SUBCELLS - sensor[1]
        slope = to_y / abs(to_x) if along_x else to_x / abs(to_y)
        least, most = min(least, slope), max(most, slope)
    return bool(along_x), bool(forward), least, most


@inlined
def common_cells(
    free: NDArray[np.uint64],  # (nx * ny * words,)
    shape: tuple[int, int, int],
    along_x: bool,
    place: int,  # of a slab along the wedge's longer axis
    first: int,  # and its columns along the shorter one
    last: int,
    bottom: int,  # least of the 64 layers looked at
) -> np.uint64:
    """The layers that are marked in all of some columns; none if any lies outside the window."""
    nx, ny, words = shape
    length, width = (nx, ny) if along_x else (ny, nx)
    if not 0 <= place < length or first < 0 or last >= width:
        return np.uint64(0)
    word, shift = bottom >> 6, np.uint64(bottom & 63)
    common = FULL
    for k in range(first, last + 1):
        column = place * ny + k if along_x else k * ny + place
        marked = free[column * words + word] >> shift
        if word + 1 < words:
            marked |= (free[column * words + word + 1] << ONE) << (np.uint64(63) - shift)
        common &= marked
    return common


@inlined
def advance_slopes(
    common: np.uint64,  # layers that are marked throughout a slab
    enter: float,  # cells from the sensor to where beams enter the slab, and leave it
    leave: float,
    height: float,  # of the sensor above the lowest of these layers, cells
    marked: NDArray[np.int64],  # (SLOPES,) in, out: slabs marked
    slab: int,
) -> bool:
    """Add a slab to the slopes of which all beams cross only what is marked; whether to any."""
    missing, width, going_on = ~common, 2.0 * STEEPEST / SLOPES, 0
    for k in range(SLOPES):
        least = k * width - STEEPEST
        most = least + width
        low = height + min(least * enter, least * leave) - ROUNDING
        high = height + max(most * enter, most * leave) + ROUNDING
        within = (low >= 0.0) & (high < 64.0)
        bottom, top = np.uint64(np.int64(low) & 63), np.uint64(np.int64(high) & 63)
        crossed = (TWO << top) - (ONE << bottom)
        more = within & (marked[k] == slab) & (crossed & missing == 0)
        marked[k] += more
        going_on |= more
    return going_on != 0


@kernel
def survey(
    wedge: tuple[bool, bool, float, float],  # as of `slope_range`
    sensor: tuple[int, int, int],  # 1/1024 of a cell
    box: tuple[int, int, int, int, int, int],
    shape: tuple[int, int, int],
    free: NDArray[np.uint64],
    marked: NDArray[np.int64],  # (SLOPES,) out
) -> None:
    """Find how far from the sensor all that beams of a wedge cross is marked already.

    A slab is all columns at one place along the wedge's longer axis. For each class of slopes it
    is counted how many slabs, from the sensor's own on, are marked wherever such a beam may go.
    """
    along_x, forward, least, most = wedge
    near, across = (sensor[0], sensor[1]) if along_x else (sensor[1], sensor[0])
    own, middle = near >> HALVES_BITS, across / HALVES
    part = (near - own * HALVES) / HALVES  # of the sensor's own cell
    behind = part if forward else 1.0 - part
    bottom = max(min((sensor[2] >> HALVES_BITS) - 32, box[5] - 63), box[2], 0)
    height = sensor[2] / HALVES - bottom
    for k in range(SLOPES):
        marked[k] = 0
    slab, going_on = int(np.int64(0)), bottom < 64 * shape[2]
    while going_on:
        enter, leave = max(slab - behind, 0.0), slab + 1.0 - behind
        first = int(np.floor(middle + min(least * enter, least * leave) - ROUNDING))
        last = int(np.floor(middle + max(most * enter, most * leave) + ROUNDING))
        place = own + slab if forward else own - slab
        common = common_cells(free, shape, along_x, place, first, last, bottom)
        going_on = common != 0 and advance_slopes(common, enter, leave, height, marked, slab)
        slab += 1


@inlined
def marked_slabs(
    low: int,  # lowest and highest of a column's ends
    high: int,
    sensor: int,  # its height, 1/1024 of a cell
    distance: int,  # along the wedge's longer axis, 1/1024 of a cell
    marked: NDArray[np.int64],  # (SLOPES,)
) -> int:
    """How many slabs from the sensor on are marked for all beams to a column."""
    scale = SLOPES / (2.0 * STEEPEST)
    first = ((low * HALVES + SUBCELLS - sensor) / distance + STEEPEST) * scale
    last = ((high * HALVES + SUBCELLS - sensor) / distance + STEEPEST) * scale
    if not (0.0 <= first and last < SLOPES):
        return 0
    slabs = int(marked[int(first)])
    for k in range(int(first) + 1, int(last) + 1):
        slabs = min(slabs, int(marked[k]))
    return slabs


@kernel
def carve(
    targets: NDArray[np.int32],  # (n, 5)
    bits: NDArray[np.uint64],  # (n,)
    order: NDArray[np.int32],  # (n,)
    wedges: NDArray[np.int64],  # (k, 3) as of `order_targets`
    queue: Queue,  # of the wedges
    sensors: NDArray[np.int64],  # (m, 3) 1/1024 of a cell, from the window's corner
    box: tuple[int, int, int, int, int, int],  # least and greatest cell that may be marked
    guarded_layer: int,  # from the window's bottom
    shape: tuple[int, int, int],  # (nx, ny, words)
    scratch: tuple[NDArray[np.int64], ...],  # (MAX_STEPS + 1,) each
    masks: NDArray[np.uint64],  # (MAX_STEPS + 1,) scratch
    runs: NDArray[np.int64],  # (MAX_RUNS * words, 3) scratch
    free: NDArray[np.uint64],  # (nx * ny * words,) out
) -> None:
    """Mark the cells that beams cross.

    Beams to a run of ends cross what lies between the lowest and the highest of them: neighbours
    end one cell apart and come closer on their way. All to one column cross the same columns. Near
    the sensor all beams of a wedge cross the same cells: once the first of them are carved, the
    others are followed only to where everything is marked. Threads take wedges from the queue until
    none is left.
    """
    _, ny, words = shape
    ways, places, lower, upper, marked = scratch
    wedge = take_item(queue)
    while wedge < wedges.shape[0]:
        at, end, k = wedges[wedge]
        wedge = take_item(queue)
        sensor = (sensors[k, 0], sensors[k, 1], sensors[k, 2])
        span = slope_range(targets, order[at:end], sensor)
        first_target, surveyed, next_survey = at, False, at + max((end - at) // SHARE, SCOUTS)
        while at < end:
            if at >= next_survey:
                survey(span, sensor, box, shape, free, marked)
                surveyed, next_survey = True, at + (at - first_target)
            target = order[at]
            x, y = int(targets[target, 0]), int(targets[target, 1])
            count, alone = int(np.int64(0)), targets[target, 4] & OUTSIDE != 0
            while True:  # all words of one column
                bottom, flags = int(targets[target, 3]), targets[target, 4]
                sparing = flags & SPARING != 0
                count = list_runs(bits[target], bottom, guarded_layer, sparing, runs, count)
                at += 1
                if at == end or alone:
                    break
                target = order[at]
                if targets[target, 0] != x or targets[target, 1] != y:
                    break
                if targets[target, 4] & OUTSIDE != 0:
                    break
            to_x, to_y = sensor[0] - x * HALVES - SUBCELLS, sensor[1] - y * HALVES - SUBCELLS  # odd
            most_x, most_y = MAX_BEAM_CELLS + 1, MAX_BEAM_CELLS + 1
            if surveyed:
                distance = abs(to_x) if span[0] else abs(to_y)
                slabs = marked_slabs(runs[0, 0], runs[count - 1, 1], sensor[2], distance, marked)
                if slabs > 0 and span[0]:
                    most_x = abs((sensor[0] >> HALVES_BITS) - x) - slabs
                elif slabs > 0:
                    most_y = abs((sensor[1] >> HALVES_BITS) - y) - slabs
            halves = (int(HALF_PITCH / abs(to_x)), int(HALF_PITCH / abs(to_y)))
            end_cell, most = (x, y, runs[0, 0]), (most_x, most_y)
            first, last, to_layers = clip(end_cell, sensor, halves, box, most)
            n = last + 1 - first
            if n <= 0:
                continue
            jumps = (ny * words if to_x > 0 else -ny * words, words if to_y > 0 else -words)
            padded = -(-n // LANES) * LANES
            start = (x * ny + y) * words
            trace(first, padded + 1, halves, start, jumps, places, ways)
            ways[0] = max(ways[0], to_layers)
            rises = sensor[2] >> HALVES_BITS
            lowest, highest = min(runs[0, 0], rises), max(runs[count - 1, 1], rises)
            for word in range(max(box[2], lowest) >> 6, (min(box[5], highest) >> 6) + 1):
                bottom = 64 * word
                for s in range(padded):
                    masks[s] = 0
                for i in range(count):
                    low, high = runs[i, 0] - bottom, runs[i, 1] - bottom
                    least = min(max(max(runs[i, 2], box[2]) - bottom, 0), 64)
                    keep = bits_from(least) & (bits_from(min(box[5] + 1 - bottom, 64)) ^ FULL)
                    top = sensor[2] - bottom * HALVES
                    above = rises - bottom
                    if keep != 0 and max(high, above) >= 0 and min(low, above) <= 63:
                        mark_run(low, high, top, keep, padded, ways, lower, upper, masks)
                for s in range(n):
                    free[np.uint64(places[s] + word)] |= masks[s]
