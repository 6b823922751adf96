"""The trajectory that the body follows for a command's motion; deterministic.

A velocity is rolled out for its time and then braked by the body's limits, waypoints become the
fastest trajectory through them, samples a trajectory through them. All end at rest. What exceeds
the limits is followed as closely as they let the body.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from wayproof.harness.geometry import wrap_angle
from wayproof.harness.interface.kernels import STEP_S, roll_out
from wayproof.harness.interface.limits import (
    clips,
    exceeds,
    follow_within,
    heading_jumps,
    joins,
    leaves_course,
)
from wayproof.harness.interface.motion_checks import (
    MAX_HEADING_RAD,
    MAX_SAMPLES,
    STILL_M,
    MotionError,
    checked_points,
    checked_trajectory,
    refuse_backwards,
    refuse_elsewhere,
)
from wayproof.harness.interface.observations import reference_at
from wayproof.harness.interface.types import Array, Motion, Reference, Samples, Velocity, Waypoints
from wayproof.harness.stack.gait import Gait
from wayproof.maps.elementary import arc_tangent, norm
from wayproof.planners import (
    MotionLimits,
    PathState,
    Trajectory,
    arc_lengths,
    first_stop,
    follow_path,
    hold,
    truncate,
    turn_in_place,
)
from wayproof.planners.jerk_limited import at_rest, ramped

MAX_DURATION_S = 10.0
"""Longest time for which a velocity holds, s."""

MAX_TRAJECTORY_S = 600.0
"""Longest time to the rest of a trajectory, s."""

TURN_FIRST_RAD = 0.6
"""Heading error beyond which a ground robot at rest turns in place before it follows waypoints."""

MAX_CORNER_RAD = 0.9
"""Sharpest corner of waypoints that is taken without coming to rest."""


class Followed(NamedTuple):
    """Trajectory that the body follows for a command.

    Attributes:
        trajectory: Trajectory to its rest.
        limited: Whether the command exceeds the body's limits.
    """

    trajectory: Trajectory
    limited: bool


def trajectory_of(
    motion: Motion,
    references: tuple[Reference, Reference],
    effect_ns: int,
    limits: MotionLimits,
    *,
    planar: bool,
    acceleration: float = 0.0,
    sideways_speed: float = 0.0,
    followed: Trajectory | None = None,
) -> Followed:
    """Return the trajectory that the body follows for a motion.

    Args:
        motion: Motion of a command.
        references: Commanded state at the time of effect, where a motion begins; and the same at
            the estimated position, where a trajectory may begin as well.
        effect_ns: That time, ns.
        limits: Limits of the body.
        planar: Whether the body moves in the plane of the reference: heights are ignored.
        acceleration: Commanded along waypoints at the time of effect, m/s^2.
        sideways_speed: Speed along waypoints until the heading has turned into them, m/s; 0 for no
            such limit.
        followed: Trajectory that the motion has to go on from, as the audit has it; None for any.

    Raises:
        MotionError: It is not finite, starts elsewhere, goes back along its path or has no end.
    """
    reference = references[0]
    if isinstance(motion, Velocity):
        trajectory = _roll_out(motion, reference, effect_ns, limits, planar)
        return Followed(trajectory, clips(motion, limits, planar=planar))
    if isinstance(motion, Waypoints):
        trajectory = _waypoint_trajectory(
            motion, reference, effect_ns, limits, planar, acceleration, sideways_speed
        )
    elif isinstance(motion, Samples):
        trajectory = _sampled(motion, references, effect_ns, planar)
    else:
        trajectory = checked_trajectory(motion, references, effect_ns, planar)
        refuse_backwards(trajectory, effect_ns)
    if trajectory.duration_s > MAX_TRAJECTORY_S:
        raise MotionError(
            f"trajectory comes to rest after {trajectory.duration_s:.0f} s, expected at most "
            f"{MAX_TRAJECTORY_S:g} s"
        )
    beyond = exceeds(trajectory, reference, effect_ns, limits)
    if not beyond and followed is not None:
        beyond = not joins(trajectory, followed, effect_ns, limits, planar=planar)
    if not beyond:
        jumps = planar and heading_jumps(trajectory, reference, effect_ns, limits)
        beyond = jumps or leaves_course(trajectory, reference, effect_ns, limits, STEP_S)
    if not beyond:
        return Followed(trajectory, limited=False)
    within = follow_within(trajectory, reference, effect_ns, limits, STEP_S, shorter_turn=True)
    return Followed(_joined(effect_ns, within.positions, within.headings, STEP_S), limited=True)


def commanded(
    motion: Motion, followed: Trajectory, position: Array, effect_ns: int, gait: Gait, planar: bool
) -> Followed:
    """Return the trajectory of a motion that continues the one that the body follows.

    Args:
        motion: Motion of a command.
        followed: Trajectory that the body follows.
        position: (3,) estimated position, where a trajectory may begin as well, m.
        effect_ns: Time of effect, ns.
        gait: How the body moves.
        planar: Whether it walks.

    Raises:
        MotionError: As of `trajectory_of`.
    """
    reference = reference_at(followed, effect_ns, None)
    return trajectory_of(
        motion,
        (reference, replace(reference, position=position)),
        effect_ns,
        gait.limits,
        planar=planar,
        acceleration=followed.at(effect_ns).acceleration,
        sideways_speed=gait.sideways_speed,
        followed=followed,
    )


def _roll_out(
    velocity: Velocity,
    reference: Reference,
    effect_ns: int,
    limits: MotionLimits,
    planar: bool,
) -> Trajectory:
    """Hold a velocity in the body's frame for its time, then brake; within the limits."""
    values = (velocity.forward, velocity.left, velocity.up, velocity.yaw_rate)
    if not all(map(math.isfinite, values)):
        raise MotionError(f"velocity: got {values}, expected finite numbers")
    if not 0.0 <= velocity.duration_s <= MAX_DURATION_S:
        raise MotionError(
            f"velocity.duration_s: got {velocity.duration_s:g}, expected 0 to {MAX_DURATION_S:g} s"
        )
    target = np.array([velocity.forward, velocity.left, 0.0 if planar else velocity.up])
    speed = norm(target)
    if speed > limits.speed:
        target *= limits.speed / speed
    steps = round(velocity.duration_s / STEP_S)
    moving = reference.velocity * np.array([1.0, 1.0, 0.0 if planar else 1.0])
    yaw_rate = min(max(velocity.yaw_rate, -limits.yaw_rate), limits.yaw_rate)
    turning = float(reference.yaw_rate), float(yaw_rate)
    changes = limits.acceleration * STEP_S, limits.yaw.acceleration * STEP_S
    slowest = max(max(norm(moving), limits.speed) / changes[0], max(map(abs, turning)) / changes[1])
    room = min(steps + int(min(slowest, MAX_SAMPLES)) + 4, MAX_SAMPLES + 1)
    positions, headings = np.empty((room, 3)), np.empty(room)
    positions[0], headings[0] = reference.position, reference.heading
    count = roll_out(steps, moving, turning, target, changes, positions, headings)
    if count > len(positions):
        raise MotionError("velocity: the body does not come to rest")
    return _joined(effect_ns, positions[:count].copy(), headings[:count].copy(), STEP_S)


