"""Seals of many short messages: those of hashlib, and their sums."""

import hashlib

import numpy as np
import pytest

from maps import _seal_kernels as sealing
from maps.bricks import _total


def messages_of(length, count=5):
    contents = np.zeros((count, 128), np.uint8)
    rng = np.random.default_rng(length)
    contents[:, :length] = rng.integers(0, 256, (count, length))
    return contents.view(np.uint64)


@pytest.mark.parametrize("run", [sealing.seal_messages, sealing.seal_messages.py_func])
@pytest.mark.parametrize("length", [1, 84, 128])
def test_a_seal_is_the_digest_that_hashlib_tells(run, length):
    messages = messages_of(length)
    seals = np.zeros((5, 2), np.uint64)
    with np.errstate(over="ignore"):
        run(messages, length, (1, 5), seals, np.empty(sealing.WORDS, np.uint64))
    assert seals[0].tolist() == [0, 0]
    for message, seal in zip(messages[1:], seals[1:], strict=True):
        told = hashlib.blake2b(message.tobytes()[:length], digest_size=16).digest()
        assert seal.tobytes() == told


def test_seals_are_added_as_numbers_of_128_bits():
    most = 2**64 - 1
    seals = np.array([[most, 0], [1, 0], [most, most], [5, 1 << 63]], np.uint64)
    assert _total(seals) == most + 1 + (2**128 - 1) + 5 + 2**127
    assert _total(seals[:0]) == 0
