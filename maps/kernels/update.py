"""Kernels of an update: from marks in a sweep's window to the log-odds of bricks.

Eight cells are updated at once in an integer register (SIMD within a register).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayproof.kernel_compiler import kernel
from wayproof.maps.kernels.bricks import (
    B7F,
    B80,
    COLUMNS,
    EDGE,
    EDGE_BITS,
    GATHER,
    BrickArrays,
)

ONE = np.uint64(1)
BYTE = np.uint64(0xFF)
B01, B55, B33, B0F = (np.uint64(0x0101010101010101 * byte) for byte in (0x01, 0x55, 0x33, 0x0F))
SPREAD = np.array(
    [sum(0xFF << (8 * k) for k in range(8) if byte >> k & 1) for byte in range(256)], np.uint64
)
SEEDS = np.array([0x9E3779B97F4A7C15 * k % 2**64 for k in range(1, 9)], np.uint64)
FACTOR = np.uint64(0xD6E8FEB86659FD93)  # odd, so that multiplying by it loses nothing

CONTENT_CHANGED = 1
STATES_CHANGED = 2


class LogOddsSteps(NamedTuple):
    """Update of log-odds, in units.

    Attributes:
        hit: Raise of a cell that was hit.
        miss: Lowering of a cell that was crossed.
        low: Lower clamp.
        high: Upper clamp.
    """

    hit: int
    miss: int
    low: int
    high: int


class WindowMarks(NamedTuple):
    """Marks of a sweep in its window.

    Attributes:
        strides: Words from column to column along x and y.
        hits: (nx * ny * words,) bits of the cells to be raised.
        misses: (nx * ny * words,) bits of the cells to be lowered where they are not raised.
    """

    strides: tuple[int, int]
    hits: NDArray[np.uint64]
    misses: NDArray[np.uint64]


class UpdateTime(NamedTuple):
    """Time of an update.

    Attributes:
        time_ns: Simulated time, ns.
        stamp: Stamp of the changes that it makes.
        due: Tick at which the bricks have to be looked at next.
    """

    time_ns: int
    stamp: int
    due: int


@kernel
def find_touched(
    hits: NDArray[np.uint64],  # (nx * ny * words,)
    misses: NDArray[np.uint64],  # (nx * ny * words,)
    shape: tuple[int, int, int],  # (nx, ny, words)
    touched: NDArray[np.bool_],  # (nx / 16, ny / 16, words) out
) -> None:
    """Find the bricks that have any marks."""
    nx, ny, words = shape
    for x in range(nx):
        for block in range(ny // EDGE):
            for word in range(words):
                base = np.uint64((x * ny + block * EDGE) * words + word)
                found = np.uint64(0)
                for y in range(EDGE):
                    at = base + np.uint64(y * words)
                    found |= hits[at] | misses[at]
                if found != 0:
                    touched[x >> EDGE_BITS, block, word] = True


@kernel
def list_touched(
    touched: NDArray[np.bool_],  # (bx, by, words)
    first: tuple[int, int, int],  # index of the first of these bricks
    keys: NDArray[np.int32],  # (n, 3) out: indices of those that hold any
    places: NDArray[np.int64],  # (n,) out: first word of each in the window
) -> int:
    """List the bricks that hold any marks; return their number."""
    count = int(np.int64(0))
    across, words = touched.shape[1] * EDGE, touched.shape[2]
    for x in range(touched.shape[0]):
        for y in range(touched.shape[1]):
            for word in range(words):
                if touched[x, y, word]:
                    keys[count, 0], keys[count, 1] = first[0] + x, first[1] + y
                    keys[count, 2] = first[2] + word
                    places[count] = (x * EDGE * across + y * EDGE) * words + word
                    count += 1
    return count


@kernel
def count_bits(bits: np.uint64) -> int:
    """Return the number of set bits of a word."""
    bits = bits - ((bits >> ONE) & B55)
    bits = (bits & B33) + ((bits >> np.uint64(2)) & B33)
    bits = (bits + (bits >> np.uint64(4))) & B0F
    return int(np.int64((bits * B01) >> np.uint64(56)))


@kernel
def positive(eight: np.uint64) -> np.uint64:
    """Return the top bit of each of eight int8: whether it is more than 0."""
    return (((eight & B7F) + B7F) | eight) & ~eight & B80


@kernel
def lowered(eight: np.uint64, floor: np.uint64, miss: np.uint64) -> np.uint64:
    """Return max(value, low + miss) - miss of eight int8 at once.

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
    steps: LogOddsSteps,
) -> tuple[np.uint64, int]:
    """Raise the cells that were hit and lower those that were crossed.

    Returns:
        The settled cells, and flags of what changed.
    """
    hit, miss, low, high = steps
    floor, fall = np.uint64(low + miss + 128) * B01, np.uint64(miss) * B01
    bottom = np.uint64(low & 0xFF) * B01
    # Lower the cells that were crossed, eight at a time; settled ones stay as they are.
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
            # Bytes that have come down to the lower clamp are settled.
            apart = new ^ bottom
            same = ~(((apart & B7F) + B7F) | apart | B7F)
            settled |= ((((same >> np.uint64(7)) * GATHER) >> np.uint64(56)) & byte) << shift
        shift += np.uint64(8)
    # Raise the cells that were hit, one by one: there are few.
    settled &= ~hits
    while hits != 0:
        bit = hits & (~hits + ONE)
        hits ^= bit
        z = count_bits(bit - ONE)
        before = int(cells[z])
        after = min(before + hit, high)
        cells[z] = after
        differ |= np.uint64(before != after)
        turned |= np.uint64((before > 0) != (after > 0) or (before < 0) != (after < 0))
    changed = CONTENT_CHANGED if differ != 0 else 0
    return settled, changed | (STATES_CHANGED if turned != 0 else 0)


