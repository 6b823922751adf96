"""Trajectories: a path, a jerk-limited profile along it that ends at rest, and a heading.

They are made in `trajectory_generation`.
"""

from __future__ import annotations

import bisect
import dataclasses
import math
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayproof.kernel_compiler import kernel
from wayproof.planners import jerk_limited
from wayproof.planners.jerk_limited import AxisLimits, Profile
from wayproof.planners.kernels.grid import Floats
from wayproof.planners.path import arc_lengths, edge_tangents, remaining, truncate

Integers = NDArray[np.int64]


@dataclass(frozen=True)
class MotionLimits:
    """Limits of the motion that a robot can follow.

    Attributes:
        speed: Along the path, m/s.
        acceleration: Along the path, in either direction, m/s^2.
        jerk: Along the path, m/s^3.
        lateral_acceleration: Speed squared times curvature, m/s^2.
        yaw_rate: Change of heading, rad/s.
        yaw_acceleration: Change of the yaw rate while it moves, rad/s^2; infinite for no limit.
        by_direction: Whether a body that has not turned into its path yet is limited in the part of
            its speed across itself alone; else in the whole of it.

    Raises:
        ValueError: If a limit is not above 0, or not finite, but that of the yaw acceleration.
    """

    speed: float
    acceleration: float
    jerk: float
    lateral_acceleration: float
    yaw_rate: float
    yaw_acceleration: float = math.inf
    by_direction: bool = False

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if name == "by_direction":
                continue
            if not 0.0 < value < math.inf and (name, value) != ("yaw_acceleration", math.inf):
                raise ValueError(f"limits.{name}: got {value}, expected above 0, finite")

    @property
    def along(self) -> AxisLimits:
        """Limits along the path."""
        return AxisLimits(self.acceleration, self.jerk)

    @property
    def yaw(self) -> AxisLimits:
        """Limits of a turn in place: the full rate is reached as soon as the full speed is."""
        share = self.yaw_rate / self.speed
        return AxisLimits(self.acceleration * share, self.jerk * share)


class TrajectorySample(NamedTuple):
    """State of a trajectory at one time; world frame."""

    position: Floats  # (3,), m
    velocity: Floats  # (3,), m/s
    speed: float  # along the path, m/s
    acceleration: float  # along the path, m/s^2
    arc_length: float  # along the path, m
    heading: float  # rad, without jumps by full turns
    yaw_rate: float  # rad/s
    at_rest: bool


class Setpoints(NamedTuple):
    """Setpoints of a controller at n times; world frame."""

    positions: Floats  # (n, 3), m
    velocities: Floats  # (n, 3), m/s
    headings: Floats  # (n,), rad, without jumps by full turns
    yaw_rates: Floats  # (n,), rad/s


