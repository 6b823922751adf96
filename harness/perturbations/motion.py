"""People walk where nobody did."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, ClassVar

from wayproof.harness.perturbations.perturbation import Perturbation

if TYPE_CHECKING:
    from wayproof.models.worlds import World

PEOPLE = 4
"""Who walk to and fro; chosen: in the warehouse one for each 5 m of the way."""


class Motion(Perturbation, frozen=True, tag="motion"):
    """Four people walk to and fro across the shortest way, at one speed.

    Who finds no way across of 2 m is left out; what moves in the world already goes on as it does.
    With a window they appear and vanish with it.
    """

    measured_in: ClassVar[str] = "m/s"
    values: ClassVar[tuple[float, float, float, float, float]] = (0.4, 0.8, 1.34, 1.6, 2.0)

    def streams(self, sensors: Sequence[str]) -> tuple[str, ...]:
        """The world, and what all sensors see of it."""
        return ("world", *(f"sensor/{name}" for name in sensors))

    def change_world(self, world: World, seed: int) -> World:
        """The world with the people in it; which ways they walk does not depend on the severity."""
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
