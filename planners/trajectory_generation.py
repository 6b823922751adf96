"""Generation of trajectories: along a path to rest, a stop, a turn in place, a hold."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from wayproof.planners import jerk_limited, speed_profile
from wayproof.planners.jerk_limited import Profile, State
from wayproof.planners.kernels.angles import (
    acceleration_limited,
    edge_headings,
    rate_limited,
    wrap,
    yaw_of_direction,
)
from wayproof.planners.kernels.grid import Floats
from wayproof.planners.path import arc_lengths, edge_lengths, edge_tangents, tangent_at, truncate
from wayproof.planners.speed_profile import (
    LEAST_ZONE,
    SpeedZone,
    feasible_state,
    settled_velocity,
    time_parameterize,
)
from wayproof.planners.speed_zones import (
    LEAST_SPEED,
    SlowEnd,
    slow_at_end,
    slow_while_turning,
    speed_zones,
)
from wayproof.planners.trajectory import MotionLimits, Trajectory

HEADING_STEP = 0.01
"""Time step of headings that follow a path, s."""


class PathState(NamedTuple):
    """State of a robot on a path, where a trajectory begins."""

    time_ns: int  # simulated
    arc_length: float  # m
    speed: float  # along the path, m/s, 0 or more
    acceleration: float  # along the path, m/s^2
    heading: float  # rad
    yaw_rate: float = 0.0  # rad/s


def follow_path(
    path: Floats,
    start: PathState,
    limits: MotionLimits,
    speed_cap: float,
    reverse: bool = False,
    sideways_speed: float = 0.0,
    slow_end: SlowEnd | None = None,
) -> Trajectory:
    """Return the fastest trajectory from a state on a path to rest at the path's end.

    The whole of it obeys the limits of speed and curvature, except while it still slows down from
    a state that did not. If the path is too short to stop, it is the fastest stop, beyond the end.
    The heading follows the path at `limits.yaw_rate` and `limits.yaw_acceleration` at most. A bend
    that begins or ends the path limits the speed from that end on.

    Args:
        path: Shape (m, 3), m, world frame.
        start: State on the path.
        limits: Limits of the robot.
        speed_cap: A further limit of the speed, m/s; at or below 2 cm/s the robot stops.
        reverse: Whether it moves tail first.
        sideways_speed: Speed until the heading has turned into the path, m/s; 0 for no such limit.
        slow_end: A speed limit from an arc length of the path on.

    Returns:
        A trajectory whose arc lengths are those of `path`.

    Raises:
        ValueError: If the path is not (m, 3) or the speed is negative.
    """
    motion = _motion_along(
        path,
        start,
        limits,
        speed_cap=speed_cap,
        reverse=reverse,
        sideways_speed=sideways_speed,
        slow_end=slow_end,
    )
    return _along(path, start, motion, limits, reverse)


def time_along(
    path: Floats,
    start: PathState,
    limits: MotionLimits,
    speed_cap: float,
    reverse: bool = False,
    sideways_speed: float = 0.0,
) -> float:
    """Return the duration of the trajectory along a path, s; arguments as of `follow_path`."""
    motion = _motion_along(
        path,
        start,
        limits,
        speed_cap=speed_cap,
        reverse=reverse,
        sideways_speed=sideways_speed,
    )
    steps = _heading_steps(_to_end(path, motion)[0], motion)
    return max(motion.duration, HEADING_STEP * steps)  # which can be later by a rounding


def _motion_along(
    path: Floats,
    start: PathState,
    limits: MotionLimits,
    *,
    speed_cap: float,
    reverse: bool,
    sideways_speed: float,
    slow_end: SlowEnd | None = None,
) -> Profile:
    """Return the motion along a path from a state to rest; arguments as of `follow_path`."""
    state = _start_state(path, start, limits)
    length = float(arc_lengths(path)[-1]) - state.position
    cap = min(limits.speed, speed_cap)
    motion = None
    if cap > LEAST_SPEED and length > LEAST_ZONE:
        turn = _turn_into(path, state.position, start.heading, math.pi if reverse else 0.0)
        zones = _zones(path, state, turn, cap, limits, sideways_speed)
        if slow_end is not None:
            zones = slow_at_end(zones, slow_end.begin - state.position, slow_end.speed)
        motion = time_parameterize(state, zones, limits.along)
    return jerk_limited.stop(state, limits.along) if motion is None else motion


def keeps_limits(
    path: Floats, start: PathState, limits: MotionLimits, sideways_speed: float = 0.0
) -> bool:
    """Return whether a path is followed to rest at its end within all limits of speed.

    From a state that is too fast for a bend or for the end, `follow_path` exceeds one until it has
    slowed down. Arguments as there.
    """
    state = _start_state(path, start, limits)
    if float(arc_lengths(path)[-1]) - state.position <= LEAST_ZONE:
        return False
    turn = _turn_into(path, state.position, start.heading, 0.0)
    zones = _zones(path, state, turn, limits.speed, limits, sideways_speed)
    return speed_profile.keeps_limits(state, zones, limits.along)


def _zones(
    path: Floats,
    state: State,
    turn: float,
    cap: float,
    limits: MotionLimits,
    sideways_speed: float,
) -> list[SpeedZone]:
    """Return speed zones from a state on, for a body with a turn, rad, left into the path."""
    speed = max(state.velocity, settled_velocity(state, limits.along))
    zones = speed_zones(path, state.position, cap, limits, sideways_speed, speed)
    if sideways_speed > 0.0:
        zones = slow_while_turning(
            zones, turn, limits.yaw_rate, sideways_speed, limits.by_direction
        )
    return zones


def stop_along(
    path: Floats, start: PathState, limits: MotionLimits, reverse: bool = False
) -> Trajectory:
    """Return the fastest jerk-limited stop along a path, straight on beyond its end.

    One axis, the arc length, keeps the robot on the path: x, y and z stopped each on its own would
    leave it. Arguments as in `follow_path`.
    """
    motion = jerk_limited.stop(_start_state(path, start, limits), limits.along)
    return _along(path, start, motion, limits, reverse)


def turn_in_place(
    position: Floats,
    start_ns: int,
    heading: float,
    target_heading: float,
    limits: MotionLimits,
    yaw_rate: float = 0.0,
) -> Trajectory:
    """Turn at rest to a heading, rad, the shorter way round, from a yaw rate, rad/s, on."""
    target = heading + float(wrap(target_heading - heading))
    turning = jerk_limited.move(State(heading, yaw_rate, 0.0), target, limits.yaw_rate, limits.yaw)
    return Trajectory(start_ns, _single(position), jerk_limited.at_rest(0.0), turning)


def hold(position: Floats, start_ns: int, heading: float) -> Trajectory:
    """Stay at a position and heading, rad."""
    return Trajectory(
        start_ns, _single(position), jerk_limited.at_rest(0.0), jerk_limited.at_rest(heading)
    )


def _single(position: Floats) -> Floats:
    return np.array(position, dtype=np.float64).reshape(1, 3)


def _start_state(path: Floats, start: PathState, limits: MotionLimits) -> State:
    if path.ndim != 2 or path.shape[1] != 3 or len(path) == 0:
        raise ValueError(f"path: got shape {path.shape}, expected (m, 3) with m of 1 or more")
    total = float(arc_lengths(path)[-1])
    position = min(max(start.arc_length, 0.0), total)
    return feasible_state(position, start.speed, start.acceleration, limits)


def _turn_into(path: Floats, s: float, heading: float, off: float) -> float:
    """Turn from a heading into a path at an arc length, rad, not negative."""
    tangent = tangent_at(path, s)
    return abs(float(wrap(yaw_of_direction(tangent[0], tangent[1]) - off - heading)))


def _along(
    path: Floats, start: PathState, motion: Profile, limits: MotionLimits, reverse: bool
) -> Trajectory:
    """Return a trajectory of a profile on a path, its heading following the path's."""
    path, overshoot = _to_end(path, motion)
    turning = _turning(path, motion, start, limits, off=math.pi if reverse else 0.0)
    return Trajectory(start.time_ns, path, motion, turning, overshoot)


