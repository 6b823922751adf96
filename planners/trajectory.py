"""Trajectories: a path, a jerk-limited profile along it that ends at rest, and a heading."""

import bisect
import dataclasses
import math
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayproof.planners import jerk_limited
from wayproof.planners._jit import kernel
from wayproof.planners.jerk_limited import AxisLimits, Profile, State
from wayproof.planners.kernels.angles import edge_headings, rate_limited, wrap
from wayproof.planners.kernels.grid import Floats
from wayproof.planners.path import arc_lengths, edge_lengths, edge_tangents, speed_limits, truncate
from wayproof.planners.speed_profile import LEAST_ZONE, Zone, travel

Integers = NDArray[np.int64]

HEADING_STEP = 0.01  # [s], of headings that follow a path
# Below it a limit is not a speed to travel at: a profile would take hours.
LEAST_SPEED = 0.02  # [m/s]


@dataclass(frozen=True)
class MotionLimits:
    """What a robot can follow.

    Attributes:
        speed: Along the path [m/s].
        acceleration: Along the path, in either direction [m/s^2].
        jerk: Along the path [m/s^3].
        lateral_acceleration: Speed squared times curvature [m/s^2].
        yaw_rate: [rad/s].

    Raises:
        ValueError: If a limit is not above 0 and finite.
    """

    speed: float
    acceleration: float
    jerk: float
    lateral_acceleration: float
    yaw_rate: float

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if not 0.0 < value < math.inf:
                raise ValueError(f"limits.{name}: got {value}, expected above 0, finite")

    @property
    def along(self) -> AxisLimits:
        """Limits along the path."""
        return AxisLimits(self.acceleration, self.jerk)

    @property
    def yaw(self) -> AxisLimits:
        """Limits of a turn in place: full rate in the time that full speed takes."""
        share = self.yaw_rate / self.speed
        return AxisLimits(self.acceleration * share, self.jerk * share)


class TrajectorySample(NamedTuple):
    """Where a trajectory is at one time; world frame."""

    position: Floats  # (3,) [m]
    velocity: Floats  # (3,) [m/s]
    speed: float  # along the path [m/s]
    acceleration: float  # along the path [m/s^2]
    arc_length: float  # along the path [m]
    heading: float  # [rad], without jumps by full turns
    yaw_rate: float  # [rad/s]
    at_rest: bool


class Setpoints(NamedTuple):
    """What a controller is to follow at n times; world frame."""

    positions: Floats  # (n, 3) [m]
    velocities: Floats  # (n, 3) [m/s]
    headings: Floats  # (n,) [rad], without jumps by full turns
    yaw_rates: Floats  # (n,) [rad/s]


@dataclass(frozen=True)
class Trajectory:
    """A path and how position and heading move along it; ends at rest.

    Attributes:
        start_ns: Simulated time at which it begins.
        path: Shape (m, 3) [m], world frame.
        motion: Arc length along the path over time [m].
        turning: Heading over time [rad].
        overshoot_m: How far the stop lies beyond the end of the path that was asked for; ``path``
            is longer by that, straight on.
    """

    start_ns: int
    path: Floats
    motion: Profile
    turning: Profile
    overshoot_m: float = 0.0

    @property
    def duration_s(self) -> float:
        """Time until position and heading are at rest [s]."""
        return max(self.motion.duration, self.turning.duration)

    @property
    def stop_point(self) -> Floats:
        """Where it comes to rest [m], shape (3,)."""
        return self._locate(self.motion.end)[0]

    def at(self, time_ns: int) -> TrajectorySample:
        """Sample at a simulated time; the beginning before it, at rest after the end."""
        time = (time_ns - self.start_ns) * 1e-9
        arc_length, speed, acceleration = self.motion.at(time)
        heading, yaw_rate, _ = self.turning.at(time)
        position, tangent = self._locate(arc_length)
        return TrajectorySample(
            position,
            speed * tangent,
            speed,
            acceleration,
            arc_length,
            heading,
            yaw_rate,
            time >= self.duration_s or self.duration_s == 0.0,
        )

    def setpoints(self, times_ns: Integers) -> Setpoints:
        """What `at` tells of many simulated times, shape (n,), of what a controller follows."""
        times = 1e-9 * (times_ns - self.start_ns).astype(np.float64)
        arcs, speeds = self.motion.motion(times)
        headings, yaw_rates = self.turning.motion(times)
        positions, velocities = np.empty((2, len(times), 3))
        path = np.ascontiguousarray(self.path)
        _follow(path, arc_lengths(path), self._tangents, arcs, speeds, positions, velocities)
        return Setpoints(positions, velocities, headings, yaw_rates)

    def facing(self, heading: float) -> "Trajectory":
        """The same way with a heading that stays as it is [rad]."""
        return dataclasses.replace(self, turning=jerk_limited.at_rest(heading))

    def poses(self, step: float) -> Floats:
        """Poses (x, y, z, heading) from the begin to rest, a step [s] apart, shape (n, 4)."""
        times = np.append(step * np.arange(math.ceil(self.duration_s / step)), self.duration_s)
        arcs = self.motion.positions(times)
        points = [np.interp(arcs, self._arcs, axis) for axis in self.path.T]
        return np.column_stack((*points, self.turning.positions(times)))

    @cached_property
    def _arcs(self) -> list[float]:
        arcs: list[float] = arc_lengths(self.path).tolist()
        return arcs

    @cached_property
    def _tangents(self) -> Floats:
        return edge_tangents(self.path) if len(self.path) > 1 else np.zeros((1, 3))

    def _locate(self, arc_length: float) -> tuple[Floats, Floats]:
        """Point and unit tangent at an arc length, each shape (3,)."""
        edge = bisect.bisect_right(self._arcs, arc_length, 1, max(len(self._arcs) - 1, 1)) - 1
        tangent = self._tangents[edge]
        along = min(max(arc_length, 0.0), self._arcs[-1]) - self._arcs[edge]
        return self.path[edge] + along * tangent, tangent


