"""Kalman filter of the motion between sweeps: how much the prediction counts in a registration.

States the covariance of a predicted pose against the map of the last sweeps, not against the
world; see `stated_covariance` for that.
"""

from __future__ import annotations

import numpy as np

from wayproof.harness.estimator_config import EstimateConfig
from wayproof.harness.estimators.matrices import inverse, product
from wayproof.models.arrays import Array

GYRO_CORRELATION_S = 10.0
"""Time for which the gyroscope's bias counts as one error of the heading, s."""

BIAS_CORRELATION_S = 1000.0
"""Time after which the accelerometer's bias may be another by its standard deviation, s."""

LEAST_VARIANCE = 1e-10
"""Least variance of a prediction, m^2 and rad^2."""

POSITION, VELOCITY, BIAS = slice(0, 3), slice(3, 6), slice(6, 9)
"""Rows of the covariance; the bias is that of the accelerometer, in the axes of the base."""

BEYOND = slice(3, 9)
"""Rows that no sweep measures: velocity and bias."""


class MotionFilter:
    """Covariances of position, velocity, the accelerometer's bias, and heading as predicted.

    The bias is a state beside the velocity (Xu et al. 2022, T-RO 38, "FAST-LIO2"). As noise of the
    velocity it would leave the estimate behind the truth, all the time and to one side: by
    millimetres in a room, by centimetres where sweeps are noisy and count little. Where feet or an
    odometry give the step, its error is a share of it.
    """

    def __init__(self, config: EstimateConfig) -> None:
        """Start at rest at a known pose, with a bias of the standard deviation of `config`."""
        self._config = config
        turn = config.gyro_noise**2 + config.gyro_bias**2 * GYRO_CORRELATION_S
        self._turn = turn  # variance of the heading that a second adds, rad^2
        bias = config.accelerometer_bias**2
        self._wander = bias / BIAS_CORRELATION_S  # the same of the bias, m^2/s^4
        self._covariance = np.diag([LEAST_VARIANCE] * 3 + [0.0] * 3 + [bias] * 3)
        self._heading = LEAST_VARIANCE

    def predict(self, step: Array, period: float, axes: Array | None) -> Array:
        """Grow over a step; return by how much that of the position did, (3, 3) m^2.

        Args:
            step: (3,) m.
            period: Its time, s.
            axes: (3, 3) rotation T_world_base of the accelerometer that predicted it; none if
                feet or an odometry did.
        """
        before = self._covariance[POSITION, POSITION]
        by_step = axes is None
        self._covariance = self._by_step(step, period) if by_step else self._fallen(period, axes)
        self._heading += self._turn * period
        return self._covariance[POSITION, POSITION] - before

    def weight(self, variance: float) -> Array:
        """Information (4, 4) of the prediction, where that of a mean point is 1 by its variance."""
        weight = np.zeros((4, 4))
        weight[:3, :3] = variance * inverse(self._position)
        weight[3, 3] = variance / self._heading
        return weight

    def update(self, information: Array, shift: Array) -> Array:
        """Take a registration into account; return the corrections of velocity and bias, (6,).

        Args:
            information: (4, 4) of the sweep.
            shift: (3,) by which it moved the position, m.
        """
        before = self._position
        prior = inverse(before)
        after = inverse(prior + information[:3, :3])
        gain = product(self._covariance[BEYOND, POSITION], prior)
        lost = product(product(gain, before - after), gain.T)
        cross = product(gain, after)
        updated = np.empty((9, 9))
        updated[POSITION, POSITION] = after
        updated[BEYOND, POSITION], updated[POSITION, BEYOND] = cross, cross.T
        updated[BEYOND, BEYOND] = self._covariance[BEYOND, BEYOND] - lost
        self._covariance = updated
        self._heading = 1.0 / (1.0 / self._heading + float(information[3, 3]))
        change: Array = (gain * shift).sum(axis=1)
        return change

    def state(self) -> dict[str, Array]:
        """Return all of it."""
        return {"covariance": self._covariance.copy(), "heading": np.array(self._heading)}

    def restore(self, state: dict[str, Array]) -> None:
        """Continue from what `state` returned."""
        self._covariance = np.array(state["covariance"], np.float64)
        self._heading = float(state["heading"])

    @property
    def covariance(self) -> Array:
        """(9, 9) of position, m, velocity, m/s, and bias, m/s^2."""
        return self._covariance.copy()

    @property
    def _position(self) -> Array:
        position: Array = self._covariance[POSITION, POSITION] + LEAST_VARIANCE * np.eye(3)
        return position

    def _fallen(self, period: float, axes: Array) -> Array:
        """Covariance (9, 9) after a period by the accelerometer alone."""
        moves = np.eye(9)
        moves[POSITION, VELOCITY] = period * np.eye(3)
        moves[POSITION, BIAS] = -0.5 * period**2 * axes
        moves[VELOCITY, BIAS] = -period * axes
        grown = product(product(moves, self._covariance), moves.T)
        noise = [0.0] * 3 + [self._config.accelerometer_noise**2] * 3 + [self._wander] * 3
        return grown + period * np.diag(noise)

    def _by_step(self, step: Array, period: float) -> Array:
        """Covariance (9, 9) after a step (3,), m, that feet or an odometry gave."""
        config, eye = self._config, np.eye(3)
        grown = np.zeros((9, 9))
        share = config.motion_share**2 * step[:, None] * step[None, :]
        noise = (config.leg_noise * period) ** 2 * eye
        grown[POSITION, POSITION] = self._covariance[POSITION, POSITION] + share + noise
        grown[VELOCITY, VELOCITY] = config.leg_noise**2 * eye
        grown[BIAS, BIAS] = self._covariance[BIAS, BIAS]
        return grown
