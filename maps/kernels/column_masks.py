"""Bit masks of the cells that beams cross in one word of each column."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wayproof.kernel_compiler import inlined
from wayproof.maps.kernels.beam_columns import FRACTION_BITS
from wayproof.maps.kernels.beam_targets import OWN_LAYER
from wayproof.maps.kernels.beams import HALVES, HALVES_BITS, ONE, SUBCELLS, TWO

EVERY_LAYER = -(1 << 30)  # below all that a beam may mark

FULL = np.uint64(0xFFFFFFFFFFFFFFFF)
B01, B55, B33, B0F = (np.uint64(0x0101010101010101 * byte) for byte in (0x01, 0x55, 0x33, 0x0F))


@inlined
def find_heights(
    fractions: NDArray[np.int64],  # (n,) as of `traverse`
    n: int,
    middle: int,  # height of the end, 1/1024 of a cell
    rise: int,  # from there to the sensor
    heights: NDArray[np.int64],  # (n,) out
) -> None:
    """Find the cells along z in which a beam enters columns."""
    base = middle << FRACTION_BITS
    for s in range(n):
        heights[s] = (base + fractions[s] * rise) >> (FRACTION_BITS + HALVES_BITS)


@inlined
def bits_from(height: int) -> np.uint64:
    """Return the bits of a word at a height from 0 to 64 and above it."""
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
    """Mark the cells as `mark_within`, for beams that are also below or above the word."""
    for s in range(n):
        low, high = min(lower[s], lower[s + 1]), max(upper[s], upper[s + 1])
        first, end = min(max(low, 0), 64), min(max(high + 1, 0), 64)
        masks[s] |= bits_from(first) & ~bits_from(end) & keep


@inlined
def mark_run(
    run: tuple[int, int],  # lowest and highest end, from the word's bottom
    top: int,  # height of the sensor, 1/1024 of a cell
    keep: np.uint64,
    n: int,  # columns
    fractions: NDArray[np.int64],  # (n + 1,)
    lower: NDArray[np.int64],  # (n + 1,) scratch
    upper: NDArray[np.int64],  # (n + 1,) scratch
    masks: NDArray[np.uint64],  # (n,) in, out
) -> None:
    """Mark the cells that the beams to a run of ends cross within one word of each column.

    Neither another name for an array nor an early return: either would have references counted, at
    some nanoseconds each time.
    """
    low, high = run
    middle = low * HALVES + SUBCELLS
    find_heights(fractions, n + 1, middle, top - middle, lower)
    # Most runs are of one end, on a floor or a ceiling, and most beams stay within the word, as it
    # is 64 cells high. They rise or fall all along.
    alone = low == high and min(lower[0], lower[n]) >= 0 and max(lower[0], lower[n]) <= 63
    if not alone:
        middle = high * HALVES + SUBCELLS
        find_heights(fractions, n + 1, middle, top - middle, upper)
    if alone:
        mark_within(n, lower, lower, keep, masks)
    elif min(lower[0], lower[n]) >= 0 and max(upper[0], upper[n]) <= 63:
        mark_within(n, lower, upper, keep, masks)
    else:
        mark_across(n, lower, upper, keep, masks)


@inlined
def first_bit(word: np.uint64) -> int:
    """Return the index of the lowest set bit of a word that is not 0."""
    bits = (word & (~word + ONE)) - ONE  # as many ones as there are zeros below it
    bits = bits - ((bits >> ONE) & B55)
    bits = (bits & B33) + ((bits >> np.uint64(2)) & B33)
    bits = (bits + (bits >> np.uint64(4))) & B0F
    return int(np.int64((bits * B01) >> np.uint64(56)))


@inlined
def next_run(bits: np.uint64) -> tuple[int, int]:
    """Return the first and last of the lowest run of set bits in a word that is not 0."""
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
    """List the runs of ends without a gap; return the number of runs with these.

    Ends that each spare their own layer are runs of one.
    """
    single = sparing and guarded_layer == OWN_LAYER
    while bits != 0:
        first, last = next_run(bits)
        low, high = bottom + first, bottom + (first if single else last)
        spared = sparing and low <= guarded_layer <= high
        if spared and low < guarded_layer:  # those that end below it are not spared
            high, spared = guarded_layer - 1, False
        bits &= ~((FULL >> np.uint64(63 - high + low)) << np.uint64(low - bottom))
        runs[count, 0], runs[count, 1] = low, high
        runs[count, 2] = guarded_layer + 1 if spared else low + 1 if single else EVERY_LAYER
        count += 1
    return count
