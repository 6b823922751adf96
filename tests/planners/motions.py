"""Limits of robots, and samples of trajectories, for tests."""

import numpy as np

from wayproof.planners import MotionLimits, Trajectory

LIMITS = [
    MotionLimits(speed=1.0, acceleration=1.5, jerk=6.0, lateral_acceleration=1.0, yaw_rate=1.2),
    MotionLimits(speed=2.0, acceleration=4.0, jerk=30.0, lateral_acceleration=3.0, yaw_rate=2.0),
    MotionLimits(speed=0.5, acceleration=0.5, jerk=1.0, lateral_acceleration=0.3, yaw_rate=0.6),
]


DRONE = LIMITS[1]
LINE = np.array([[0.0, 0.0, 1.0], [10.0, 0.0, 1.0]])
MS = 1_000_000


def sampled(trajectory: Trajectory, step_ms: int = 2) -> dict[str, np.ndarray]:
    """Samples from the start to beyond the end, by field."""
    count = int(trajectory.duration_s * 1000 / step_ms) + 3
    samples = [trajectory.at(trajectory.start_ns + n * step_ms * MS) for n in range(count)]
    return {name: np.array([getattr(s, name) for s in samples]) for name in samples[0]._fields}
