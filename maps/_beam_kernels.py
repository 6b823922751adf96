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
HALF_PITCH = 2.0 ** (WAY_BITS + HALVES_BITS - 1)  # of faces, on a beam of 1/1024 of a cell
UNIT_TOLERANCE = 1e-6

# Flags of a column.
LISTED = np.uint8(1)
GRAZED = np.uint8(2)  # a beam ends in its guarded layer

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
def mark_run(masks: NDArray[np.uint64], base: int, low: int, high: int) -> None:
    """Set the bits of cells `low` to `high` of the column whose first word is `base`."""
    word, last = low >> 6, high >> 6
    bits = FULL << np.uint64(low & 63)
    while word < last:
        masks[base + word] |= bits
        bits = FULL
        word += 1
    if low <= high:
        masks[base + word] |= bits & (FULL >> np.uint64(63 - (high & 63)))


@kernel
def carve_in_word(
    place: int,  # word of the end
    steps: int,  # columns to the sensor's
    ends: tuple[int, int],  # lowest and highest cell of the run, 0 to 63
    top: int,  # height of the sensor in the word, 1/1024 of a cell
    keep: np.uint64,  # bits that may be marked
    halves: tuple[int, int],  # way from the end to the first face along x and y
    jumps: tuple[int, int],  # words from column to column along x and y
    free: NDArray[np.uint64],
) -> tuple[int, int]:
    """Mark the columns before a run of ends where all beams stay within one word.

    Returns:
        The lowest and the highest cell at which the beams enter the sensor's column.
    """
    low, high = ends
    low_middle, high_middle = low * HALVES + SUBCELLS, high * HALVES + SUBCELLS
    low_rise, high_rise = top - low_middle, top - high_middle
    low_base, high_base = low_middle << WAY_BITS, high_middle << WAY_BITS
    way_x, way_y = halves
    pitch_x, pitch_y = 2 * halves[0], 2 * halves[1]
    turn = jumps[0] - jumps[1]
    # Through x: all ones if the next face is along x. Masks, as a branch is mispredicted.
    if low == high:  # one beam, half the work
        for _ in range(steps):
            ahead = way_x - way_y
            through_x = (ahead - 1) >> 63
            way = way_y + (ahead & through_x)
            next_low = (low_base + way * low_rise) >> (WAY_BITS + HALVES_BITS)
            first, last = np.uint64(min(low, next_low)), np.uint64(max(low, next_low))
            free[np.uint64(place)] |= ((TWO << last) - (ONE << first)) & keep
            low = next_low
            place += jumps[1] + (turn & through_x)
            way_x += pitch_x & through_x
            way_y += pitch_y & ~through_x
        return low, low
    for _ in range(steps):
        ahead = way_x - way_y
        through_x = (ahead - 1) >> 63
        way = way_y + (ahead & through_x)
        next_low = (low_base + way * low_rise) >> (WAY_BITS + HALVES_BITS)
        next_high = (high_base + way * high_rise) >> (WAY_BITS + HALVES_BITS)
        first, last = np.uint64(min(low, next_low)), np.uint64(max(high, next_high))
        free[np.uint64(place)] |= ((TWO << last) - (ONE << first)) & keep
        low, high = next_low, next_high
        place += jumps[1] + (turn & through_x)
        way_x += pitch_x & through_x
        way_y += pitch_y & ~through_x
    return low, high


@kernel
def carve_across_words(
    column: int,
    steps: int,
    ends: tuple[int, int],
    top: int,
    least: int,  # cells below it are not marked
    halves: tuple[int, int],
    jumps: tuple[int, int],  # columns
    words: int,
    free: NDArray[np.uint64],
) -> tuple[int, int]:
    """The same for beams that pass from word to word."""
    low, high = ends
    low_middle, high_middle = low * HALVES + SUBCELLS, high * HALVES + SUBCELLS
    low_rise, high_rise = top - low_middle, top - high_middle
    way_x, way_y = halves
    for _ in range(steps):
        through_x = way_x <= way_y
        way = min(way_x, way_y)
        next_low = (low_middle + ((way * low_rise) >> WAY_BITS)) >> HALVES_BITS
        next_high = (high_middle + ((way * high_rise) >> WAY_BITS)) >> HALVES_BITS
        first, last = max(min(low, next_low), least), max(high, next_high)
        mark_run(free, column * words, first, last)
        low, high = next_low, next_high
        column += jumps[0] if through_x else jumps[1]
        way_x += 2 * halves[0] if through_x else 0
        way_y += 0 if through_x else 2 * halves[1]
    return low, high


