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
UNIT_TOLERANCE = 1e-6

# Flags of a column.
LISTED = np.uint8(1)
GRAZED = np.uint8(2)  # a beam ends in its guarded layer

EVERY_LAYER = -(1 << 30)  # below all that a beam may mark
SECTORS = 4096

ONE = np.uint64(1)
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
