"""The fastest jerk-limited stop: its length, and the speeds along it."""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np

from wayproof.planners import jerk_limited
from wayproof.planners.jerk_limited import State
from wayproof.planners.kernels.grid import Floats
from wayproof.planners.trajectory import MotionLimits

STOP_SAMPLES = 64
"""Number of times at which the speed of a stop is sampled."""

REST_SPEED = 1e-9
"""Speed at which a profile that ended counts as at rest, m/s: rounding can leave it below 0."""


@lru_cache(maxsize=64)  # each decision needs the same few several times
def stopping_distance(speed: float, acceleration: float, limits: MotionLimits) -> float:
    """Return the length of the fastest jerk-limited stop, m."""
    start = feasible_state(0.0, speed, acceleration, limits)
    return jerk_limited.stop(start, limits.along).end


def stopping_speeds(
    speed: float, acceleration: float, limits: MotionLimits, arcs: Floats
) -> Floats:
    """Return the speeds (n,) of the fastest jerk-limited stop at arc lengths (n,), m/s.

    They rise at first where the robot was accelerating.
    """
    motion = jerk_limited.stop(feasible_state(0.0, speed, acceleration, limits), limits.along)
    times = np.linspace(0.0, motion.duration, STOP_SAMPLES)
    speeds: Floats = np.interp(arcs, *motion.motion(times))
    return speeds


def feasible_state(s: float, speed: float, acceleration: float, limits: MotionLimits) -> State:
    """Return a state whose deceleration can end before the speed would turn negative."""
    if not speed >= -REST_SPEED:
        raise ValueError(f"speed: got {speed}, expected 0 or more")
    speed = max(speed, 0.0)  # a profile that ends at rest can miss 0 by a rounding
    return State(s, speed, max(acceleration, -math.sqrt(2.0 * limits.jerk * speed)))