@kernel
def _follow(
    path: Floats,  # (m, 3)
    begins: Floats,  # (m,) arc length at each point
    tangents: Floats,  # (m - 1, 3), of a single point (1, 3)
    arcs: Floats,  # (n,)
    speeds: Floats,  # (n,)
    positions: Floats,  # (n, 3) out
    velocities: Floats,  # (n, 3) out
) -> None:
    """Where arc lengths lead to, in any order; quickest in theirs."""
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


def follow_path(
    path: Floats,
    start_ns: int,
    s: float,
    speed: float,
    acceleration: float,
    heading: float,
    limits: MotionLimits,
    speed_cap: float,
    reverse: bool = False,
) -> Trajectory:
    """Fastest trajectory from a state on a path to rest at the path's end.

    The whole of it obeys the limits of speed and curvature, except while it still slows down from
    a state that did not. If the path is too short to stop, it is the fastest stop, beyond the end.
    The heading follows the path as fast as ``limits.yaw_rate`` lets it.

    Args:
        path: Shape (m, 3) [m], world frame.
        start_ns: Simulated time of the state.
        s: Arc length of the state [m].
        speed: Along the path [m/s], 0 or more.
        acceleration: Along the path [m/s^2].
        heading: [rad].
        limits: What the robot can follow.
        speed_cap: A further limit of the speed [m/s]; at or below 2 cm/s the robot stops.
        reverse: Whether it goes tail first.

    Returns:
        A trajectory whose arc lengths are those of ``path``.

    Raises:
        ValueError: If the path is not (m, 3) or the speed is negative.
    """
    start = _start_state(path, s, speed, acceleration, limits)
    length = float(arc_lengths(path)[-1]) - start.position
    cap = min(limits.speed, speed_cap)
    motion = None
    if cap > LEAST_SPEED and length > LEAST_ZONE:
        motion = travel(start, _zones(path, start.position, cap, limits), limits.along)
    if motion is None:
        motion = jerk_limited.stop(start, limits.along)
    return _along(path, start_ns, motion, heading, limits, reverse)


def stop_along(
    path: Floats,
    start_ns: int,
    s: float,
    speed: float,
    acceleration: float,
    heading: float,
    limits: MotionLimits,
    reverse: bool = False,
) -> Trajectory:
    """Fastest jerk-limited stop along a path, straight on beyond its end.

    Stopping along the path in one axis keeps the robot on it: axes that stop on their own bend the
    way. Arguments as in ``follow_path``.
    """
    start = _start_state(path, s, speed, acceleration, limits)
    motion = jerk_limited.stop(start, limits.along)
    return _along(path, start_ns, motion, heading, limits, reverse)


def turn_in_place(
    position: Floats, start_ns: int, heading: float, target_heading: float, limits: MotionLimits
) -> Trajectory:
    """Turn at rest to a heading [rad], the shorter way round."""
    target = heading + float(wrap(target_heading - heading))
    turning = jerk_limited.move(State(heading, 0.0, 0.0), target, limits.yaw_rate, limits.yaw)
    return Trajectory(start_ns, _single(position), jerk_limited.at_rest(0.0), turning)


