"""Covariance that a lidar odometry states: a walk, and all motion that the scene did not hold.

The inverse of the normal equations says nothing of the error: residuals of neighbouring beams are
one error, and the drift is the map's. So the covariance follows from the way: a random walk whose
rate is calibrated from logs with truth, and along each direction that the sweeps do not hold a
share of the whole predicted motion since they last did. Where only an accelerometer predicts, its
bias and the velocity that it starts from count, too: the estimate of a body at rest drifts.
"""

from __future__ import annotations

import math

import numpy as np

from wayproof.harness.estimator_config import EstimateConfig
from wayproof.harness.estimators.registration import Registration
from wayproof.models.arrays import Array


class StatedCovariance:
    """Covariance of position, (3, 3) m^2, and variance of the heading, rad^2.

    Attributes:
        axes: (k, 3) unit directions that the last sweep did not hold.
        information: (3,) of the last registration.
    """

    def __init__(self, config: EstimateConfig, sweep_period: float) -> None:
        """Start at a known pose.

        Args:
            config: Settings.
            sweep_period: Time between two sweeps, of whose positions the velocity is made, s.
        """
        self._config = config
        self._velocity_sigma = config.position_floor / sweep_period
        self._walked = np.zeros((3, 3))  # of the walk, and of unheld motion that has ended
        self._heading = 0.0
        self._moved = np.zeros(3)  # predicted motion since the sweeps held all of it
        self._inertial_s = 0.0  # time since then for which only the accelerometer predicted
        self._lost_s = 0.0  # time since a sweep was registered
        self.axes = np.zeros((0, 3))
        self.information = np.zeros(3)

    def predict(self, step: Array, period: float, inertial: bool) -> None:
        """Grow over a predicted step.

        Args:
            step: (3,) m.
            period: Its time, s.
            inertial: Whether the accelerometer predicted it, not the feet.
        """
        config = self._config
        distance = math.sqrt(float((step * step).sum()))
        self._walked = self._walked + config.position_walk**2 * distance * np.eye(3)
        self._heading += config.heading_walk**2 * distance
        self._moved = self._moved + self._unheld(step)
        if inertial and len(self.axes):
            before = self._drift(self._inertial_s)
            self._inertial_s += period
            grown = self._drift(self._inertial_s) ** 2 - before**2
            for axis in self.axes:
                self._walked = self._walked + grown * axis[:, None] * axis[None, :]
        if len(self.axes) == 3:
            before = config.gyro_bias * self._lost_s
            self._lost_s += period
            self._heading += (config.gyro_bias * self._lost_s) ** 2 - before**2
            self._heading += config.gyro_noise**2 * period

    def _drift(self, time_s: float) -> float:
        """Standard deviation of a position by the accelerometer alone after a time, m."""
        acceleration, noise = self._config.accelerometer_bias, self._config.accelerometer_noise
        wandered = noise**2 * time_s**3 / 3.0  # white noise, integrated twice
        biased = 0.5 * acceleration * time_s**2
        return math.sqrt((self._velocity_sigma * time_s) ** 2 + biased**2 + wandered)

    def correct(self, registration: Registration) -> None:
        """Take over which directions the sweep held: their unheld motion has ended."""
        self.axes, self.information = registration.unheld, registration.information
        ended = self._moved - self._unheld(self._moved)
        self._walked = self._walked + self._share(ended)
        self._moved = self._moved - ended
        if not len(self.axes):
            self._inertial_s = 0.0
        if len(self.axes) < 3:
            self._lost_s = 0.0

    @property
    def position(self) -> Array:
        """Covariance of the position, (3, 3) m^2."""
        floor = self._config.position_floor**2 * np.eye(3)
        total: Array = floor + self._walked + self._share(self._moved)
        return total

    @property
    def heading(self) -> float:
        """Variance of the heading, rad^2."""
        return self._config.heading_floor**2 + self._heading

    def state(self) -> dict[str, Array]:
        """Return all of it."""
        return {
            "walked": self._walked.copy(),
            "heading": np.array(self._heading),
            "moved": self._moved.copy(),
            "without": np.array([self._inertial_s, self._lost_s]),
            "axes": self.axes.copy(),
            "information": self.information.copy(),
        }

    def restore(self, state: dict[str, Array]) -> None:
        """Continue from what `state` returned."""
        self._walked = np.array(state["walked"], np.float64)
        self._heading = float(state["heading"])
        self._moved = np.array(state["moved"], np.float64)
        self._inertial_s, self._lost_s = state["without"].tolist()
        self.axes = np.array(state["axes"], np.float64)
        self.information = np.array(state["information"], np.float64)

    def _unheld(self, motion: Array) -> Array:
        """Part of a motion (3,) along directions that the last sweep did not hold."""
        along = np.zeros(3)
        for axis in self.axes:  # by hand: BLAS orders sums by the machine
            along = along + float((axis * motion).sum()) * axis
        return along

    def _share(self, motion: Array) -> Array:  # (3, 3)
        share: Array = self._config.motion_share**2 * motion[:, None] * motion[None, :]
        return share
