"""Perturbation of the prior map: it shows another day, or lies out of place."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, ClassVar, Literal

import numpy as np

from wayproof.harness.perturbations.perturbation import Changes, Misplacement, Perturbation
from wayproof.models.random_streams import stream

if TYPE_CHECKING:
    from wayproof.models.worlds import World

LINTEL = "lintel"
"""Kind of the solids above doorways."""

REFERENCE_DISTANCE = 10.0
"""Distance from the start at which a turned map is off by the amount, m."""

UNITS = {
    "moved": "m",
    "aisle": "m",
    "doors": "share closed",
    "gone": "share missing",
    "shift": "m",
    "turn": "m at 10 m",
}
"""Unit of the amount by mode."""


class StalePrior(Perturbation, frozen=True, tag="stale_prior"):
    """The prior map is not that of the world; nothing but the map is changed.

    Attributes:
        mode: `moved` has each shelf, crate or piece of furniture stand elsewhere, `aisle` all of
            them together to one side of the robot's way, `doors` closes a share of the doorways,
            `gone` lacks a share of the things, `shift` moves the map in a seeded direction, and
            `turn` turns it about the start. A maze has no things but its inner walls.
    """

    mode: Literal["moved", "aisle", "doors", "gone", "shift", "turn"] = "moved"
    changes: ClassVar[Changes] = "prior"
    values: ClassVar[tuple[float, float, float, float, float]] = (0.1, 0.2, 0.4, 0.7, 1.0)
    windowed: ClassVar[bool] = False

    @property
    def unit(self) -> str:
        """Unit of the amount."""
        return UNITS[self.mode]

    def streams(self, sensors: Sequence[str]) -> tuple[str, ...]:
        """Return the prior map alone."""
        del sensors
        return ("prior",)

    def change_prior(self, world: World, seed: int) -> World:
        """Return the world as the prior map shows it."""
        if self.mode in ("shift", "turn"):
            return world
        if self.mode == "doors":
            return self._with_closed_doors(world, seed)
        return self._with_other_things(world, seed)

    def misplacement(self, seed: int) -> Misplacement:
        """Return the error of the map's place, the same for the whole episode."""
        rng = stream(seed, "perturbation/stale_prior", 1)
        direction, side = rng.uniform(0.0, 2.0 * math.pi), 1.0 if rng.integers(2) else -1.0
        if self.mode == "shift":
            x, y = self.amount * math.cos(direction), self.amount * math.sin(direction)
            return Misplacement(x, y, 0.0)
        if self.mode == "turn":
            return Misplacement(0.0, 0.0, side * self.amount / REFERENCE_DISTANCE)
        return Misplacement()

    def _with_closed_doors(self, world: World, seed: int) -> World:
        doors = [k for k, solid in enumerate(world.solids) if solid.kind == LINTEL]
        if not doors:
            raise ValueError("it has no doorway to close")
        from wayproof.models.worlds.solids import Box  # it loads the simulator

        order = stream(seed, "perturbation/stale_prior", 0).permutation(len(doors))
        closed = {doors[k] for k in order[: max(round(self.amount * len(doors)), 1)].tolist()}
        solids = list(world.solids)
        for k in sorted(closed):
            (x0, y0, _), (x1, y1, top) = solids[k].low, solids[k].high
            solids[k] = Box.between((x0, y0, 0.0), (x1, y1, top), LINTEL)
        return replace(world, solids=tuple(solids))

    def _with_other_things(self, world: World, seed: int) -> World:
        from wayproof.models.worlds.shifted import movable_groups, shifted  # as above

        groups = movable_groups(world.solids)
        if not groups:
            raise ValueError("it has nothing that could stand elsewhere")
        rng = stream(seed, "perturbation/stale_prior", 0)
        solids = list(world.solids)
        if self.mode == "gone":
            order = rng.permutation(len(groups))
            gone = order[: max(round(self.amount * len(groups)), 1)].tolist()
            missing = {k for group in gone for k in groups[group]}
            kept = tuple(solid for k, solid in enumerate(solids) if k not in missing)
            return replace(world, solids=kept)
        way = np.subtract(world.goal[:2], world.start[:2])
        across = math.atan2(way[1], way[0]) + (0.5 if rng.integers(2) else -0.5) * math.pi
        for group in groups:
            angle = rng.uniform(0.0, 2.0 * math.pi) if self.mode == "moved" else across
            offset = self.amount * math.cos(angle), self.amount * math.sin(angle)
            for k in group:
                solids[k] = shifted(solids[k], *offset)
        return replace(world, solids=tuple(solids))