@kernel
def update_bricks(
    slots: NDArray[np.int64],  # (k,) -1: there was no room
    offsets: NDArray[np.int64],  # (k,) first word of each brick in the window
    marks: WindowMarks,  # zero after
    steps: LogOddsSteps,
    bricks: BrickArrays,  # in, out
    now: UpdateTime,
) -> int:
    """Update each marked cell once; a hit comes before a crossing. Returns their number."""
    strides, hits, misses = marks
    cells, eights, fresh, settled, observed_ns, _, dues, stamps, dirty = bricks
    time_ns, stamp, due = now
    updated = int(np.int64(0))
    for i in range(slots.shape[0]):
        slot = slots[i]
        flags = 0
        for column in range(COLUMNS):
            x, y = column >> EDGE_BITS, column & (EDGE - 1)
            at = np.uint64(offsets[i] + x * strides[0] + y * strides[1])
            hit = hits[at]
            crossed = misses[at] & ~hit
            hits[at] = 0
            misses[at] = 0
            if hit | crossed == 0 or slot < 0:
                continue
            updated += count_bits(hit | crossed)
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
        # Note what changed of the brick.
        if slot < 0:
            continue
        observed_ns[slot] = max(observed_ns[slot], time_ns)
        dues[slot] = due
        if flags & CONTENT_CHANGED != 0:
            dirty[slot] = True
        if flags & STATES_CHANGED != 0:
            stamps[slot] = stamp
    return updated


@kernel
def digest_bricks(
    slots: NDArray[np.int64],  # (k,)
    eights: NDArray[np.uint64],  # (slots, n, 8)
    lanes: NDArray[np.uint64],  # (k, 8) out
    held: NDArray[np.bool_],  # (k,) out: whether any cell is not 0
) -> None:
    """Compute eight 64-bit digests of each brick, each of every eighth word.

    A lane is a chain of steps that lose nothing, so contents that differ in one word never share
    their digests; others do by a chance of 2^-64 a lane.
    """
    for i in range(slots.shape[0]):
        slot = slots[i]
        any_bit = np.uint64(0)
        for k in range(8):
            lanes[i, k] = SEEDS[k]
        for column in range(eights.shape[1]):
            for k in range(8):
                word = eights[slot, column, k]
                any_bit |= word
                mixed = (lanes[i, k] ^ word) * FACTOR
                lanes[i, k] = mixed ^ (mixed >> np.uint64(32))
        held[i] = any_bit != 0
