"""Perturbation of the inertial sensors of `estimate.kind=lidar` by a constant bias."""

from __future__ import annotations

from typing import ClassVar, Literal

import numpy as np

from wayproof.harness.perturbations.inertial_bias import InertialBias
from wayproof.harness.perturbations.perturbation import Changes, Perturbation
from wayproof.models.random_streams import stream

MILLI_G = 9.81e-3
"""A thousandth of gravity, m/s^2."""


class ImuBias(Perturbation, frozen=True, tag="imu_bias"):
    """A constant bias of the accelerometer or of the gyroscope that the estimator does not expect.

    Along a seeded direction in the axes of the base; of the gyroscope about the vertical, to a
    seeded side.

    Attributes:
        mode: `accelerometer` takes the values as thousandths of gravity, `gyroscope` as mrad/s.
    """

    mode: Literal["accelerometer", "gyroscope"] = "accelerometer"
    changes: ClassVar[Changes] = "motion_sensors"
    values: ClassVar[tuple[float, float, float, float, float]] = (5.0, 10.0, 20.0, 50.0, 100.0)

    @property
    def unit(self) -> str:
        """Unit of the amount."""
        return "mg" if self.mode == "accelerometer" else "mrad/s"

    def inertial_bias(self, seed: int) -> InertialBias:
        """Return the bias, constant over the episode."""
        axis = stream(seed, "perturbation/imu_bias", 0).standard_normal(3)
        if self.mode == "gyroscope":
            return InertialBias(np.zeros(3), 1e-3 * float(np.copysign(self.amount, axis[0])))
        return InertialBias(MILLI_G * self.amount * axis / np.linalg.norm(axis), 0.0)
