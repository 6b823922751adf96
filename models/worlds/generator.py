"""Generators of worlds by their drafts."""

from __future__ import annotations

import functools
from collections.abc import Callable

import numpy as np

from wayproof.models.world_parameters import WorldParameters
from wayproof.models.worlds.solvability import first_solvable
from wayproof.models.worlds.world import World

Draft = Callable[[np.random.Generator, int, float, WorldParameters], World]
"""Draws one world, by a seed, a difficulty and the parameters of worlds."""


def generated(draft: Draft) -> Callable[..., World]:
    """Return the generator of a world of the draft's name.

    It takes a seed, a difficulty from 0 to 1 (0.5) and the parameters of worlds, and raises a
    ValueError or a RuntimeError as `first_solvable` does.
    """

    @functools.wraps(draft)
    def generate(
        seed: int,
        difficulty: float = 0.5,
        parameters: WorldParameters = WorldParameters(),  # noqa: B008  # frozen
    ) -> World:
        return first_solvable(
            draft.__name__,
            seed,
            lambda rng: draft(rng, seed, difficulty, parameters),
            difficulty,
            parameters.passage_radius,
        )

    return generate
