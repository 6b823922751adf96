"""Limits of the body on a command's motion: whether it exceeds them, and how the body then moves.

A base controller saturates: it follows a reference that is too fast as closely as its greatest
speed and acceleration let it. The referee has to judge that motion, not the commanded one:
a trajectory that stops dead before a wall is no proof that the body does.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from wayproof.harness.decision import trajectory_message
from wayproof.harness.geometry import wrap_angle
from wayproof.harness.interface.types import Array, Reference, Velocity
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.maps.elementary import norm
from wayproof.planners import MotionLimits, Setpoints, Trajectory

SLACK = 1.05
"""Tolerance factor of speeds, rates and accelerations, as in the audit."""

PERIOD_S = 0.1
"""Time between the samples that are compared with the limits, s, as in the audit."""

STILL_MPS = 0.02
"""Tolerance of a speed beyond the factor, m/s, as in the audit."""

JOINED_M = 0.04
"""Distance between two trajectories up to which one continues the other, m, as in the audit."""

FOLLOWED_S = 10.0
"""Time for which a motion beyond the limits is followed before the body brakes, s: as long as a
velocity holds at most."""

GAIN = 2.0
"""Feedback of the distance from the reference, 1/s: 0.1 m off adds 0.2 m/s."""

COURSE_FACTOR = 1.5
"""Factor of the acceleration up to which a velocity may change in any direction: as much along the
path as across it is the root of 2."""

COURSE_M = 0.1
"""Distance by which a body may leave a course whose corners are sharper, m: the default of
`costmap.localization_margin`. Corners of the built-in stack, at 0.5 m/s, take 0.08 m."""


@dataclass(frozen=True)
class Limited:
    """Motion of a body that follows a reference within its limits, to its rest.

    Attributes:
        positions: (n, 3) at even times, m, world.
        headings: (n,) rad.
    """

    positions: Array
    headings: Array


def clips(velocity: Velocity, limits: MotionLimits, *, planar: bool) -> bool:
    """Return whether a velocity is greater than the body's greatest speed or yaw rate."""
    up = 0.0 if planar else velocity.up
    speed = norm(np.array([velocity.forward, velocity.left, up]))
    return speed > limits.speed * SLACK or abs(velocity.yaw_rate) > limits.yaw_rate * SLACK


def sample_at(trajectory: pb.Trajectory, samples: Sequence[float], time_ns: int) -> float:
    """Return the logged samples of a trajectory at a simulated time, interpolated."""
    since_s = (time_ns - trajectory.start.ToNanoseconds()) * 1e-9
    times_s = np.arange(len(samples)) * trajectory.sample_period_s
    return float(np.interp(since_s, times_s, samples))


def mean_speed(trajectory: pb.Trajectory, time_ns: int) -> float:
    """Return the mean speed over `PERIOD_S` after a simulated time, by the logged samples, m/s."""
    arcs, after_ns = trajectory.arc_length, time_ns + round(PERIOD_S * 1e9)
    way = sample_at(trajectory, arcs, after_ns) - sample_at(trajectory, arcs, time_ns)
    return way / PERIOD_S


def speeds_join(speed: float, before: float, acceleration: float) -> bool:
    """Return whether a body can go over from one trajectory to another, by a `mean_speed` of each.

    Each differs from the speed at the joint by the acceleration times `PERIOD_S` at most. The audit
    judges a joint of logged trajectories so, and the limiter one that is to be logged.
    """
    return abs(speed - before) <= acceleration * PERIOD_S * SLACK + STILL_MPS


def joins(
    trajectory: Trajectory,
    followed: Trajectory,
    effect_ns: int,
    limits: MotionLimits,
    *,
    planar: bool,
) -> bool:
    """Return whether a trajectory continues the followed one where it starts, as it is logged.

    One that starts before it takes effect has to have been there as well. The heading counts on the
    ground.
    """
    start_ns = trajectory.start_ns
    if start_ns < followed.start_ns:
        return False
    if start_ns < effect_ns:
        apart = trajectory.at(start_ns).position - followed.at(start_ns).position
        if norm(apart) > JOINED_M:
            return False
    logged, before = trajectory_message(trajectory), trajectory_message(followed)
    turn = wrap_angle(
        sample_at(logged, logged.heading, start_ns) - sample_at(before, before.heading, start_ns)
    )
    if planar and abs(turn) > limits.yaw_rate * PERIOD_S * SLACK:
        return False
    speeds = mean_speed(logged, start_ns), mean_speed(before, start_ns)
    return speeds_join(*speeds, limits.acceleration)


def exceeds(
    trajectory: Trajectory, reference: Reference, effect_ns: int, limits: MotionLimits
) -> bool:
    """Return whether a trajectory commands more speed, acceleration or yaw rate than the body has.

    From the speed of the reference at its beginning to rest at its end, by even samples.
    """
    left_s = trajectory.duration_s - max(effect_ns - trajectory.start_ns, 0) * 1e-9
    count = max(math.ceil(left_s / PERIOD_S), 0) + 3
    period_ns = round(PERIOD_S * 1e9)
    since_ns = effect_ns - trajectory.start_ns + period_ns * np.arange(count)
    times_s = 1e-9 * since_ns.astype(np.float64)
    arcs, begin = trajectory.motion.motion(times_s)
    headings, _ = trajectory.turning.motion(times_s)
    speeds = np.diff(arcs) / PERIOD_S
    rates = np.diff(headings) / PERIOD_S
    changes = np.diff(speeds) / PERIOD_S
    jump = abs(float(begin[0]) - norm(reference.velocity))
    return bool(
        np.abs(speeds).max() > limits.speed * SLACK + STILL_MPS
        or np.abs(rates).max() > limits.yaw_rate * SLACK + STILL_MPS
        or np.abs(changes).max() > limits.acceleration * SLACK + STILL_MPS / PERIOD_S
        or jump > limits.acceleration * PERIOD_S * SLACK + STILL_MPS
    )


