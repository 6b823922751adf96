"""Perturbation of a static world: people who cross the robot's way."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, ClassVar

from wayproof.harness.perturbations.perturbation import Changes, Perturbation

if TYPE_CHECKING:
    from wayproof.models.worlds import World

PEOPLE = 4
"""Number of people; chosen: in the warehouse one for each 5 m of the way."""


class Motion(Perturbation, frozen=True, tag="motion"):
    """Four people walk to and fro across the shortest way, at one speed.

    A person with no way across of 2 m is left out; the movers of the world stay as they are. With a
    window they appear and vanish with it.
    """

    changes: ClassVar[Changes] = "world"
    measured_in: ClassVar[str] = "m/s"
    values: ClassVar[tuple[float, float, float, float, float]] = (0.4, 0.8, 1.34, 1.6, 2.0)

    def change_world(self, world: World, seed: int) -> World:
        """Return the world with the people in it; their ways do not depend on the severity."""
        from wayproof.models.worlds import with_traffic  # it loads the simulator

        peopled = with_traffic(world, PEOPLE, self.amount, seed)
        if len(peopled.movers) == len(world.movers):
            raise ValueError("nobody finds a way of 2 m across the robot's")
        if self.window is None:
            return peopled
        appears, vanishes = self.window
        people = [
            replace(one, appears=appears, vanishes=vanishes)
            for one in peopled.movers[len(world.movers) :]
        ]
        return replace(peopled, movers=(*world.movers, *people))