def _waypoint_trajectory(
    waypoints: Waypoints,
    reference: Reference,
    effect_ns: int,
    limits: MotionLimits,
    planar: bool,
    acceleration: float,
    sideways_speed: float,
) -> Trajectory:
    """Return the fastest trajectory through waypoints, up to the first sharp corner."""
    points = checked_points("waypoints.points", waypoints.points)
    if not 0.0 <= waypoints.speed < math.inf:
        raise MotionError(f"waypoints.speed: got {waypoints.speed}, expected 0 or more m/s")
    if planar:
        points[:, 2] = reference.position[2]
    points = checked_points("waypoints.points", np.vstack([reference.position, points]))
    path = _without_repeats(points)
    speed = norm(reference.velocity)
    if len(path) == 1 and speed < 1e-3:
        return hold(reference.position, effect_ns, reference.heading)
    along = share = 0.0
    if len(path) > 1:
        direction = (path[1] - path[0]) / norm(path[1] - path[0])
        along = max(float((reference.velocity * direction).sum()), 0.0)
        share = along / speed if speed >= 1e-3 else 0.0
        if planar and speed < 1e-3:
            heading = arc_tangent(float(direction[1]), float(direction[0]))
            if abs(wrap_angle(heading - reference.heading)) > TURN_FIRST_RAD:
                return turn_in_place(
                    reference.position,
                    effect_ns,
                    reference.heading,
                    heading,
                    limits,
                    yaw_rate=reference.yaw_rate,
                )
        corner = first_stop(path, 0.0, MAX_CORNER_RAD)
        if STILL_M < corner < arc_lengths(path)[-1]:
            path = truncate(path, corner)
    start = PathState(
        effect_ns,
        arc_length=0.0,
        speed=along,
        acceleration=share * acceleration,
        heading=reference.heading,
        yaw_rate=reference.yaw_rate,
    )
    speed = waypoints.speed or limits.speed
    return follow_path(path, start, limits, speed, sideways_speed=sideways_speed)


def _sampled(
    samples: Samples, references: tuple[Reference, Reference], effect_ns: int, planar: bool
) -> Trajectory:
    """Return a trajectory through samples, straight and even in between."""
    positions = checked_points("samples.positions", samples.positions)
    headings = np.array(samples.headings, np.float64)
    if headings.shape != (len(positions),) or not (np.abs(headings) <= MAX_HEADING_RAD).all():
        raise MotionError(
            f"samples.headings: got shape {headings.shape}, expected ({len(positions)},), each "
            f"within {MAX_HEADING_RAD:g} rad"
        )
    if not 1e-3 <= samples.period_s <= 10.0:
        raise MotionError(f"samples.period_s: got {samples.period_s:g}, expected 0.001 to 10 s")
    if planar:
        positions[:, 2] = references[0].position[2]
    refuse_elsewhere(positions[0], references)
    return _joined(effect_ns, positions, headings, samples.period_s)


def _joined(start_ns: int, positions: Array, headings: Array, period_s: float) -> Trajectory:
    """Return positions (k, 3) and headings (k,) at even times as a trajectory."""
    steps = np.sqrt(np.square(np.diff(positions, axis=0)).sum(axis=1))
    arcs = np.concatenate([[0.0], np.cumsum(steps)])
    kept = np.append(True, steps > STILL_M)
    path = positions[kept]
    motion = ramped(arcs, period_s) if arcs[-1] > STILL_M else at_rest(0.0)
    turns = len(headings) > 1 and bool(np.ptp(headings) > 0.0)
    turning = ramped(headings, period_s) if turns else at_rest(float(headings[-1]))
    if arcs[-1] <= STILL_M:
        path = positions[:1]
    return Trajectory(start_ns, path, motion, turning)


def _without_repeats(points: Array) -> Array:
    moved = np.sqrt(np.square(np.diff(points, axis=0)).sum(axis=1)) > STILL_M
    kept: Array = points[np.append(True, moved)]
    return kept
