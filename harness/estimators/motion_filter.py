"""Kalman filter of the motion between sweeps: how much the prediction counts in a registration.

States the covariance of a predicted pose against the map of the last sweeps, not against the
world; see `stated_covariance` for that.
"""

from __future__ import annotations

import numpy as np

from wayproof.harness.estimator_config import EstimateConfig
from wayproof.harness.estimators.matrices import inverse, product
from wayproof.models.arrays import Array
from wayproof.models.snapshot import Kept

GYRO_CORRELATION_S = 10.0
"""Time for which the gyroscope's bias counts as one error of the heading, s."""

BIAS_CORRELATION_S = 1000.0
"""Time after which the accelerometer's bias may be another by its standard deviation, s."""

LEG_CORRELATION_S = 0.1
"""Time for which the velocity by the feet is off by one error, s: feet roll and sink while they
stand. As noise of each measurement it left the body a millimetre too high."""

LEAST_VARIANCE = 1e-10
"""Least variance of a prediction, m^2 and rad^2."""

LEAST_INFORMATION = 1e-3
"""Information of a direction that a sweep does not hold, 1/m^2, in place of none."""

POSITION, VELOCITY, BIAS = slice(0, 3), slice(3, 6), slice(6, 9)
"""Rows of the covariance; the bias is that of the accelerometer, in the axes of the base."""

BEYOND = slice(3, 9)
"""Rows that no sweep measures: velocity and bias."""


