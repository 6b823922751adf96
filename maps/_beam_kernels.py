"""Compiled kernels of a sweep: where its beams end, and which cells they cross.

Cells are marked in a dense window around the sweep: a word of 64 bits is 64 cells of a column along
z. All kernels that call each other live in this file because a cached kernel is not recompiled when
another file changes.

The beams are defined in integers, cell by cell:

1. A beam runs from the middle of the sensor's sub-cell to the middle of the cell that it ends in;
   those that end in the same cell are one (the "discretize" of OctoMap's insertPointCloud).
2. Seen from its end it meets the k-th face along x (k = 0, 1, ...) at the fraction
   (2 k + 1) (2^49 // |dx|) / 2^40 of its way, with dx in 1/1024 of a cell; likewise along y. Where
   both are equal, x goes first.
3. Its height at a face is rounded down to a whole cell. In a column it crosses the cells between
   its height where it enters and its height where it leaves.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from maps._jit import kernel

# What became of a beam.
RETURNED = 0
CLEARED = 1
DROPPED = 2
TOO_NEAR = 3

NO_RETURN_MM = 65535
DROPPED_MM = 0

SUBCELL_BITS = 9
SUBCELLS = 1 << SUBCELL_BITS  # positions per cell and axis: 0.2 mm at 10 cm
HALVES_BITS = SUBCELL_BITS + 1  # in 1/1024 of a cell the middles of cells and sub-cells are whole
HALVES = 1 << HALVES_BITS
FLOOR_SUBCELLS = 3 * SUBCELLS // 4  # the plane z = 0 lies this high in its layer

MAX_BEAM_CELLS = 2047
WAY_BITS = 40  # a fraction of the way times a height of 2^21 stays below 2^63
WHOLE_WAY = 1 << WAY_BITS
HALF_PITCH = 2.0 ** (WAY_BITS + HALVES_BITS - 1)  # of faces, on a beam of 1/1024 of a cell
UNIT_TOLERANCE = 1e-6

# Flags of a column.
LISTED = np.uint8(1)
GRAZED = np.uint8(2)  # a beam ends in its guarded layer

EVERY_LAYER = -(1 << 30)  # below all that a beam may mark
SECTORS = 4096
MAX_STEPS = 2 * MAX_BEAM_CELLS + 18
LANES = 16  # columns are looked at in whole vectors, also beyond the last one

ONE, TWO = np.uint64(1), np.uint64(2)
FULL = np.uint64(0xFFFFFFFFFFFFFFFF)
B01, B55, B33, B0F = (np.uint64(0x0101010101010101 * byte) for byte in (0x01, 0x55, 0x33, 0x0F))


@kernel
def place_ends(
    origins: NDArray[np.float64],  # (m, 3) m
    moments: NDArray[np.int32],  # (n,) origin of each beam; (0,): all from the first
    directions: NDArray[np.float64],  # (n, 3) unit
    ranges_mm: NDArray[np.uint16],  # (n,)
    limits_mm: tuple[int, int],  # nearest and farthest return
    resolution: float,
    beams: tuple[int, int],  # first and one past the last to look at
    ends: NDArray[np.int32],  # (n, 3) out: cell that each beam ends in
    fates: NDArray[np.uint8],  # (n,) out
    box: NDArray[np.int64],  # (2, 3) least and greatest cell, widened to hold the ends
) -> int:
    """Find the cell that every beam ends in; return the first beam not of unit length, or -1."""
    scale = SUBCELLS / resolution
    rolling = moments.shape[0] > 0
    low_x, low_y, low_z = box[0, 0], box[0, 1], box[0, 2]
    high_x, high_y, high_z = box[1, 0], box[1, 1], box[1, 2]
    for i in range(beams[0], beams[1]):
        dx, dy, dz = directions[i, 0], directions[i, 1], directions[i, 2]
        if not abs(dx * dx + dy * dy + dz * dz - 1.0) < UNIT_TOLERANCE:  # also NaN
            return i
        millimetres = int(ranges_mm[i])
        if millimetres == DROPPED_MM:
            fates[i] = DROPPED
            continue
        if millimetres < limits_mm[0]:
            fates[i] = TOO_NEAR
            continue
        fates[i] = RETURNED
        if millimetres == NO_RETURN_MM or millimetres > limits_mm[1]:
            fates[i] = CLEARED
            millimetres = limits_mm[1]
        length = millimetres / 1000.0
        k = int(moments[i]) if rolling else 0
        x = int(np.floor((origins[k, 0] + dx * length) * scale)) >> SUBCELL_BITS
        y = int(np.floor((origins[k, 1] + dy * length) * scale)) >> SUBCELL_BITS
        z = (int(np.floor((origins[k, 2] + dz * length) * scale)) + FLOOR_SUBCELLS) >> SUBCELL_BITS
        ends[i, 0], ends[i, 1], ends[i, 2] = x, y, z
        low_x, high_x = min(low_x, x), max(high_x, x)
        low_y, high_y = min(low_y, y), max(high_y, y)
        low_z, high_z = min(low_z, z), max(high_z, z)
    box[0, 0], box[0, 1], box[0, 2] = low_x, low_y, low_z
    box[1, 0], box[1, 1], box[1, 2] = high_x, high_y, high_z
    return -1


@kernel
def first_bit(word: np.uint64) -> int:
    """Index of the lowest set bit of a word that is not 0."""
    bits = (word & (~word + ONE)) - ONE  # as many ones as there are zeros below it
    bits = bits - ((bits >> ONE) & B55)
    bits = (bits & B33) + ((bits >> np.uint64(2)) & B33)
    bits = (bits + (bits >> np.uint64(4))) & B0F
    return int(np.int64((bits * B01) >> np.uint64(56)))


@kernel
def next_run(bits: np.uint64) -> tuple[int, int]:
    """First and last of the lowest run of set bits in a word that is not 0."""
    low = first_bit(bits)
    clear = ~(bits >> np.uint64(low))
    return low, (low + first_bit(clear) if clear != 0 else 64) - 1


@kernel
def list_column(
    x: int,
    y: int,
    group: int,
    guarded_layer: int,  # -1: none
    base: int,  # first word of the column
    words: int,
    grazed: bool,
    aims: NDArray[np.uint64],  # zero after, in this column
    runs: NDArray[np.int32],  # (n, 6) out
    count: int,  # of the runs so far
) -> int:
    """List the runs of ends in a column; return the number of runs with these."""
    for word in range(words):
        bits = aims[base + word]
        aims[base + word] = 0
        spare = False
        if grazed and guarded_layer >> 6 == word:
            guarded = ONE << np.uint64(guarded_layer & 63)
            spare = bits & guarded == 0  # else a beam that is not spared ends there as well
            bits |= guarded
        while bits != 0:
            low, high = next_run(bits)
            low, high = 64 * word + low, 64 * word + high
            spared = spare and low <= guarded_layer <= high
            if spared and low < guarded_layer:  # those that end below it are not spared
                high, spared = guarded_layer - 1, False
            bits &= ~((FULL >> np.uint64(63 - high + low)) << np.uint64(low & 63))
            least = guarded_layer + 1 if spared else EVERY_LAYER
            write_run(runs, count, x, y, group, low, high, least)
            count += 1
    return count


@kernel
def write_run(
    runs: NDArray[np.int32],
    at: int,
    x: int,
    y: int,
    group: int,
    low: int,
    high: int,
    least: int,
) -> None:
    """Write one run of ends."""
    runs[at, 0], runs[at, 1], runs[at, 2] = x, y, group
    runs[at, 3], runs[at, 4], runs[at, 5] = low, high, least


@kernel
def list_runs(
    ends: NDArray[np.int32],  # (n, 3)
    fates: NDArray[np.uint8],  # (n,)
    groups: NDArray[np.int64],  # (m + 1,) first beam of each sensor position, and the end
    sensors: NDArray[np.int64],  # (m, 3) 1/1024 of a cell, from the window's corner
    corner: tuple[int, int, int],  # cell at the window's corner
    box: tuple[int, int, int, int, int, int],  # least and greatest cell that may be marked
    guarded_layer: int,  # from the window's bottom; -1: none
    shape: tuple[int, int, int],  # (nx, ny, words)
    hits: NDArray[np.uint64],  # (nx * ny * words,) out
    aims: NDArray[np.uint64],  # (nx * ny * words,) zero before and after
    flags: NDArray[np.uint8],  # (nx * ny,) zero before and after
    columns: NDArray[np.int32],  # (n,) scratch
    runs: NDArray[np.int32],  # (n, 6) out: x, y, sensor position, low, high, least to be marked
) -> int:
    """Mark the cells that are hit and list the runs of ends along z; return their number.

    Ends in a column are one run where they follow each other without a gap. Those outside the box
    are listed singly: there are no masks for them.
    """
    _, ny, words = shape
    x0, y0, z0, x1, y1, z1 = box
    count = 0
    for k in range(sensors.shape[0]):
        guarded = guarded_layer if sensors[k, 2] >> HALVES_BITS > guarded_layer else -1
        listed = 0
        for i in range(groups[k], groups[k + 1]):
            if fates[i] > CLEARED:
                continue
            x, y, z = int(ends[i, 0]), int(ends[i, 1]), int(ends[i, 2])
            x, y, z = x - corner[0], y - corner[1], z - corner[2]
            returned = fates[i] == RETURNED
            grazing = returned and z == guarded
            if not (x0 <= x <= x1 and y0 <= y <= y1 and z0 <= z <= z1):
                write_run(runs, count, x, y, k, z, z, z + 1 if grazing else EVERY_LAYER)
                count += 1
                continue
            column = x * ny + y
            word, bit = column * words + (z >> 6), ONE << np.uint64(z & 63)
            if returned:
                hits[word] |= bit
            if not grazing:
                aims[word] |= bit
            if flags[column] == 0:
                columns[listed] = column
                listed += 1
            flags[column] |= LISTED | GRAZED if grazing else LISTED
        for j in range(listed):
            column = int(columns[j])
            grazed = flags[column] & GRAZED != 0
            flags[column] = 0
            x, y, base = column // ny, column % ny, column * words
            count = list_column(x, y, k, guarded, base, words, grazed, aims, runs, count)
    return count


@kernel
def order_runs(
    runs: NDArray[np.int32],  # (n, 6)
    sensors: NDArray[np.int64],  # (m, 3)
    sectors: NDArray[np.int32],  # (n,) scratch
    order: NDArray[np.int32],  # (n,) out
) -> None:
    """Order runs by the direction that they lie in: the next beam then meets what the last did.

    A counting sort, as it keeps the runs of a column together.
    """
    starts = np.zeros(SECTORS + 1, np.int64)
    for i in range(runs.shape[0]):
        k = runs[i, 2]
        along = HALVES * int(runs[i, 0]) + SUBCELLS - sensors[k, 0]
        across = HALVES * int(runs[i, 1]) + SUBCELLS - sensors[k, 1]
        slope = across / (abs(along) + abs(across))  # both odd
        quarters = 1.0 + slope if along > 0 else 3.0 - slope  # 0 to 4
        sector = int(quarters * (SECTORS / 4.0)) % SECTORS
        sectors[i] = sector
        starts[sector + 1] += 1
    for sector in range(SECTORS):
        starts[sector + 1] += starts[sector]
    for i in range(runs.shape[0]):
        order[starts[sectors[i]]] = i
        starts[sectors[i]] += 1


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
