"""Error of wheel odometry beyond its stated one, by the corrections of registered scans.

Wheels that slip, are pushed, or count back as ahead err by as much as the robot moves, for seconds.
Scans that are registered see it. Once they no longer are, the prediction is believed to be off as
fast as it was of late: by the mean of its errors all along, and by what they scatter as a walk.
"""

from __future__ import annotations

import math

import numpy as np

from wayproof.harness.estimator_config import EstimateConfig
from wayproof.models.arrays import Array
from wayproof.models.snapshot import Kept

NEWS = 0.3
"""Weight of the last correction in the mean of them: three scans of five in a second count."""

FADING = 0.95
"""Share of the error's speed that is believed a scan later while none is registered: wheels
slip for seconds."""

SCAN_SIGMAS = np.array([0.02, 0.01])
"""Standard deviation of a scan's correction by the scan, m and rad: a line's points scatter up to
0.03 m, some tens of them hold the pose."""

EVIDENCE = 3.0
"""Standard deviations, of wheels as stated and scan, from which a correction shows more error."""

LEAST_PERIOD = 1e-3
"""Least time since the last registered scan that counts, s."""


class Slip(Kept):
    """Error of an odometry beyond its noise, and how far it has come since a scan was registered.

    Attributes:
        mean: (3,) of its velocity along and across the body, m/s, and of its turn, rad/s.
        scatter: (2,) mean squares of what is left of these, m^2/s^2 and rad^2/s^2.
    """

    KEPT = ("mean", "scatter", "_believed", "_way", "_time", "_turned", "_slid", "_walked")

    def __init__(self, config: EstimateConfig) -> None:
        """Start with an odometry that errs as it states."""
        self._config = config
        self.mean, self.scatter = np.zeros(3), np.zeros(2)
        self._believed = 1.0
        self.begin()

    def begin(self) -> None:
        """Take the present pose as that of the map."""
        self._way = 0.0  # since then, as the odometry has it, m
        self._time = 0.0  # since then, s
        self._turned = 0.0  # variance of the heading by the noise since then, rad^2
        self._slid, self._walked = np.zeros(2), np.zeros(2)  # m and rad, m^2 and rad^2

    def predict(self, step: Array, period: float, turn_variance: float) -> tuple[Array, Array]:
        """Go on by a step; return by how much the error grows beyond the noise.

        Args:
            step: (3,) by the odometry, m.
            period: Its time, s.
            turn_variance: Variance of the heading that it adds by its noise, rad^2.

        Returns:
            Standard deviations (2,), m and rad, that all add up, and variances (2,), m^2 and rad^2.
        """
        self._way += math.sqrt(float((step * step).sum()))
        self._time += period
        self._turned += turn_variance
        slid = self._believed * period * _sizes(self.mean)
        walked = (self._believed * period) ** 2 * self.scatter
        self._slid, self._walked = self._slid + slid, self._walked + walked
        self._believed *= FADING
        return slid, walked

    @property
    def reach(self) -> tuple[float, float]:
        """Two standard deviations of the prediction against the map, m and rad."""
        along, turn = np.sqrt(self._noise + self._walked + self._slid**2).tolist()
        return 2.0 * along, 2.0 * turn

    def correct(self, correction: Array, heading: float) -> None:
        """Learn from a registered scan's correction (4,), m and rad, and begin again after it.

        Args:
            correction: Correction by the scan, in world axes.
            heading: Heading of the body, rad.
        """
        x, y, _, turn = correction.tolist()
        c, s = math.cos(heading), math.sin(heading)
        off = np.array([c * x + s * y, c * y - s * x, turn])
        expected = EVIDENCE * np.sqrt(self._noise + SCAN_SIGMAS**2)
        seen = _sizes(off) > expected
        off = np.where(seen[[0, 0, 1]], off, 0.0) / max(self._time, LEAST_PERIOD)
        left = _sizes(off - self.mean)
        self.scatter = self.scatter + NEWS * (left**2 - self.scatter)
        self.mean = self.mean + NEWS * (off - self.mean)
        self._believed = 1.0
        self.begin()

    @property
    def _noise(self) -> Array:
        """Variances (2,) by the noise of the odometry, m^2 and rad^2."""
        share, walk = self._config.motion_share, self._config.motion_walk
        return np.array([(share * self._way) ** 2 + walk**2 * self._way, self._turned])


def _sizes(motion: Array) -> Array:
    """Return the length of a shift and size of a turn (2,), of both as (3,)."""
    x, y, turn = motion.tolist()
    return np.array([math.sqrt(x * x + y * y), abs(turn)])