class MotionFilter(Kept):
    """Covariances of position, velocity, the accelerometer's bias, and heading as predicted.

    The bias is a state beside the velocity (Xu et al. 2022, T-RO 38, "FAST-LIO2"). As noise of the
    velocity it would leave the estimate behind the truth, all the time and to one side: by
    millimetres in a room, by centimetres where sweeps are noisy and count little. Where feet or an
    odometry give the step, its error is a share of it.
    """

    KEPT = ("_covariance", "_heading", "_axes")

    def __init__(self, config: EstimateConfig) -> None:
        """Start at rest at a known pose, with a bias of the standard deviation of `config`."""
        self._config = config
        turn = config.gyro_noise**2 + config.gyro_bias**2 * GYRO_CORRELATION_S
        self._turn = turn  # variance of the heading that a second adds, rad^2
        bias = config.accelerometer_bias**2
        self._wander = bias / BIAS_CORRELATION_S  # the same of the bias, m^2/s^4
        self._covariance = np.diag([LEAST_VARIANCE] * 3 + [0.0] * 3 + [bias] * 3)
        self._heading = LEAST_VARIANCE
        self._axes = np.eye(3)  # T_world_base of the accelerometer when it last predicted

    def predict(
        self,
        step: Array,
        period: float,
        axes: Array | None,
        turn_variance: float = 0.0,
        astray: tuple[Array, Array] | None = None,
    ) -> Array:
        """Grow over a step; return by how much that of the position did, (3, 3) m^2.

        Args:
            step: (3,) m.
            period: Its time, s.
            axes: (3, 3) rotation T_world_base of the accelerometer that predicted it; none if
                feet or an odometry did.
            turn_variance: Variance of the heading that the odometry's step adds, rad^2.
            astray: Further growth of its error, as of `Slip.predict`.
        """
        before = self._covariance[POSITION, POSITION]
        if axes is None:
            self._covariance = self._by_step(step, period)
        else:
            self._covariance, self._axes = self._fallen(period, axes), axes
        self._heading += self._turn * period + turn_variance
        if astray is not None:
            along, turn = (astray[0] ** 2 + astray[1]).tolist()
            self._covariance[POSITION, POSITION] += along * np.eye(3)
            self._heading += turn
        return self._covariance[POSITION, POSITION] - before

    def weight(self, variance: float) -> Array:
        """Return the information (4, 4) of the prediction, in units of a mean point's."""
        weight = np.zeros((4, 4))
        weight[:3, :3] = variance * inverse(self._position)
        weight[3, 3] = variance / self._heading
        return weight

    def decorrelate(self, directions: Array) -> None:
        """Take the position along unit directions (k, 3) as independent of velocity and bias.

        To be called before the update by a sweep that holds them where the one before did not. Part
        of the map that it is held by may have been placed by this same prediction: that it agrees
        says nothing of the velocity, which the next sweeps measure.
        """
        for axis in directions:
            along = axis[:, None] * axis
            alone = (along * self._covariance[POSITION, POSITION]).sum()
            rest = np.eye(9)
            rest[POSITION, POSITION] -= along
            self._covariance = product(product(rest, self._covariance), rest.T)
            self._covariance[POSITION, POSITION] += alone * along

    def update(self, information: Array, shift: Array, unheld: Array) -> Array:
        """Take a registration into account; return the corrections of velocity and bias, (6,).

        What it does not hold stays as uncertain as it was, as considered states do (Schmidt 1966,
        Advances in Control Systems 3): the direction of a tunnel is found again with each sweep,
        some hundredths of a radian off, and its walls would seem to measure the way along it.

        Args:
            information: (4, 4) of the sweep; zero along `unheld`.
            shift: (3,) by which it moved the position, m.
            unheld: (k, 3) unit directions that the sweep does not hold.
        """
        self._heading = 1.0 / (1.0 / self._heading + float(information[3, 3]))
        if len(unheld):
            return self._update_held(information[:3, :3], shift, unheld)
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
        change: Array = (gain * shift).sum(axis=1)
        return change

    @property
    def covariance(self) -> Array:
        """(9, 9) of position, m, velocity, m/s, and bias, m/s^2."""
        return self._covariance.copy()

    @property
    def _position(self) -> Array:
        position: Array = self._covariance[POSITION, POSITION] + LEAST_VARIANCE * np.eye(3)
        return position

    def _update_held(self, information: Array, shift: Array, unheld: Array) -> Array:
        """Update by a sweep that holds the pose along some axes only; `information` is (3, 3)."""
        held, kept = np.eye(3), np.eye(9)
        for axis in unheld:
            held = held - axis[:, None] * axis
            for rows, along in ((POSITION, axis), (VELOCITY, axis), (BIAS, self._in_base(axis))):
                kept[rows, rows] -= along[:, None] * along
        before = self._covariance
        noise = inverse(information + LEAST_INFORMATION * np.eye(3))
        seen = product(before[:, POSITION], held)  # (9, 3), with what is measured
        gain = product(kept, product(seen, inverse(product(held, seen[POSITION]) + noise)))
        rest = np.eye(9)
        rest[:, POSITION] -= product(gain, held)
        stays = product(product(rest, before), rest.T)
        self._covariance = stays + product(product(gain, noise), gain.T)
        along = product(unheld.T, unheld)
        prior = inverse(product(held, seen[POSITION]) + along + LEAST_VARIANCE * np.eye(3))
        gained = (product(held, prior) * (held * shift).sum(axis=1)).sum(axis=1)
        change: Array = (product(kept, seen)[BEYOND] * gained).sum(axis=1)
        return change

    def _in_base(self, axis: Array) -> Array:
        """Return a direction (3,) of the world in the axes of the base."""
        turned: Array = (self._axes.T * axis).sum(axis=1)
        return turned

    def _fallen(self, period: float, axes: Array) -> Array:
        """Return the covariance (9, 9) after a period by the accelerometer alone."""
        moves = np.eye(9)
        moves[POSITION, VELOCITY] = period * np.eye(3)
        moves[POSITION, BIAS] = -0.5 * period**2 * axes
        moves[VELOCITY, BIAS] = -period * axes
        grown = product(product(moves, self._covariance), moves.T)
        noise = [0.0] * 3 + [self._config.accelerometer_noise**2] * 3 + [self._wander] * 3
        return grown + period * np.diag(noise)

    def _by_step(self, step: Array, period: float) -> Array:
        """Return the covariance (9, 9) after a step (3,), m, that feet or an odometry gave."""
        config, eye = self._config, np.eye(3)
        grown = np.zeros((9, 9))
        share = config.motion_share**2 * step[:, None] * step[None, :]
        noise = config.leg_noise**2 * period * max(period, LEG_CORRELATION_S) * eye
        grown[POSITION, POSITION] = self._covariance[POSITION, POSITION] + share + noise
        grown[VELOCITY, VELOCITY] = config.leg_noise**2 * eye
        grown[BIAS, BIAS] = self._covariance[BIAS, BIAS]
        return grown
