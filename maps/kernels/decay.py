"""Kernels of decay: log-odds after many ticks, of single values and of bricks left alone meanwhile.

Tick n takes floor(r + u) units from a magnitude v, where r is the exact loss of v in one tick and
u = n phi mod 1 with the golden ratio phi: a rounding threshold that is spread evenly over the ticks
and is the same for all values. So the half-life holds even where a tick takes less than one unit:
between two losses of a unit lie 1 / r ticks on average, since u returns to an interval of length r
that often (Kac 1947). That is a pure function of value and tick, so a brick can be left alone and
brought up to date later. Tried: floor((n + 1) r) - floor(n r), whose phase differs from value to
value; small values then fade up to twice too fast.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayproof.kernel_compiler import kernel
from wayproof.maps.kernels.bricks import BrickArrays

LOSS_BITS = 40
FRACTION = np.uint64((1 << LOSS_BITS) - 1)
GOLDEN = np.uint64(0x9E3779B97F)  # (sqrt(5) - 1) / 2, in 2^-40
NEVER = 1 << 62  # a tick
HORIZON = 1 << 12  # ticks after which a brick is looked at in any case
BYTE = np.uint64(0xFF)
MAGNITUDES = 128  # of an int8
WHOLE = np.uint64(0xFFFFFFFFFFFFFFFF)
B01, B7F = np.uint64(0x0101010101010101), np.uint64(0x7F7F7F7F7F7F7F7F)
DIAGONAL = np.uint64(0x8040201008040201)  # bit k of byte k


class FadedBricks(NamedTuple):
    """Changes of bricks by decay.

    Attributes:
        turned: (k,) whether the state of any cell changed.
        alive: (k,) whether any cell may still be known.
    """

    turned: NDArray[np.bool_]
    alive: NDArray[np.bool_]


class FadeScratch(NamedTuple):
    """Memory for `fade_bricks`.

    Attributes:
        steps: (MAGNITUDES,) as of `list_losses`.
        magnitudes: (64,) of the cells of a column.
        losses: (64,) of these.
        loss_words: (8,) the same memory.
    """

    steps: NDArray[np.uint8]
    magnitudes: NDArray[np.uint8]
    losses: NDArray[np.uint8]
    loss_words: NDArray[np.uint64]


@kernel
def fade(magnitude: int, tick: int, until: int, losses: NDArray[np.uint64]) -> tuple[int, int]:
    """Take a magnitude from one tick to another; stop early where it reaches 0.

    Args:
        magnitude: Magnitude of a log-odds, units.
        tick: Number of ticks that it has seen.
        until: Number of ticks that it is to see.
        losses: (128,) loss in one tick by magnitude, in 2^-40 units.

    Returns:
        The magnitude, and the number of ticks that it has seen then.
    """
    threshold = (np.uint64(tick) * GOLDEN) & FRACTION
    while magnitude > 0 and tick < until:
        loss = int(np.int64((losses[magnitude] + threshold) >> np.uint64(LOSS_BITS)))
        magnitude = max(magnitude - loss, 0)
        threshold = (threshold + GOLDEN) & FRACTION
        tick += 1
    return magnitude, tick


@kernel
def fade_values(
    values: NDArray[np.int8],  # (n,) in and out
    ticks: NDArray[np.int64],  # (n,) number of ticks that each has seen
    until: int,
    losses: NDArray[np.uint64],  # (128,)
) -> None:
    """Bring single values up to date."""
    for i in range(values.shape[0]):
        value = int(values[i])
        left, _ = fade(abs(value), int(ticks[i]), until, losses)
        values[i] = left if value > 0 else -left


@kernel
def list_losses(
    tick: int,
    until: int,
    losses: NDArray[np.uint64],  # (128,)
    steps: NDArray[np.uint8],  # (MAGNITUDES,) out
) -> int:
    """List the losses of magnitudes from one tick to another: unit n is lost from steps[n] on.

    Ticks take no more from a magnitude than from a greater one, and do not change their order.

    Returns:
        Units that the greatest magnitude loses.
    """
    count = int(np.int64(0))
    for magnitude in range(1, MAGNITUDES):
        left, _ = fade(magnitude, tick, until, losses)
        while count < magnitude - left:
            steps[count] = magnitude
            count += 1
    return count


@kernel
def least_magnitude(
    cells: NDArray[np.int8],  # (COLUMNS, 64)
    floor: int,
) -> int:
    """Return the least magnitude of cells that is at least `floor`; MAGNITUDES without one.

    Counted from the floor up in bytes, what is below it comes out above all that is not.
    """
    least = np.uint8(255)
    for column in range(cells.shape[0]):
        for z in range(cells.shape[1]):
            value = cells[column, z]
            magnitude = np.uint8(value if value >= 0 else -value)
            least = min(least, np.uint8((int(magnitude) - floor) & 255))
    return min(int(least) + floor, MAGNITUDES)


@kernel
def take_losses(
    cells: NDArray[np.int8],  # (COLUMNS, 64) in, out
    kept: NDArray[np.uint64],  # (COLUMNS,) cells that stay as they are
    count: int,  # of `scratch.steps`
    scratch: FadeScratch,
) -> None:
    """Take from each cell of a brick the loss of its magnitude."""
    steps, magnitudes, losses, loss_words = scratch
    for column in range(cells.shape[0]):
        keep = kept[column]
        if keep == WHOLE:
            continue
        # The loss of a magnitude is the number of steps that it reaches.
        for z in range(64):
            value = cells[column, z]
            magnitudes[z] = np.uint8(value if value >= 0 else -value)
            losses[z] = np.uint8(0)
        for n in range(count):
            for z in range(64):
                losses[z] += np.uint8(magnitudes[z] >= steps[n])
        # None for the cells that stay, eight at a time.
        for k in range(8 if keep != 0 else 0):
            bits = (keep >> np.uint64(8 * k)) & BYTE
            # All ones in the bytes that stay.
            spread = ((((bits * B01) & DIAGONAL) + B7F) >> np.uint64(7)) & B01
            loss_words[k] &= ~(spread * BYTE)
        for z in range(64):
            value, loss = cells[column, z], np.int8(losses[z])
            cells[column, z] = np.int8(value - loss if value >= 0 else value + loss)


@kernel
def fade_brick(
    cells: NDArray[np.int8],  # (COLUMNS, 64)
    fresh: NDArray[np.uint64],  # (COLUMNS,) left by the first tick; zero after
    settled: NDArray[np.uint64],  # (COLUMNS,)
    tick: int,
    until: int,
    losses: NDArray[np.uint64],
    count: int,  # of `scratch.steps`, those of these ticks
    scratch: FadeScratch,
) -> tuple[bool, bool, int]:
    """Bring a brick from one tick to another.

    Returns:
        Whether a state changed, whether any cell may be known, and the next tick at which a state
        can change.
    """
    smallest = least_magnitude(cells, int(np.int64(1)))  # a plain 1 would be compiled for itself
    steps = scratch.steps
    gone = int(np.int64(0))  # greatest magnitude that decays to nothing
    while gone < count and steps[gone] == gone + 1:
        gone += 1
    turned, least = smallest <= gone, smallest
    # When the next state changes: the least magnitude left goes first, also of cells spared now.
    if turned:
        least = least_magnitude(cells, gone + 1)
    if least < MAGNITUDES:
        least, _ = fade(least, tick, until, losses)
    kept = np.uint64(0)
    for column in range(fresh.shape[0]):
        kept |= fresh[column]
    if turned and kept != 0:
        least = min(least, smallest)
    take_losses(cells, fresh, count, scratch)
    for column in range(fresh.shape[0]):
        settled[column] &= fresh[column]
        fresh[column] = 0
    alive, due = least < MAGNITUDES, until + HORIZON
    if alive:
        due = fade(least, until, due, losses)[1]
    return turned, alive, due


@kernel
def fade_bricks(
    slots: NDArray[np.int64],  # (k,)
    now: int,  # tick
    to_now: bool,  # else only what is due
    bricks: BrickArrays,  # in, out
    losses: NDArray[np.uint64],  # (128,)
    faded: FadedBricks,  # out
    scratch: FadeScratch,
) -> None:
    """Bring bricks up to date, at least to the last tick at which one of their states changes.

    Most have seen the same ticks, so the losses of these are listed once for all of them.
    """
    cells, _, fresh, settled, _, ticks, dues, _, _ = bricks
    turned, alive = faded
    listed_from = listed_until = int(np.int64(-1))
    count = int(np.int64(0))
    for i in range(slots.shape[0]):
        slot = slots[i]
        turned[i], alive[i] = False, True
        while dues[slot] <= now or (to_now and ticks[slot] < now):
            tick, until = ticks[slot], min(dues[slot], now)
            if tick != listed_from or until != listed_until:
                count = list_losses(tick, until, losses, scratch.steps)
                listed_from, listed_until = tick, until
            changed, alive[i], dues[slot] = fade_brick(
                cells[slot],
                fresh[slot],
                settled[slot],
                tick,
                until,
                losses,
                count,
                scratch,
            )
            ticks[slot] = until
            turned[i] |= changed
            if not alive[i]:  # nothing is left to fade, however many ticks are to come
                ticks[slot], dues[slot] = now, now + HORIZON
