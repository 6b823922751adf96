"""Compiled kernels of a map's version: the digest of each brick.

All kernels that call each other live in this file because a cached kernel is not recompiled when
another file changes.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from maps._jit import inlined, kernel

SEEDS = np.array([0x9E3779B97F4A7C15 * k % 2**64 for k in range(1, 9)], np.uint64)
FACTOR = np.uint64(0xD6E8FEB86659FD93)  # odd, so that multiplying by it loses nothing

BLOCK = 16  # words of a message
ROUNDS = 12
INITIAL = np.array(
    [
        0x6A09E667F3BCC908,
        0xBB67AE8584CAA73B,
        0x3C6EF372FE94F82B,
        0xA54FF53A5F1D36F1,
        0x510E527FADE682D1,
        0x9B05688C2B3E6C1F,
        0x1F83D9ABFB41BD6B,
        0x5BE0CD19137E2179,
    ],
    np.uint64,
)
PARAMETERS = np.uint64(0x01010010)  # no key, 16 bytes of digest
FULL = np.uint64(0xFFFFFFFFFFFFFFFF)
SCHEDULE = np.array(
    [
        [0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15],
        [14, 10, 4, 8, 9, 15, 13, 6, 1, 12, 0, 2, 11, 7, 5, 3],
        [11, 8, 12, 0, 5, 2, 15, 13, 10, 14, 3, 6, 7, 1, 9, 4],
        [7, 9, 3, 1, 13, 12, 11, 14, 2, 6, 5, 10, 4, 0, 15, 8],
        [9, 0, 5, 7, 2, 4, 10, 15, 14, 1, 11, 12, 6, 8, 3, 13],
        [2, 12, 6, 10, 0, 11, 8, 3, 4, 13, 7, 5, 15, 14, 1, 9],
        [12, 5, 1, 15, 14, 13, 4, 10, 0, 7, 6, 3, 9, 2, 8, 11],
        [13, 11, 7, 14, 12, 1, 3, 9, 5, 0, 15, 4, 8, 6, 2, 10],
        [6, 15, 14, 9, 11, 3, 0, 8, 12, 2, 13, 7, 1, 4, 10, 5],
        [10, 2, 8, 4, 7, 6, 1, 5, 15, 11, 9, 14, 3, 12, 13, 0],
    ]
)

RECORD_BYTES = 84  # three of 4 for a brick's index, 8 for its ticks, eight of 8 for its lanes
HALF = np.uint64(32)
LOW_HALF = np.uint64(0xFFFFFFFF)


@inlined
def rotated(word: np.uint64, bits: int) -> np.uint64:
    """A word turned to the right."""
    return (word >> np.uint64(bits)) | (word << np.uint64(64 - bits))


@inlined
def mix(v: NDArray[np.uint64], a: int, b: int, c: int, d: int, x: np.uint64, y: np.uint64) -> None:
    """Mix two words of a message into four of the state."""
    v[a] += v[b] + x
    v[d] = rotated(v[d] ^ v[a], 32)
    v[c] += v[d]
    v[b] = rotated(v[b] ^ v[c], 24)
    v[a] += v[b] + y
    v[d] = rotated(v[d] ^ v[a], 16)
    v[c] += v[d]
    v[b] = rotated(v[b] ^ v[c], 63)


@kernel
def digest(
    message: NDArray[np.uint64],  # (BLOCK,) little-endian, zero beyond its length
    length: int,  # bytes, at most 128
    v: NDArray[np.uint64],  # (BLOCK,) scratch
) -> tuple[np.uint64, np.uint64]:
    """BLAKE2b of a message of one block, 16 bytes as two words (RFC 7693, 3.2)."""
    for k in range(8):
        v[k] = v[k + 8] = INITIAL[k]
    v[0] ^= PARAMETERS
    v[12] ^= np.uint64(length)
    v[14] ^= FULL  # the last block
    for r in range(ROUNDS):
        order = r % 10
        for k in range(4):
            x, y = SCHEDULE[order, 2 * k], SCHEDULE[order, 2 * k + 1]
            mix(v, k, k + 4, k + 8, k + 12, message[x], message[y])
        for k in range(4):
            x, y = SCHEDULE[order, 8 + 2 * k], SCHEDULE[order, 9 + 2 * k]
            b, c, d = 4 + (k + 1) % 4, 8 + (k + 2) % 4, 12 + (k + 3) % 4
            mix(v, k, b, c, d, message[x], message[y])
    return INITIAL[0] ^ PARAMETERS ^ v[0] ^ v[8], INITIAL[1] ^ v[1] ^ v[9]


@kernel
def list_lanes(
    eights: NDArray[np.uint64],  # (slots, n, 8)
    slot: int,
    lanes: NDArray[np.uint64],  # (8,) out
) -> bool:
    """Eight 64-bit digests of a brick, of every eighth word; whether any cell is not 0.

    A lane is a chain of steps that lose nothing, so contents that differ in one word never share
    their digests; others do by a chance of 2^-64 a lane.
    """
    any_bit = np.uint64(0)
    for k in range(8):
        lanes[k] = SEEDS[k]
    for column in range(eights.shape[1]):
        for k in range(8):
            word = eights[slot, column, k]
            any_bit |= word
            mixed = (lanes[k] ^ word) * FACTOR
            lanes[k] = mixed ^ (mixed >> HALF)
    return bool(any_bit != 0)


@kernel
def list_all_lanes(
    slots: NDArray[np.int64],  # (k,)
    part: tuple[int, int],
    eights: NDArray[np.uint64],  # (slots, n, 8)
    lanes: NDArray[np.uint64],  # (k, 8) out
    held: NDArray[np.bool_],  # (k,) out: whether any cell is not 0
) -> None:
    """The same of some bricks."""
    for i in range(part[0], part[1]):
        held[i] = list_lanes(eights, slots[i], lanes[i])


@kernel
def digest_bricks(
    slots: NDArray[np.int64],  # (k,)
    part: tuple[int, int],
    keys: NDArray[np.int32],  # (slots, 3)
    ticks: NDArray[np.int64],  # (slots,)
    eights: NDArray[np.uint64],  # (slots, n, 8)
    message: NDArray[np.uint64],  # (BLOCK,) scratch, zero from word 11 on
    scratch: NDArray[np.uint64],  # (BLOCK,)
    lanes: NDArray[np.uint64],  # (8,) scratch
    digests: NDArray[np.uint64],  # (k, 2) out
) -> None:
    """Digest of each brick: of its index, the ticks that it has seen and its lanes, in this order.

    0 for one of nothing but unknown cells.
    """
    for i in range(part[0], part[1]):
        slot = slots[i]
        digests[i, 0] = digests[i, 1] = np.uint64(0)
        if not list_lanes(eights, slot, lanes):
            continue
        x, y, z = np.uint64(keys[slot, 0]), np.uint64(keys[slot, 1]), np.uint64(keys[slot, 2])
        message[0] = (x & LOW_HALF) | (y << HALF)
        upper, word = z & LOW_HALF, np.uint64(ticks[slot])
        for k in range(9):  # each word lies across two of the message
            message[1 + k] = upper | (word << HALF)
            upper, word = word >> HALF, lanes[min(k, 7)]
        message[10] = upper
        digests[i, 0], digests[i, 1] = digest(message, RECORD_BYTES, scratch)
