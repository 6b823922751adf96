"""Trajectories: a path, a jerk-limited profile along it that ends at rest, and a heading."""

from __future__ import annotations

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
from wayproof.planners.kernels.angles import edge_headings, rate_limited, wrap, yaw_of_direction
from wayproof.planners.kernels.grid import Floats
from wayproof.planners.path import (
    arc_lengths,
    edge_lengths,
    edge_tangents,
    remaining,
    speed_limits,
    tangent_at,
    truncate,
)
from wayproof.planners.speed_profile import LEAST_ZONE, SpeedZone, time_parameterize

Integers = NDArray[np.int64]

HEADING_STEP = 0.01
"""Time step of headings that follow a path, s."""

TURNING = 0.25
"""Heading error from which on a body that moves still turns into its path, rad."""

TURN_LAG = 0.3
"""Time that a body takes to begin and to end a turn while it moves, s."""

REST_SPEED = 1e-9
"""Speed at which a profile that ended counts as at rest, m/s: rounding can leave it below 0."""

LEAST_SPEED = 0.02
"""Smallest speed limit, m/s: below it a profile would take hours."""


@dataclass(frozen=True)
class MotionLimits:
    """Limits of the motion that a robot can follow.

    Attributes:
        speed: Along the path, m/s.
        acceleration: Along the path, in either direction, m/s^2.
        jerk: Along the path, m/s^3.
        lateral_acceleration: Speed squared times curvature, m/s^2.
        yaw_rate: Change of heading, rad/s.

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
        """Setpoints at simulated times (n,): position, velocity and heading of `at`."""
        times = 1e-9 * (times_ns - self.start_ns).astype(np.float64)
        arcs, speeds = self.motion.motion(times)
        headings, yaw_rates = self.turning.motion(times)
        positions, velocities = np.empty((2, len(times), 3))
        path = np.ascontiguousarray(self.path)
        locate_all(path, arc_lengths(path), self._tangents, arcs, speeds, positions, velocities)
        return Setpoints(positions, velocities, headings, yaw_rates)

    def facing(self, heading: float) -> Trajectory:
        """The same motion at a constant heading, rad."""
        return dataclasses.replace(self, turning=jerk_limited.at_rest(heading))

    def path_after(self, elapsed: float) -> Floats:
        """What is left of the path after a time, s, up to the stop, shape (n, 3), m."""
        begun = float(self.motion.at(elapsed)[0])
        return truncate(remaining(self.path, begun), self.motion.end - begun)

    def poses(self, step: float, elapsed: float = 0.0, *, corners: bool = False) -> Floats:
        """Poses (x, y, z, heading) up to rest, shape (n, 4).

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
        """Point and unit tangent at an arc length, each shape (3,)."""
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
    """Positions and velocities at arc lengths in any order, the quicker the more they ascend."""
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


class PathState(NamedTuple):
    """State of a robot on a path, where a trajectory begins."""

    time_ns: int  # simulated
    arc_length: float  # m
    speed: float  # along the path, m/s, 0 or more
    acceleration: float  # along the path, m/s^2
    heading: float  # rad


def follow_path(
    path: Floats,
    start: PathState,
    limits: MotionLimits,
    speed_cap: float,
    reverse: bool = False,
    sideways_speed: float = 0.0,
) -> Trajectory:
    """Fastest trajectory from a state on a path to rest at the path's end.

    The whole of it obeys the limits of speed and curvature, except while it still slows down from
    a state that did not. If the path is too short to stop, it is the fastest stop, beyond the end.
    The heading follows the path at `limits.yaw_rate` at most.

    Args:
        path: Shape (m, 3), m, world frame.
        start: State on the path.
        limits: Limits of the robot.
        speed_cap: A further limit of the speed, m/s; at or below 2 cm/s the robot stops.
        reverse: Whether it moves tail first.
        sideways_speed: Speed until the heading has turned into the path, m/s; 0 for no such limit.

    Returns:
        A trajectory whose arc lengths are those of `path`.

    Raises:
        ValueError: If the path is not (m, 3) or the speed is negative.
    """
    state = _start_state(path, start, limits)
    length = float(arc_lengths(path)[-1]) - state.position
    cap = min(limits.speed, speed_cap)
    motion = None
    if cap > LEAST_SPEED and length > LEAST_ZONE:
        zones = speed_zones(path, state.position, cap, limits, sideways_speed)
        if sideways_speed > 0.0:
            turn = _turn_into(path, state.position, start.heading, math.pi if reverse else 0.0)
            if turn > TURNING:
                length = sideways_speed * (turn / limits.yaw_rate + TURN_LAG)
                zones = slow_at_first(zones, length, sideways_speed)
        motion = time_parameterize(state, zones, limits.along)
    if motion is None:
        motion = jerk_limited.stop(state, limits.along)
    return _along(path, start, motion, limits, reverse)