@dataclass(frozen=True)
class Trajectory:
    """A path with motion of position and heading along it; ends at rest.

    Attributes:
        start_ns: Simulated time at which it begins.
        path: Shape (m, 3), m, world frame.
        motion: Arc length along the path over time, m.
        turning: Heading over time, rad.
        overshoot_m: Distance of the stop beyond the end of the requested path; `path` is longer by
            it, straight on.
    """

    start_ns: int
    path: Floats
    motion: Profile
    turning: Profile
    overshoot_m: float = 0.0

    @property
    def duration_s(self) -> float:
        """Time until position and heading are at rest, s."""
        return max(self.motion.duration, self.turning.duration)

    @property
    def stop_point(self) -> Floats:
        """Position at rest at its end, m, shape (3,)."""
        return self._locate(self.motion.end)[0]

    def at(self, time_ns: int) -> TrajectorySample:
        """Sample at a simulated time; the beginning before it, at rest after the end."""
        time = (time_ns - self.start_ns) * 1e-9
        arc_length, speed, acceleration = self.motion.at(time)
        heading, yaw_rate, _ = self.turning.at(time)
        position, tangent = self._locate(arc_length)
        return TrajectorySample(
            position=position,
            velocity=speed * tangent,
            speed=speed,
            acceleration=acceleration,
            arc_length=arc_length,
            heading=heading,
            yaw_rate=yaw_rate,
            at_rest=time >= self.duration_s or self.duration_s == 0.0,
        )

    def setpoints(self, times_ns: Integers) -> Setpoints:
        """Return setpoints at simulated times (n,): position, velocity and heading of `at`."""
        times = 1e-9 * (times_ns - self.start_ns).astype(np.float64)
        arcs, speeds = self.motion.motion(times)
        headings, yaw_rates = self.turning.motion(times)
        positions, velocities = np.empty((2, len(times), 3))
        path = np.ascontiguousarray(self.path)
        locate_all(path, arc_lengths(path), self._tangents, arcs, speeds, positions, velocities)
        return Setpoints(positions, velocities, headings, yaw_rates)

    def facing(self, heading: float) -> Trajectory:
        """Return the same motion at a constant heading, rad."""
        return dataclasses.replace(self, turning=jerk_limited.at_rest(heading))

    def path_after(self, elapsed: float) -> Floats:
        """Return the rest of the path after a time, s, up to the stop, shape (n, 3), m."""
        begun = float(self.motion.at(elapsed)[0])
        return truncate(remaining(self.path, begun), self.motion.end - begun)

    def poses(self, step: float, elapsed: float = 0.0, *, corners: bool = False) -> Floats:
        """Return poses (x, y, z, heading) up to rest, shape (n, 4).

        Args:
            step: Time between them, s.
            elapsed: Time that has passed; the first pose is that of the last step before it, s.
            corners: Whether the path's points between two steps are poses as well, so that straight
                lines from pose to pose are the path.
        """
        times = np.append(step * np.arange(math.ceil(self.duration_s / step)), self.duration_s)
        times = times[min(int(max(elapsed, 0.0) / step), len(times) - 1) :]
        arcs, headings = self.motion.positions(times), self.turning.positions(times)
        if corners:
            arcs, headings = self._with_corners(arcs, headings)
        points = [np.interp(arcs, self._arcs, axis) for axis in self.path.T]
        return np.column_stack((*points, headings))

    def _with_corners(self, arcs: Floats, headings: Floats) -> tuple[Floats, Floats]:
        """Insert the path's points between arc lengths (n,), with headings (n,) between theirs."""
        corners = np.array(self._arcs)
        corners = corners[(arcs[0] < corners) & (corners < arcs[-1])]
        at = np.searchsorted(arcs, corners)
        return np.insert(arcs, at, corners), np.insert(
            headings, at, np.interp(corners, arcs, headings)
        )

    @cached_property
    def _arcs(self) -> list[float]:
        arcs: list[float] = arc_lengths(self.path).tolist()
        return arcs

    @cached_property
    def _tangents(self) -> Floats:
        return edge_tangents(self.path) if len(self.path) > 1 else np.zeros((1, 3))

    def _locate(self, arc_length: float) -> tuple[Floats, Floats]:
        """Return the point and unit tangent at an arc length, each shape (3,)."""
        edge = bisect.bisect_right(self._arcs, arc_length, 1, max(len(self._arcs) - 1, 1)) - 1
        tangent = self._tangents[edge]
        along = min(max(arc_length, 0.0), self._arcs[-1]) - self._arcs[edge]
        return self.path[edge] + along * tangent, tangent


@kernel
def locate_all(
    path: Floats,  # (m, 3)
    begins: Floats,  # (m,) arc length at each point
    tangents: Floats,  # (m - 1, 3), of a single point (1, 3)
    arcs: Floats,  # (n,)
    speeds: Floats,  # (n,)
    positions: Floats,  # (n, 3) out
    velocities: Floats,  # (n, 3) out
) -> None:
    """Locate positions and velocities at arc lengths: the quicker, the more these ascend."""
    edge = 0
    for n in range(len(arcs)):
        while edge > 0 and begins[edge] > arcs[n]:
            edge -= 1
        while edge + 2 < len(begins) and begins[edge + 1] <= arcs[n]:
            edge += 1
        along = min(max(arcs[n], 0.0), begins[-1]) - begins[edge]
        for i in range(3):
            positions[n, i] = path[edge, i] + along * tangents[edge, i]
            velocities[n, i] = speeds[n] * tangents[edge, i]
