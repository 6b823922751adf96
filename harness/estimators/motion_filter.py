"""Kalman filter of the motion between sweeps: how much the prediction counts in a registration.

States the covariance of a predicted pose against the map of the last sweeps, not against the
world; see `stated_covariance` for that.
"""

from __future__ import annotations

import math

import numpy as np

from wayproof.harness.estimator_config import EstimateConfig
from wayproof.harness.estimators.matrices import inverse, product
from wayproof.models.arrays import Array

GYRO_CORRELATION_S = 10.0
"""Time for which the gyroscope's bias counts as one error of the heading, s."""

LEAST_VARIANCE = 1e-10
"""Least variance of a prediction, m^2 and rad^2."""


class MotionFilter:
    """Covariances of position, velocity and heading as they were predicted.

    The prediction step of a Kalman filter with a constant velocity whose acceleration is off by the
    accelerometer's error (Bar-Shalom, Li and Kirubarajan 2001, section 6.2), or, where feet or an
    odometry give the step, by a share of it.

    Attributes:
        velocity: (3, 3) of the velocity, m^2/s^2.
    """

    def __init__(self, config: EstimateConfig, sweep_period: float) -> None:
        """Start at rest at a known pose.

        Args:
            config: Settings.
            sweep_period: Time between two sweeps, s.
        """
        self._config = config
        wander = config.accelerometer_bias**2 * sweep_period + config.accelerometer_noise**2
        self._wander = wander  # variance of the velocity that a second adds, m^2/s^2
        turn = config.gyro_noise**2 + config.gyro_bias**2 * GYRO_CORRELATION_S
        self._turn = turn  # the same of the heading, rad^2
        self._position = LEAST_VARIANCE * np.eye(3)
        self._cross = np.zeros((3, 3))  # of position and velocity
        self.velocity = np.zeros((3, 3))
        self._heading = LEAST_VARIANCE

    def predict(self, step: Array, period: float, inertial: bool) -> None:
        """Grow over a step (3,), m; see `StatedCovariance.predict`."""
        config, eye = self._config, np.eye(3)
        if inertial:
            drift = period * (self._cross + self._cross.T) + period**2 * self.velocity
            self._position = self._position + drift
            self._cross = self._cross + period * self.velocity
            self.velocity = self.velocity + self._wander * period * eye
        else:
            share = config.motion_share**2 * step[:, None] * step[None, :]
            self._position = self._position + share + (config.leg_noise * period) ** 2 * eye
            self._cross = np.zeros((3, 3))
            self.velocity = config.leg_noise**2 * eye
        self._heading += self._turn * period

    def weight(self, variance: float) -> Array:
        """Information (4, 4) of the prediction, where that of a mean point is 1 by its variance."""
        weight = np.zeros((4, 4))
        weight[:3, :3] = variance * inverse(self._position + LEAST_VARIANCE * np.eye(3))
        weight[3, 3] = variance / self._heading
        return weight

    def update(self, information: Array, shift: Array) -> Array:
        """Take a registration into account; return the correction of the velocity, (3,) m/s.

        Args:
            information: (4, 4) of the sweep.
            shift: (3,) by which it moved the position, m.
        """
        before = self._position + LEAST_VARIANCE * np.eye(3)
        prior = inverse(before)
        after = inverse(prior + information[:3, :3])
        gain = product(self._cross.T, prior)
        self._position = after
        self._cross = product(after, gain.T)
        lost = product(product(gain, before - after), gain.T)
        self.velocity = self.velocity - lost
        self._heading = 1.0 / (1.0 / self._heading + float(information[3, 3]))
        change: Array = (gain * shift).sum(axis=1)
        return change

    def state(self) -> dict[str, Array]:
        """Return all of it."""
        return {
            "position": self._position.copy(),
            "cross": self._cross.copy(),
            "velocity": self.velocity.copy(),
            "heading": np.array(self._heading),
        }

    def restore(self, state: dict[str, Array]) -> None:
        """Continue from what `state` returned."""
        self._position = np.array(state["position"], np.float64)
        self._cross = np.array(state["cross"], np.float64)
        self.velocity = np.array(state["velocity"], np.float64)
        self._heading = float(state["heading"])

    @property
    def velocity_sigma(self) -> float:
        """Greatest standard deviation of the velocity on an axis, m/s."""
        return math.sqrt(max(0.0, *np.diag(self.velocity).tolist()))
