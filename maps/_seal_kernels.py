"""Compiled kernel of BLAKE2b for many short messages at once.

A call of hashlib for each of some hundred bricks takes longer than all else about a version.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from maps._jit import kernel

WORDS = 16  # of 64 bits in a message's one block
SEAL_BYTES = 16

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
# Which words of the message each mix of a round takes.
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
    ],
    np.uint8,
)
ROUNDS = 12
SETTINGS = np.uint64(0x01010000 | SEAL_BYTES)  # no key, no tree
WHOLE = np.uint64(0xFFFFFFFFFFFFFFFF)


@kernel
def turned(word: np.uint64, right: int) -> np.uint64:
    """A word rotated to the right."""
    return (word >> np.uint64(right)) | (word << np.uint64(64 - right))


@kernel
def seal_messages(
    messages: NDArray[np.uint64],  # (k, WORDS) zero beyond their length
    length: int,  # bytes of each, 1 to 128
    part: tuple[int, int],  # first and one past the last to seal
    seals: NDArray[np.uint64],  # (k, 2) out, as little-endian words
    state: NDArray[np.uint64],  # (16,) scratch
) -> None:
    """BLAKE2b with a digest of 16 bytes (Saarinen & Aumasson 2015, RFC 7693) of each message."""
    for i in range(part[0], part[1]):
        for k in range(8):
            state[k] = state[k + 8] = INITIAL[k]
        state[0] ^= SETTINGS
        state[12] ^= np.uint64(length)
        state[14] ^= WHOLE  # the last block
        for step in range(8 * ROUNDS):
            n, words = step & 7, SCHEDULE[(step >> 3) % 10]
            a, skew = n & 3, n >> 2  # columns, and then diagonals
            b, c, d = 4 + ((a + skew) & 3), 8 + ((a + 2 * skew) & 3), 12 + ((a + 3 * skew) & 3)
            state[a] += state[b] + messages[i, words[2 * n]]
            state[d] = turned(state[d] ^ state[a], 32)
            state[c] += state[d]
            state[b] = turned(state[b] ^ state[c], 24)
            state[a] += state[b] + messages[i, words[2 * n + 1]]
            state[d] = turned(state[d] ^ state[a], 16)
            state[c] += state[d]
            state[b] = turned(state[b] ^ state[c], 63)
        seals[i, 0] = INITIAL[0] ^ SETTINGS ^ state[0] ^ state[8]
        seals[i, 1] = INITIAL[1] ^ state[1] ^ state[9]