def heading_jumps(
    trajectory: Trajectory, reference: Reference, effect_ns: int, limits: MotionLimits
) -> bool:
    """Return whether a trajectory begins at another heading than the body can have by then."""
    jump = wrap_angle(trajectory.at(effect_ns).heading - reference.heading)
    return abs(jump) > limits.yaw_rate * PERIOD_S * SLACK


def leaves_course(
    trajectory: Trajectory,
    reference: Reference,
    effect_ns: int,
    limits: MotionLimits,
    step_s: float,
) -> bool:
    """Return whether a trajectory turns so sharply that the body cannot but leave it.

    Velocities are compared as vectors, from that of the reference on: a body that moves ahead and
    is commanded back at once first continues ahead. Where they change by more than it can, the
    distance between the commanded motion and the one that the body can follow counts.

    Args:
        trajectory: Commanded trajectory, whose speeds and rates are within the limits.
        reference: Commanded state at the time of effect.
        effect_ns: That time, ns.
        limits: Limits of the body.
        step_s: Time between two samples of the motion that it can follow, s.
    """
    count = math.ceil(_seconds_left(trajectory, effect_ns) / PERIOD_S) + 2
    times_ns = effect_ns + round(PERIOD_S * 1e9) * np.arange(count)
    velocities = np.diff(trajectory.setpoints(times_ns).positions, axis=0) / PERIOD_S
    changes = np.diff(np.vstack([reference.velocity, velocities]), axis=0)
    largest = COURSE_FACTOR * limits.acceleration * PERIOD_S * SLACK + STILL_MPS
    if np.sqrt(np.square(changes).sum(axis=1)).max() <= largest:
        return False
    followed = follow_within(
        trajectory, reference, effect_ns, limits, step_s, most_s=math.inf
    ).positions
    times_ns = effect_ns + np.round(np.arange(len(followed)) * (step_s * 1e9)).astype(np.int64)
    apart = followed - trajectory.setpoints(times_ns).positions
    return bool(np.sqrt(np.square(apart).sum(axis=1)).max() > COURSE_M)


def _seconds_left(trajectory: Trajectory, effect_ns: int) -> float:
    """Return the time from a time of effect to the rest of a trajectory, s, 0 or more."""
    return max(trajectory.duration_s - max(effect_ns - trajectory.start_ns, 0) * 1e-9, 0.0)


def follow_within(
    trajectory: Trajectory,
    reference: Reference,
    effect_ns: int,
    limits: MotionLimits,
    step_s: float,
    *,
    shorter_turn: bool = False,
    most_s: float = FOLLOWED_S,
) -> Limited:
    """Follow a trajectory as closely as the limits let the body, then brake.

    Args:
        trajectory: Commanded trajectory.
        reference: Commanded state at the time of effect.
        effect_ns: That time, ns.
        limits: Limits of the body.
        step_s: Time between two samples of the result, s.
        shorter_turn: Whether the body turns into the first heading the shorter way round, and has
            the time for it besides.
        most_s: Time after which it brakes, s.
    """
    left_s, turn = _seconds_left(trajectory, effect_ns), 0.0
    first = trajectory.at(effect_ns).heading
    if shorter_turn:
        turn = wrap_angle(first - reference.heading)
        left_s += abs(turn) / limits.yaw_rate
    steps = math.ceil(min(left_s, most_s) / step_s)
    times_ns = effect_ns + np.round(np.arange(steps + 1) * (step_s * 1e9)).astype(np.int64)
    commanded = trajectory.setpoints(times_ns)
    if shorter_turn:
        shift = reference.heading + turn - first  # by full turns
        commanded = commanded._replace(headings=commanded.headings + shift)
    positions, headings = [reference.position], [reference.heading]
    velocity, rate = reference.velocity, reference.yaw_rate
    while len(positions) <= steps or norm(velocity) > 0.0 or rate != 0.0:
        target, target_rate = np.zeros(3), 0.0
        if len(positions) <= steps:
            target, target_rate = _pursuit_velocity(
                commanded,
                index=len(positions),
                position=positions[-1],
                heading=headings[-1],
                limits=limits,
                step_s=step_s,
            )
        before, rate_before = velocity, rate
        velocity = before + _shortened(target - before, limits.acceleration * step_s)
        most = limits.yaw.acceleration * step_s
        rate += min(max(target_rate - rate, -most), most)
        positions.append(positions[-1] + 0.5 * (before + velocity) * step_s)
        headings.append(headings[-1] + 0.5 * (rate_before + rate) * step_s)
    return Limited(np.array(positions), np.array(headings))


def _pursuit_velocity(
    commanded: Setpoints,
    index: int,
    position: Array,
    heading: float,
    limits: MotionLimits,
    step_s: float,
) -> tuple[Array, float]:
    """Return the velocity (3,), m/s, and yaw rate, rad/s, towards a setpoint, within the limits."""
    ahead = commanded.positions[index] - position - commanded.velocities[index] * step_s
    velocity = _shortened(commanded.velocities[index] + GAIN * ahead, limits.speed)
    rate = float(commanded.yaw_rates[index]) + GAIN * (float(commanded.headings[index]) - heading)
    return velocity, min(max(rate, -limits.yaw_rate), limits.yaw_rate)


def _shortened(vector: Array, longest: float) -> Array:
    """Shorten a vector to a length at most."""
    size = norm(vector)
    return vector if size <= longest else vector * (longest / size)