@kernel
def carve_run(
    column: int,
    target: int,  # the sensor's column
    steps: int,
    ends: tuple[int, int],
    top: int,
    least: int,
    halves: tuple[int, int],
    jumps: tuple[int, int],
    words: int,
    free: NDArray[np.uint64],
) -> None:
    """Mark the cells between the beams to the lowest and the highest of a run of ends along z.

    Beams in between leave no gap: neighbours end one cell apart and come closer on their way.
    """
    inner = top >> HALVES_BITS
    word = inner >> 6
    if ends[0] >> 6 == word and ends[1] >> 6 == word:  # most, as a word is 64 cells high
        bottom = 64 * word
        keep = FULL << np.uint64(max(least - bottom, 0))
        low, high = carve_in_word(
            column * words + word,
            steps,
            (ends[0] - bottom, ends[1] - bottom),
            top - bottom * HALVES,
            keep,
            halves,
            (jumps[0] * words, jumps[1] * words),
            free,
        )
        low, high = low + bottom, high + bottom
    else:
        low, high = carve_across_words(column, steps, ends, top, least, halves, jumps, words, free)
    mark_run(free, target * words, max(min(low, inner), least), max(high, inner))


@kernel
def carve_column(
    column: int,
    sensor: tuple[int, int, int],  # 1/1024 of a cell, from the window's corner
    guarded_layer: int,  # -1: none
    shape: tuple[int, int, int],  # (nx, ny, words)
    aims: NDArray[np.uint64],  # (nx * ny * words,)
    flags: NDArray[np.uint8],  # (nx * ny,)
    free: NDArray[np.uint64],  # (nx * ny * words,)
) -> None:
    """Mark the cells of all beams that end in a column, from there to the sensor."""
    _, ny, words = shape
    x, y = column // ny, column % ny
    to_x, to_y = sensor[0] - x * HALVES - SUBCELLS, sensor[1] - y * HALVES - SUBCELLS  # both odd
    halves = (int(HALF_PITCH / abs(to_x)), int(HALF_PITCH / abs(to_y)))
    jumps = (ny if to_x > 0 else -ny, 1 if to_y > 0 else -1)
    target_x, target_y = sensor[0] >> HALVES_BITS, sensor[1] >> HALVES_BITS
    steps, target = abs(target_x - x) + abs(target_y - y), target_x * ny + target_y

    for word in range(words):
        bits = aims[column * words + word]
        aims[column * words + word] = 0
        spare = False
        if flags[column] & GRAZED and guarded_layer >> 6 == word:
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
            least = guarded_layer + 1 if spared else 0
            carve_run(
                column, target, steps, (low, high), sensor[2], least, halves, jumps, words, free
            )
    flags[column] = 0


@kernel
def aim_beams(
    ends: NDArray[np.int32],  # (n, 3)
    fates: NDArray[np.uint8],  # (n,)
    beams: tuple[int, int],
    corner: tuple[int, int, int],  # cell at the window's corner
    guarded_layer: int,
    shape: tuple[int, int, int],
    hits: NDArray[np.uint64],
    aims: NDArray[np.uint64],
    flags: NDArray[np.uint8],
    columns: NDArray[np.int32],  # out
) -> int:
    """Mark the cells that beams end in and list their columns; return the number of these."""
    count = 0
    for i in range(beams[0], beams[1]):
        if fates[i] > CLEARED:
            continue
        x, y, z = ends[i, 0] - corner[0], ends[i, 1] - corner[1], ends[i, 2] - corner[2]
        column = x * shape[1] + y
        word, bit = column * shape[2] + (z >> 6), ONE << np.uint64(z & 63)
        flag = LISTED
        if fates[i] == RETURNED:
            hits[word] |= bit
        if fates[i] == RETURNED and z == guarded_layer:
            flag = LISTED | GRAZED
        else:
            aims[word] |= bit
        if flags[column] == 0:
            columns[count] = column
            count += 1
        flags[column] |= flag
    return count


@kernel
def carve(
    ends: NDArray[np.int32],  # (n, 3)
    fates: NDArray[np.uint8],  # (n,)
    groups: NDArray[np.int64],  # (m + 1,) first beam of each sensor position, and the end
    sensors: NDArray[np.int64],  # (m, 3) 1/1024 of a cell, from the window's corner
    beams: tuple[int, int],
    corner: tuple[int, int, int],
    guarded_layer: int,  # from the window's bottom; -1: none
    shape: tuple[int, int, int],  # (nx, ny, words)
    hits: NDArray[np.uint64],  # (nx * ny * words,) out
    free: NDArray[np.uint64],  # (nx * ny * words,) out
    aims: NDArray[np.uint64],  # (nx * ny * words,) zero before and after
    flags: NDArray[np.uint8],  # (nx * ny,) zero before and after
    columns: NDArray[np.int32],  # (n,) scratch
) -> None:
    """Mark the cells that the beams of a sweep hit and those that they cross."""
    for k in range(sensors.shape[0]):
        share = (max(beams[0], groups[k]), min(beams[1], groups[k + 1]))
        sensor = (sensors[k, 0], sensors[k, 1], sensors[k, 2])
        guarded = guarded_layer if sensor[2] >> HALVES_BITS > guarded_layer else -1
        count = aim_beams(ends, fates, share, corner, guarded, shape, hits, aims, flags, columns)
        for j in range(count):
            carve_column(int(columns[j]), sensor, guarded, shape, aims, flags, free)