def hold(position: Floats, start_ns: int, heading: float) -> Trajectory:
    """Stay where it is."""
    return Trajectory(
        start_ns, _single(position), jerk_limited.at_rest(0.0), jerk_limited.at_rest(heading)
    )


@lru_cache(maxsize=64)  # each decision asks several times for the same few
def stopping_distance(speed: float, acceleration: float, limits: MotionLimits) -> float:
    """Length of the fastest jerk-limited stop [m]."""
    start = _feasible(0.0, speed, acceleration, limits)
    return jerk_limited.stop(start, limits.along).end


def _single(position: Floats) -> Floats:
    return np.array(position, dtype=np.float64).reshape(1, 3)


def _start_state(
    path: Floats, s: float, speed: float, acceleration: float, limits: MotionLimits
) -> State:
    if path.ndim != 2 or path.shape[1] != 3 or len(path) == 0:
        raise ValueError(f"path: got shape {path.shape}, expected (m, 3) with m of 1 or more")
    total = float(arc_lengths(path)[-1])
    return _feasible(min(max(s, 0.0), total), speed, acceleration, limits)


def _feasible(s: float, speed: float, acceleration: float, limits: MotionLimits) -> State:
    """A state whose deceleration can end before the speed would turn negative."""
    if not speed >= 0.0:
        raise ValueError(f"speed: got {speed}, expected 0 or more")
    return State(s, speed, max(acceleration, -math.sqrt(2.0 * limits.jerk * speed)))


def _zones(path: Floats, s: float, cap: float, limits: MotionLimits) -> list[Zone]:
    """The rest of a path cut where its curvature begins or ceases to limit the speed."""
    arcs = arc_lengths(path)
    allowed = speed_limits(path, limits.lateral_acceleration, limits.yaw_rate)
    lengths, speeds = np.empty(len(path)), np.empty(len(path))
    count = _cut_zones(arcs, allowed, s, cap, lengths, speeds)
    return list(map(Zone, lengths[:count].tolist(), speeds[:count].tolist()))


@kernel
def _cut_zones(
    arcs: Floats,  # (n,)
    allowed: Floats,  # (n,) speeds
    s: float,
    cap: float,
    lengths: Floats,  # (n,) out
    speeds: Floats,  # (n,) out
) -> int:
    """Runs of points that are slow, and of those that are not; returns their number."""
    count = 0
    begin, speed = s, np.inf
    for k in range(len(arcs)):
        speed = min(speed, max(min(allowed[k], cap), LEAST_SPEED))
        last = k == len(arcs) - 1
        if not last and (allowed[k] < cap) == (allowed[k + 1] < cap):
            continue
        end = arcs[k] if last else 0.5 * (arcs[k] + arcs[k + 1])
        if end - begin > LEAST_ZONE:
            lengths[count], speeds[count] = end - begin, speed
            count += 1
        begin, speed = max(end, s), np.inf
    return count


def _along(
    path: Floats,
    start_ns: int,
    motion: Profile,
    heading: float,
    limits: MotionLimits,
    reverse: bool,
) -> Trajectory:
    """A profile on its path, with the heading that follows the path's."""
    overshoot = motion.end - float(arc_lengths(path)[-1])
    if overshoot < -LEAST_ZONE:  # a stop before the end: the rest is not committed to
        path, overshoot = truncate(path, motion.end), 0.0
    elif overshoot <= LEAST_ZONE:
        overshoot = 0.0
    elif len(path) > 1:
        path = np.vstack((path, path[-1] + overshoot * edge_tangents(path)[-1]))
    turning = _turning(path, motion, heading, limits, math.pi if reverse else 0.0)
    return Trajectory(start_ns, path, motion, turning, overshoot)


def _turning(
    path: Floats, motion: Profile, heading: float, limits: MotionLimits, off: float
) -> Profile:
    """Heading while moving: off the path's own heading, blended between middles of edges."""
    steps = math.floor(motion.duration / HEADING_STEP)  # the last, cut one is next to rest
    if steps == 0 or len(path) == 1:
        return jerk_limited.at_rest(heading)
    middles = arc_lengths(path)[:-1] + 0.5 * edge_lengths(path)
    headings = edge_headings(edge_tangents(path), heading - off) + off
    times = HEADING_STEP * np.arange(1.0, steps + 1.0)
    targets = np.interp(motion.positions(times), middles, headings)
    followed = rate_limited(targets, heading, limits.yaw_rate * HEADING_STEP)
    return jerk_limited.ramped(followed, HEADING_STEP)