def _to_end(path: Floats, motion: Profile) -> tuple[Floats, float]:
    """Return the path up to the end of a motion, and by how much that is beyond its own end, m."""
    overshoot = motion.end - float(arc_lengths(path)[-1])
    if overshoot < -LEAST_ZONE:  # it stops before the end: the rest is no part of it
        return truncate(path, motion.end), 0.0
    if overshoot <= LEAST_ZONE:
        return path, 0.0
    if len(path) > 1:
        path = np.vstack((path, path[-1] + overshoot * edge_tangents(path)[-1]))
    return path, overshoot


def _heading_steps(path: Floats, motion: Profile) -> int:
    """Return the time steps in which a heading follows a path, without an incomplete last one."""
    return 0 if len(path) == 1 else math.floor(motion.duration / HEADING_STEP)


def _turning(
    path: Floats, motion: Profile, start: PathState, limits: MotionLimits, off: float
) -> Profile:
    """Return the heading in motion: the path's and an offset, blended between edges' middles."""
    steps = _heading_steps(path, motion)
    if steps == 0:
        return jerk_limited.at_rest(start.heading)
    middles = arc_lengths(path)[:-1] + 0.5 * edge_lengths(path)
    headings = edge_headings(edge_tangents(path), start.heading - off) + off
    times = HEADING_STEP * np.arange(1.0, steps + 1.0)
    targets = np.interp(motion.positions(times), middles, headings)
    largest_step = limits.yaw_rate * HEADING_STEP
    if math.isinf(limits.yaw_acceleration):
        followed = rate_limited(targets, start.heading, largest_step)
    else:
        rate = start.yaw_rate * HEADING_STEP
        change = limits.yaw_acceleration * HEADING_STEP * HEADING_STEP
        followed = acceleration_limited(targets, start.heading, rate, largest_step, change)
    return jerk_limited.ramped(followed, HEADING_STEP)
