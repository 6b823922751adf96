"""Compiled kernels of bricks: where each is held, and what a sweep does to its cells.

A brick is 16 x 16 columns of 64 cells. The log-odds of a column are one cache line, and a bit for
each of its cells is one word. Eight cells are updated at once in a register, so a brick's cells are
also seen as words; the byte order is little-endian, as on every processor that numba knows.

All kernels that call each other live in this file because a cached kernel is not recompiled when
another file changes.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from maps._jit import kernel
from maps.states import FREE, OCCUPIED, UNKNOWN

EDGE_BITS = 4
EDGE = 1 << EDGE_BITS  # columns along a brick's edge
HEIGHT = 64  # cells
COLUMNS = EDGE * EDGE
BELOW_FLOOR = 2  # layers: else the noise of the floor's returns would open a second brick

ONE = np.uint64(1)
BYTE = np.uint64(0xFF)
B01 = np.uint64(0x0101010101010101)
B7F = np.uint64(0x7F7F7F7F7F7F7F7F)
B80 = np.uint64(0x8080808080808080)
B55, B33, B0F = (np.uint64(0x0101010101010101 * byte) for byte in (0x55, 0x33, 0x0F))
GATHER = np.uint64(0x0102040810204080)  # times eight bytes of 0 or 1: their bits, in the top byte
SPREAD = np.array(
    [sum(0xFF << (8 * k) for k in range(8) if byte >> k & 1) for byte in range(256)], np.uint64
)
SEEDS = np.array([0x9E3779B97F4A7C15 * k % 2**64 for k in range(1, 9)], np.uint64)
FACTOR = np.uint64(0xD6E8FEB86659FD93)  # odd, so that multiplying by it loses nothing

CONTENT_CHANGED = 1
STATES_CHANGED = 2


@kernel
def bucket_of(x: int, y: int, z: int, buckets: int) -> int:
    """Spatial hash (Teschner et al. 2003, "Optimized spatial hashing"); `buckets` is 2^k."""
    return ((x * 73856093) ^ (y * 19349663) ^ (z * 83492791)) & (buckets - 1)


@kernel
def find(
    heads: NDArray[np.int32],  # (2^k,) first slot of each bucket, or -1
    links: NDArray[np.int32],  # (slots,) next one in the bucket, or -1
    keys: NDArray[np.int32],  # (slots, 3)
    x: int,
    y: int,
    z: int,
) -> int:
    """The slot of a brick, or -1."""
    slot = int(heads[bucket_of(x, y, z, heads.shape[0])])
    while slot >= 0 and not (keys[slot, 0] == x and keys[slot, 1] == y and keys[slot, 2] == z):
        slot = int(links[slot])
    return slot


@kernel
def find_all(
    heads: NDArray[np.int32],
    links: NDArray[np.int32],
    keys: NDArray[np.int32],
    wanted: NDArray[np.int32],  # (k, 3)
    slots: NDArray[np.int64],  # (k,) out: -1 where there is none
) -> None:
    """Find the slots of bricks."""
    for i in range(wanted.shape[0]):
        slots[i] = find(heads, links, keys, wanted[i, 0], wanted[i, 1], wanted[i, 2])


@kernel
def enter(
    heads: NDArray[np.int32],
    links: NDArray[np.int32],
    keys: NDArray[np.int32],
    slots: NDArray[np.int64],  # (k,) keys already written
) -> None:
    """Enter bricks into the directory."""
    for slot in slots:
        bucket = bucket_of(keys[slot, 0], keys[slot, 1], keys[slot, 2], heads.shape[0])
        links[slot] = heads[bucket]
        heads[bucket] = slot


@kernel
def strike_out(
    heads: NDArray[np.int32],
    links: NDArray[np.int32],
    keys: NDArray[np.int32],
    slots: NDArray[np.int64],  # (k,)
) -> None:
    """Take bricks out of the directory."""
    for slot in slots:
        bucket = bucket_of(keys[slot, 0], keys[slot, 1], keys[slot, 2], heads.shape[0])
        at = np.int64(heads[bucket])
        if at == slot:
            heads[bucket] = links[slot]
            continue
        while links[at] != slot:
            at = np.int64(links[at])
        links[at] = links[slot]


@kernel
def gather(
    hits: NDArray[np.uint64],  # (threads, nx * ny * words)
    free: NDArray[np.uint64],  # (threads, nx * ny * words)
    shape: tuple[int, int, int],  # (nx, ny, words)
    rows: tuple[int, int],  # first and one past the last row of bricks along x
    touched: NDArray[np.bool_],  # (nx / 16, ny / 16, words) out
) -> None:
    """Merge the marks of all threads into the first one's, and tell which bricks have any."""
    _, ny, words = shape
    for x in range(rows[0] * EDGE, rows[1] * EDGE):
        for block in range(ny // EDGE):
            for word in range(words):
                base = np.uint64((x * ny + block * EDGE) * words + word)
                found = np.uint64(0)
                for y in range(EDGE):
                    at = base + np.uint64(y * words)
                    for thread in range(1, hits.shape[0]):
                        hits[0, at] |= hits[thread, at]
                        free[0, at] |= free[thread, at]
                        hits[thread, at] = 0
                        free[thread, at] = 0
                    found |= hits[0, at] | free[0, at]
                if found != 0:
                    touched[x >> EDGE_BITS, block, word] = True


@kernel
def count_bits(bits: np.uint64) -> int:
    """Number of set bits of a word."""
    bits = bits - ((bits >> ONE) & B55)
    bits = (bits & B33) + ((bits >> np.uint64(2)) & B33)
    bits = (bits + (bits >> np.uint64(4))) & B0F
    return int(np.int64((bits * B01) >> np.uint64(56)))


@kernel
def positive(eight: np.uint64) -> np.uint64:
    """The top bit of each of eight int8: whether it is more than 0."""
    return (((eight & B7F) + B7F) | eight) & ~eight & B80


@kernel
def lowered(eight: np.uint64, floor: np.uint64, miss: np.uint64) -> np.uint64:
    """max(value, low + miss) - miss of eight int8 at once.

    `floor` holds low + miss + 128 and `miss` the miss in every byte. Compared are the values plus
    128, which are not negative: first their upper bits, and where these agree the lower seven.
    """
    raised = eight ^ B80
    lower_bits = (raised | B80) - (floor & B7F)
    above = ((raised & ~floor) | (~(raised ^ floor) & lower_bits)) & B80
    chosen = (above >> np.uint64(7)) * BYTE
    return (((raised & chosen) | (floor & ~chosen)) - miss) ^ B80


@kernel
def update_column(
    cells: NDArray[np.int8],  # (64,)
    eights: NDArray[np.uint64],  # (8,) the same memory
    settled: np.uint64,  # cells known to lie at the lower clamp
    hits: np.uint64,
    free: np.uint64,
    steps: tuple[int, int, int, int],  # (hit, miss, low, high)
) -> tuple[np.uint64, int]:
    """Raise the cells that were hit and lower those that were crossed.

    Returns:
        The settled cells, and flags of what changed.
    """
    hit, miss, low, high = steps
    floor, fall = np.uint64(low + miss + 128) * B01, np.uint64(miss) * B01
    bottom = np.uint64(low & 0xFF) * B01
    differ, turned = np.uint64(0), np.uint64(0)
    todo = free & ~settled
    shift = np.uint64(0)
    for k in range(8):
        byte = (todo >> shift) & BYTE
        if byte != 0:
            old, mask = eights[k], SPREAD[byte]
            new = (old & ~mask) | (lowered(old, floor, fall) & mask)
            eights[k] = new
            differ |= old ^ new
            turned |= ((old ^ new) & B80) | (positive(old) ^ positive(new))
            apart = new ^ bottom
            same = ~(((apart & B7F) + B7F) | apart | B7F)
            settled |= ((((same >> np.uint64(7)) * GATHER) >> np.uint64(56)) & byte) << shift
        shift += np.uint64(8)
    settled &= ~hits
    while hits != 0:
        bit = hits & (~hits + ONE)
        hits ^= bit
        z = count_bits(bit - ONE)
        before = int(cells[z])
        after = min(before + hit, high)
        cells[z] = after
        differ |= np.uint64(before != after)
        turned |= np.uint64((before > 0) != (after > 0))
    changed = CONTENT_CHANGED if differ != 0 else 0
    return settled, changed | (STATES_CHANGED if turned != 0 else 0)


@kernel
def update_bricks(
    slots: NDArray[np.int64],  # (k,) -1: there was no room
    places: NDArray[np.int64],  # (k,) first word of each brick in the window
    part: tuple[int, int],  # first and one past the last of them to update
    strides: tuple[int, int],  # words from column to column along x and y
    hits: NDArray[np.uint64],  # (nx * ny * words,) zero after
    free: NDArray[np.uint64],  # (nx * ny * words,) zero after
    steps: tuple[int, int, int, int],
    cells: NDArray[np.int8],  # (slots, COLUMNS, 64)
    eights: NDArray[np.uint64],  # (slots, COLUMNS, 8) the same memory
    fresh: NDArray[np.uint64],  # (slots, COLUMNS)
    settled: NDArray[np.uint64],  # (slots, COLUMNS)
    changes: NDArray[np.uint8],  # (k,) out
    updated: NDArray[np.int64],  # (k,) out: cells
) -> None:
    """Update each marked cell once; a hit comes before a crossing."""
    for i in range(part[0], part[1]):
        slot = slots[i]
        flags, seen = 0, 0
        for column in range(COLUMNS):
            x, y = column >> EDGE_BITS, column & (EDGE - 1)
            at = np.uint64(places[i] + x * strides[0] + y * strides[1])
            hit = hits[at]
            crossed = free[at] & ~hit
            hits[at] = 0
            free[at] = 0
            if hit | crossed == 0 or slot < 0:
                continue
            seen += count_bits(hit | crossed)
            fresh[slot, column] |= hit | crossed
            if hit != 0 or crossed & ~settled[slot, column] != 0:
                settled[slot, column], changed = update_column(
                    cells[slot, column],
                    eights[slot, column],
                    settled[slot, column],
                    hit,
                    crossed,
                    steps,
                )
                flags |= changed
        changes[i] = flags
        updated[i] = seen


@kernel
def column_states(eights: NDArray[np.uint64]) -> tuple[np.uint64, np.uint64]:
    """The occupied and the free cells of a column, a bit each."""
    occupied, free = np.uint64(0), np.uint64(0)
    shift = np.uint64(0)
    for k in range(8):
        eight = eights[k]
        if eight != 0:
            above = positive(eight) >> np.uint64(7)
            below = (eight & B80) >> np.uint64(7)
            occupied |= ((above * GATHER) >> np.uint64(56)) << shift
            free |= ((below * GATHER) >> np.uint64(56)) << shift
        shift += np.uint64(8)
    return occupied, free


@kernel
def write_columns(
    heads: NDArray[np.int32],
    links: NDArray[np.int32],
    keys: NDArray[np.int32],
    eights: NDArray[np.uint64],  # (slots, COLUMNS, 8)
    low: tuple[int, int, int],  # cell
    occupied: NDArray[np.uint64],  # (nx, ny, words) out, zero before
    free: NDArray[np.uint64],  # (nx, ny, words) out, zero before
) -> None:
    """Write the states of a window of cells, whose bottom may lie anywhere in a brick."""
    nx, ny, words = occupied.shape
    bottom = low[2] + BELOW_FLOOR
    first_z, shift = bottom >> 6, np.uint64(bottom & 63)
    back = np.uint64(64) - shift
    for bx in range(low[0] >> EDGE_BITS, ((low[0] + nx - 1) >> EDGE_BITS) + 1):
        for by in range(low[1] >> EDGE_BITS, ((low[1] + ny - 1) >> EDGE_BITS) + 1):
            for k in range(words + (1 if shift != 0 else 0)):
                slot = find(heads, links, keys, bx, by, first_z + k)
                if slot < 0:
                    continue
                for x in range(max(bx * EDGE, low[0]), min(bx * EDGE + EDGE, low[0] + nx)):
                    for y in range(max(by * EDGE, low[1]), min(by * EDGE + EDGE, low[1] + ny)):
                        column = (x - bx * EDGE) * EDGE + y - by * EDGE
                        held, clear = column_states(eights[slot, column])
                        i, j = x - low[0], y - low[1]
                        if k < words:
                            occupied[i, j, k] |= held >> shift
                            free[i, j, k] |= clear >> shift
                        if k > 0 and shift != 0:
                            occupied[i, j, k - 1] |= held << back
                            free[i, j, k - 1] |= clear << back


@kernel
def column_of(x: int, y: int) -> int:
    """Index of a column of cells in its brick."""
    return ((x & (EDGE - 1)) << EDGE_BITS) + (y & (EDGE - 1))


@kernel
def look_up(
    heads: NDArray[np.int32],
    links: NDArray[np.int32],
    keys: NDArray[np.int32],
    cells: NDArray[np.int8],  # (slots, COLUMNS, 64)
    wanted: NDArray[np.int64],  # (n, 3) cells
    slots: NDArray[np.int64],  # (n,) out: -1 where nothing is held
    values: NDArray[np.int8],  # (n,) out, 0 there
) -> None:
    """The log-odds of cells as their bricks hold them."""
    for i in range(wanted.shape[0]):
        x, y, z = wanted[i, 0], wanted[i, 1], wanted[i, 2] + BELOW_FLOOR
        slot = find(heads, links, keys, x >> EDGE_BITS, y >> EDGE_BITS, z >> 6)
        slots[i] = slot
        values[i] = cells[slot, column_of(x, y), z & 63] if slot >= 0 else 0


@kernel
def walk(
    heads: NDArray[np.int32],
    links: NDArray[np.int32],
    keys: NDArray[np.int32],
    cells: NDArray[np.int8],
    origin: NDArray[np.float64],  # (3,) in cells
    direction: NDArray[np.float64],  # (3,) unit
    reach: float,  # cells
    stop_at_unknown: bool,
) -> tuple[float, int]:
    """Follow a ray from cell to cell up to an occupied (or unknown) one.

    Amanatides & Woo (1987), "A fast voxel traversal algorithm for ray tracing".

    Returns:
        How far along the ray that cell begins, in cells, and its state; `reach` and FREE if none.
    """
    cell, step = np.empty(3, np.int64), np.empty(3, np.int64)
    times, pitches = np.full(3, np.inf), np.full(3, np.inf)
    for axis in range(3):
        cell[axis] = np.int64(np.floor(origin[axis]))
        step[axis] = 1 if direction[axis] > 0.0 else -1
        if direction[axis] != 0.0:
            face = cell[axis] + (1 if direction[axis] > 0.0 else 0)
            times[axis] = (face - origin[axis]) / direction[axis]
            pitches[axis] = abs(1.0 / direction[axis])
    distance = 0.0
    while distance <= reach:
        z = cell[2] + BELOW_FLOOR
        slot = find(heads, links, keys, cell[0] >> EDGE_BITS, cell[1] >> EDGE_BITS, z >> 6)
        value = np.int64(cells[slot, column_of(cell[0], cell[1]), z & 63]) if slot >= 0 else 0
        if value > 0:
            return distance, OCCUPIED
        if value == 0 and stop_at_unknown:
            return distance, UNKNOWN
        axis = 0 if times[0] <= times[1] and times[0] <= times[2] else 1
        if times[2] < times[axis]:
            axis = 2
        distance = times[axis]
        times[axis] += pitches[axis]
        cell[axis] += step[axis]
    return reach, FREE


@kernel
def digest_bricks(
    slots: NDArray[np.int64],  # (k,)
    part: tuple[int, int],
    eights: NDArray[np.uint64],  # (slots, COLUMNS, 8)
    lanes: NDArray[np.uint64],  # (k, 8) out
    held: NDArray[np.bool_],  # (k,) out: whether any cell is not 0
) -> None:
    """Eight 64-bit digests of each brick, of every eighth word.

    A lane is a chain of steps that lose nothing, so contents that differ in one word never share
    their digests; others do by a chance of 2^-64 a lane.
    """
    for i in range(part[0], part[1]):
        slot = slots[i]
        any_bit = np.uint64(0)
        lanes[i] = SEEDS
        for column in range(COLUMNS):
            for k in range(8):
                word = eights[slot, column, k]
                any_bit |= word
                mixed = (lanes[i, k] ^ word) * FACTOR
                lanes[i, k] = mixed ^ (mixed >> np.uint64(32))
        held[i] = any_bit != 0