def stop_along(
    path: Floats, start: PathState, limits: MotionLimits, reverse: bool = False
) -> Trajectory:
    """Fastest jerk-limited stop along a path, straight on beyond its end.

    One axis, the arc length, keeps the robot on the path: x, y and z stopped each on its own would
    leave it. Arguments as in `follow_path`.
    """
    motion = jerk_limited.stop(_start_state(path, start, limits), limits.along)
    return _along(path, start, motion, limits, reverse)


def turn_in_place(
    position: Floats, start_ns: int, heading: float, target_heading: float, limits: MotionLimits
) -> Trajectory:
    """Turn at rest to a heading, rad, the shorter way round."""
    target = heading + float(wrap(target_heading - heading))
    turning = jerk_limited.move(State(heading, 0.0, 0.0), target, limits.yaw_rate, limits.yaw)
    return Trajectory(start_ns, _single(position), jerk_limited.at_rest(0.0), turning)


def hold(position: Floats, start_ns: int, heading: float) -> Trajectory:
    """Stay at a position and heading, rad."""
    return Trajectory(
        start_ns, _single(position), jerk_limited.at_rest(0.0), jerk_limited.at_rest(heading)
    )


@lru_cache(maxsize=64)  # each decision needs the same few several times
def stopping_distance(speed: float, acceleration: float, limits: MotionLimits) -> float:
    """Length of the fastest jerk-limited stop, m."""
    start = _feasible(0.0, speed, acceleration, limits)
    return jerk_limited.stop(start, limits.along).end


def _single(position: Floats) -> Floats:
    return np.array(position, dtype=np.float64).reshape(1, 3)


def _start_state(path: Floats, start: PathState, limits: MotionLimits) -> State:
    if path.ndim != 2 or path.shape[1] != 3 or len(path) == 0:
        raise ValueError(f"path: got shape {path.shape}, expected (m, 3) with m of 1 or more")
    total = float(arc_lengths(path)[-1])
    position = min(max(start.arc_length, 0.0), total)
    return _feasible(position, start.speed, start.acceleration, limits)


def _feasible(s: float, speed: float, acceleration: float, limits: MotionLimits) -> State:
    """A state whose deceleration can end before the speed would turn negative."""
    if not speed >= -REST_SPEED:
        raise ValueError(f"speed: got {speed}, expected 0 or more")
    speed = max(speed, 0.0)  # a profile that ends at rest can miss 0 by a rounding
    return State(s, speed, max(acceleration, -math.sqrt(2.0 * limits.jerk * speed)))


def speed_zones(
    path: Floats, s: float, cap: float, limits: MotionLimits, sideways_speed: float = 0.0
) -> list[SpeedZone]:
    """Cut a path from an arc length on where its curvature begins or ceases to limit the speed."""
    arcs = arc_lengths(path)
    allowed = speed_limits(path, limits.lateral_acceleration, limits.yaw_rate)
    if sideways_speed > 0.0:
        allowed = _allow_sideways(path, arcs, allowed, limits, sideways_speed)
    lengths, speeds = np.empty(len(path)), np.empty(len(path))
    count = cut_zones(arcs, allowed, s, cap, lengths, speeds)
    return list(map(SpeedZone, lengths[:count].tolist(), speeds[:count].tolist()))


