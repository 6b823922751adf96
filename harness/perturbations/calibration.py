"""Perturbation of the first sensor's extrinsic calibration."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import ClassVar, Literal

import numpy as np

from wayproof.harness.perturbations.displacement import Displacement
from wayproof.harness.perturbations.perturbation import Changes, Perturbation
from wayproof.models.random_streams import stream


class Calibration(Perturbation, frozen=True, tag="calibration"):
    """The first sensor is turned about a seeded axis, or shifted along it.

    Attributes:
        mode: `rotation` takes the values as degrees, `translation` as centimetres.
    """

    mode: Literal["rotation", "translation"] = "rotation"
    changes: ClassVar[Changes] = "ranges"
    values: ClassVar[tuple[float, float, float, float, float]] = (0.25, 0.5, 1.0, 2.0, 4.0)

    @property
    def unit(self) -> str:
        """Unit of the amount."""
        return "degrees" if self.mode == "rotation" else "cm"

    def affected(self, sensors: Sequence[str]) -> tuple[str, ...]:
        """Return the first sensor."""
        return tuple(sensors[:1])

    def displacement(self, seed: int) -> Displacement:
        """Return the displacement of the sensor, constant over the episode."""
        axis = stream(seed, "perturbation/calibration", 0).standard_normal(3)
        axis /= np.linalg.norm(axis)
        shift = 0.01 * self.amount if self.mode == "translation" else 0.0
        half = 0.5 * math.radians(self.amount) if self.mode == "rotation" else 0.0
        turn = np.array([math.cos(half), *(math.sin(half) * axis)])
        return Displacement(shift * axis, turn)
