"""Compiled kernels of decay: what many ticks make of a value, and of a brick that lies in wait.

Tick n takes floor(r + u) units from a magnitude v, where r is the exact loss of v in one tick and
u = n phi mod 1 with the golden ratio phi: a rounding threshold that is spread evenly over the ticks
and is the same for all values. So the half-life holds even where a tick takes less than one unit:
between two losses of a unit lie 1 / r ticks on average, since u returns to an interval of length r
that often (Kac 1947). That is a pure function of value and tick, so a brick can be left alone and
brought up to date later. Tried: floor((n + 1) r) - floor(n r), whose phase differs from value to
value; small values then fade up to twice too fast.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from maps._jit import kernel

LOSS_BITS = 40
FRACTION = np.uint64((1 << LOSS_BITS) - 1)
GOLDEN = np.uint64(0x9E3779B97F)  # (sqrt(5) - 1) / 2, in 2^-40
NEVER = 1 << 62  # a tick
HORIZON = 1 << 12  # ticks after which a brick is looked at in any case
BYTE = np.uint64(0xFF)
EDGE_VALUES = 256
WHOLE = np.uint64(0xFFFFFFFFFFFFFFFF)
B01, B7F = np.uint64(0x0101010101010101), np.uint64(0x7F7F7F7F7F7F7F7F)
DIAGONAL = np.uint64(0x8040201008040201)  # bit k of byte k


@kernel
def fade(magnitude: int, tick: int, until: int, losses: NDArray[np.uint64]) -> tuple[int, int]:
    """Take a magnitude from one tick to another; stop early where it reaches 0.

    Args:
        magnitude: Of a log-odds, units.
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
def find_values(
    eights: NDArray[np.uint64],  # (COLUMNS, 8)
    present: NDArray[np.bool_],  # (256,) out: by the value's byte
) -> None:
    """Find the values that a brick holds; runs of equal words are looked at once."""
    for byte in range(EDGE_VALUES):
        present[byte] = False
    last = np.uint64(0)
    present[0] = True
    for column in range(eights.shape[0]):
        for k in range(8):
            word = eights[column, k]
            if word != last:
                last = word
                for _ in range(8):
                    present[word & BYTE] = True
                    word >>= np.uint64(8)


@kernel
def replace_bytes(word: np.uint64, table: NDArray[np.int8]) -> np.uint64:
    """Replace each byte of a word by its entry in a table."""
    replaced = np.uint64(0)
    for k in range(8):
        shift = np.uint64(8 * k)
        replaced |= np.uint64(np.int64(table[(word >> shift) & BYTE]) & 0xFF) << shift
    return replaced


@kernel
def replace_values(
    eights: NDArray[np.uint64],  # (COLUMNS, 8)
    kept: NDArray[np.uint64],  # (COLUMNS,) cells that stay as they are
    table: NDArray[np.int8],  # (256,) new value by the old one's byte
) -> None:
    """Replace each value of a brick by its entry in a table; runs of equal words at once."""
    last, replaced = np.uint64(0), np.uint64(0)
    for column in range(eights.shape[0]):
        keep = kept[column]
        if keep == WHOLE:
            continue
        for k in range(8):
            word, bits = eights[column, k], (keep >> np.uint64(8 * k)) & BYTE
            if word == 0 or bits == BYTE:
                continue
            if word != last:
                last, replaced = word, replace_bytes(word, table)
            # All ones in the bytes that stay.
            spread = ((((bits * B01) & DIAGONAL) + B7F) >> np.uint64(7)) & B01
            eights[column, k] = replaced ^ ((word ^ replaced) & (spread * BYTE))


@kernel
def fade_brick(
    eights: NDArray[np.uint64],  # (COLUMNS, 8)
    fresh: NDArray[np.uint64],  # (COLUMNS,) left by the first tick; zero after
    settled: NDArray[np.uint64],  # (COLUMNS,)
    tick: int,
    until: int,
    losses: NDArray[np.uint64],
    present: NDArray[np.bool_],  # (256,) scratch
    table: NDArray[np.int8],  # (256,) scratch
) -> tuple[bool, bool, int]:
    """Bring a brick from one tick to another.

    Returns:
        Whether a state changed, whether any cell may be known, and the next tick at which a state
        can change.
    """
    find_values(eights, present)
    kept = np.uint64(0)
    for column in range(fresh.shape[0]):
        kept |= fresh[column]
    turned, least = False, int(np.int64(EDGE_VALUES))
    for byte in range(EDGE_VALUES):
        value = byte if byte < 128 else byte - 256
        if not present[byte] or value == 0:
            table[byte] = 0
            continue
        left, _ = fade(abs(value), tick, until, losses)
        table[byte] = left if value > 0 else -left
        turned |= left == 0
        # What is left may pass away later, and so may what this tick spares. The least does first:
        # ticks take no more from it than from a greater one, and do not change their order.
        if left > 0:
            least = min(least, left)
        elif kept != 0:
            least = min(least, abs(value))
    replace_values(eights, fresh, table)
    for column in range(fresh.shape[0]):
        settled[column] &= fresh[column]
        fresh[column] = 0
    alive, due = least < EDGE_VALUES, until + HORIZON
    if alive:
        due = fade(least, until, due, losses)[1]
    return turned, alive, due


@kernel
def fade_bricks(
    slots: NDArray[np.int64],  # (k,)
    part: tuple[int, int],
    now: int,
    to_now: bool,  # else only what is due
    eights: NDArray[np.uint64],  # (slots, COLUMNS, 8)
    fresh: NDArray[np.uint64],  # (slots, COLUMNS)
    settled: NDArray[np.uint64],  # (slots, COLUMNS)
    ticks: NDArray[np.int64],  # (slots,) seen by each brick
    dues: NDArray[np.int64],  # (slots,) tick at which a brick has to be looked at
    losses: NDArray[np.uint64],  # (128,)
    turned: NDArray[np.bool_],  # (k,) out: whether a state changed
    alive: NDArray[np.bool_],  # (k,) out: whether any cell may be known
    present: NDArray[np.bool_],  # (256,) scratch
    table: NDArray[np.int8],  # (256,) scratch
) -> None:
    """Bring bricks up to date, at least to the last tick at which one of their states changes."""
    for i in range(part[0], part[1]):
        slot = slots[i]
        turned[i], alive[i] = False, True
        while dues[slot] <= now or (to_now and ticks[slot] < now):
            until = min(dues[slot], now)
            changed, alive[i], dues[slot] = fade_brick(
                eights[slot],
                fresh[slot],
                settled[slot],
                ticks[slot],
                until,
                losses,
                present,
                table,
            )
            ticks[slot] = until
            turned[i] |= changed
