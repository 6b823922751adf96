"""Independent streams of random numbers by seed, name and event."""

from __future__ import annotations

import hashlib

import numpy as np


def stream(seed: int, name: str, sequence: int) -> np.random.Generator:
    """Return the random numbers of one event, independent of all other draws.

    Args:
        seed: The episode's, >= 0.
        name: Purpose of the numbers, such as a sensor's name.
        sequence: Number of the event, >= 0.
    """
    # Python's own hash of a string differs from process to process.
    key = int.from_bytes(hashlib.blake2b(name.encode(), digest_size=8).digest(), "little")
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(key, sequence)))
