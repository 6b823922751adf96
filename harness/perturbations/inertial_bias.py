"""Bias of inertial sensors beyond the one that their estimator allows for."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray


class InertialBias(NamedTuple):
    """Constant error of an accelerometer and a gyroscope.

    Attributes:
        acceleration: (3,) base axes, m/s^2.
        turn_rate: About the vertical, rad/s.
    """

    acceleration: NDArray[np.float64]
    turn_rate: float
