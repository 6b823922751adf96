"""Generators of worlds by their drafts."""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from wayproof.models.world_parameters import WorldParameters
from wayproof.models.worlds.solvability import AIR_BANDS, GROUND_BAND, is_solvable, passage_radius
from wayproof.models.worlds.world import World

Draft = Callable[[np.random.Generator, float, WorldParameters], World]
"""Draws one world, by random numbers, a difficulty and the parameters of worlds."""

ATTEMPTS = 100


def generated(draft: Draft) -> Callable[..., World]:
    """Return the generator of a world of the draft's name.

    It takes a seed, a difficulty from 0 to 1 (0.5) and the parameters of worlds, and draws drafts
    from sub-seeds of seed and name until bodies of the passage's radius can pass, on the ground and
    in one band of altitudes. It raises a ValueError for a negative seed or another difficulty, and
    a RuntimeError where no draft was solvable.
    """
    name = draft.__name__

    @functools.wraps(draft)
    def generate(
        seed: int,
        difficulty: float = 0.5,
        parameters: WorldParameters = WorldParameters(),  # noqa: B008  # frozen
    ) -> World:
        if seed < 0:
            raise ValueError(f"seed: got {seed}, expected 0 or more")
        if not 0.0 <= difficulty <= 1.0:
            raise ValueError(f"difficulty: got {difficulty}, expected 0 to 1")
        radius = parameters.passage_radius
        radius = passage_radius(difficulty) if radius is None else radius
        for attempt in range(ATTEMPTS):
            rng = np.random.default_rng([seed, attempt, *name.encode()])
            world = draft(rng, difficulty, parameters)
            ends = (world.start, world.goal)
            if is_solvable(world, radius, GROUND_BAND, *ends) and any(
                is_solvable(world, radius, band, *ends) for band in AIR_BANDS
            ):
                world = replace(world, name=name, seed=seed, difficulty=difficulty)
                return replace(world, passage_radius=radius)
        raise RuntimeError(
            f"world {name!r}, seed {seed}: none of {ATTEMPTS} drafts lets a disc of {radius:g} m "
            "through"
        )

    return generate