def _allow_sideways(
    path: Floats, arcs: Floats, allowed: Floats, limits: MotionLimits, sideways_speed: float
) -> Floats:
    """Speeds (n,) of a body that need not have turned at a speed that it has in any direction.

    Where its turn falls behind the path's, it keeps to that speed until it has caught up.
    """
    lateral = speed_limits(path, limits.lateral_acceleration, math.inf)
    turns = np.abs(np.diff(edge_headings(edge_tangents(path), 0.0)))  # (n - 2,)
    speeds: Floats = np.minimum(lateral, np.maximum(allowed, sideways_speed))
    slow_while_behind(arcs, turns, allowed, limits.yaw_rate, sideways_speed, speeds)
    return speeds


@kernel
def slow_while_behind(
    arcs: Floats,  # (n,)
    turns: Floats,  # (n - 2,) of the path at its inner points, rad, not negative
    allowed: Floats,  # (n,) speeds of a body that turns with the path
    yaw_rate: float,
    sideways_speed: float,
    speeds: Floats,  # (n,) in, out
) -> None:
    """Limit the speeds at which the heading has not caught up with the path's yet."""
    behind = 0.0  # rad
    for k in range(1, len(arcs)):
        taken = (arcs[k] - arcs[k - 1]) / sideways_speed
        behind = max(behind - yaw_rate * taken, 0.0)
        if k <= len(turns) and allowed[k] < sideways_speed:
            behind += turns[k - 1]
        if behind > TURNING:
            speeds[k] = min(speeds[k], sideways_speed)


def _turn_into(path: Floats, s: float, heading: float, off: float) -> float:
    """Turn from a heading into a path at an arc length, rad, not negative."""
    tangent = tangent_at(path, s)
    return abs(float(wrap(yaw_of_direction(tangent[0], tangent[1]) - off - heading)))


def slow_at_first(zones: list[SpeedZone], length: float, speed: float) -> list[SpeedZone]:
    """Limit the speed over a first length, m, to a speed, m/s."""
    slowed = []
    for zone in zones:
        first = min(zone.length, length)
        length -= first
        if first > LEAST_ZONE:
            slowed.append(SpeedZone(first, min(zone.speed, speed)))
        if zone.length - first > LEAST_ZONE:
            slowed.append(SpeedZone(zone.length - first, zone.speed))
    return slowed


@kernel
def cut_zones(
    arcs: Floats,  # (n,)
    allowed: Floats,  # (n,) speeds
    s: float,
    cap: float,
    lengths: Floats,  # (n,) out
    speeds: Floats,  # (n,) out
) -> int:
    """Cut a path into runs of slow and of fast points; return their number."""
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
    path: Floats, start: PathState, motion: Profile, limits: MotionLimits, reverse: bool
) -> Trajectory:
    """A trajectory of a profile on a path, its heading following the path's."""
    overshoot = motion.end - float(arc_lengths(path)[-1])
    if overshoot < -LEAST_ZONE:  # it stops before the end: the rest is no part of it
        path, overshoot = truncate(path, motion.end), 0.0
    elif overshoot <= LEAST_ZONE:
        overshoot = 0.0
    elif len(path) > 1:
        path = np.vstack((path, path[-1] + overshoot * edge_tangents(path)[-1]))
    turning = _turning(path, motion, start.heading, limits, math.pi if reverse else 0.0)
    return Trajectory(start.time_ns, path, motion, turning, overshoot)


def _turning(
    path: Floats, motion: Profile, heading: float, limits: MotionLimits, off: float
) -> Profile:
    """Heading while moving: that of the path and an offset, blended between middles of edges."""
    steps = math.floor(motion.duration / HEADING_STEP)  # without the incomplete one at the end
    if steps == 0 or len(path) == 1:
        return jerk_limited.at_rest(heading)
    middles = arc_lengths(path)[:-1] + 0.5 * edge_lengths(path)
    headings = edge_headings(edge_tangents(path), heading - off) + off
    times = HEADING_STEP * np.arange(1.0, steps + 1.0)
    targets = np.interp(motion.positions(times), middles, headings)
    followed = rate_limited(targets, heading, limits.yaw_rate * HEADING_STEP)
    return jerk_limited.ramped(followed, HEADING_STEP)
