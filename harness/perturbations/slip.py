"""Perturbation of the floor's friction: feet slip."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, ClassVar

from wayproof.harness.perturbations.perturbation import Changes, Perturbation

if TYPE_CHECKING:
    from wayproof.models.worlds import World


class Slip(Perturbation, frozen=True, tag="slip"):
    """The floor has less friction than feet and their odometry presume.

    The amount is taken from the coefficient of friction of all floors, 0.8. A robot that flies
    does not feel it, and it cannot have a window: a scene has one friction.
    """

    changes: ClassVar[Changes] = "world"
    measured_in: ClassVar[str] = "lost friction"
    values: ClassVar[tuple[float, float, float, float, float]] = (0.2, 0.3, 0.4, 0.5, 0.6)
    windowed: ClassVar[bool] = False

    def change_world(self, world: World, seed: int) -> World:
        """Return the world with the slippery floor."""
        del seed
        return replace(world, friction=round(world.friction - self.amount, 9))

    def streams(self, sensors: Sequence[str]) -> tuple[str, ...]:
        """Return the world, and the streams that slipping changes: the pose and all sensors."""
        return ("world", "pose", *(f"sensor/{name}" for name in sensors))
