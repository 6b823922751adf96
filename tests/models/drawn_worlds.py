"""Generated worlds that several tests look at, each drawn once."""

import functools

from wayproof.models.worlds import WORLDS


def drawn(name, seed, difficulty=0.5):
    return _drawn(name, seed, difficulty)


@functools.cache
def _drawn(name, seed, difficulty):
    return WORLDS[name](seed, difficulty)
