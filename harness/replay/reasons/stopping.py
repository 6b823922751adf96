"""Predicates of a robot that stops, has stopped at its goal, or was late."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np

from wayproof.harness.log.paths import length
from wayproof.harness.replay.reasons.along import NEAR, left_of, point_of, same, same_arc
from wayproof.harness.replay.reasons.overlap import obstructed
from wayproof.harness.replay.reasons.past import Past
from wayproof.harness.replay.reasons.scene import Scene
from wayproof.harness.schema import wayproof_pb2 as pb

KEPT_SHORT = 0.02
"""Distance that a long body keeps before the first place where it does not fit, m."""

POSE_PERIOD = 0.02
"""Time between the poses of a trajectory at which a long body is checked, s."""


def braking_ahead(scene: Scene, past: Past, reason: pb.Reason) -> Iterator[str]:
    """Check that the last way ends at a cell before the robot could stop for a new one."""
    blocked = reason.kind == "braking_before_blocked"
    yield from obstructed(scene, reason, past.way, scene.unknown_blocks and not blocked)
    yield from stops(scene, reason)
    if reason.free_m > reason.stop_m + _kept_short(scene):
        yield f"{reason.free_m:.2f} m are free, and {reason.stop_m:.2f} m enough to stop"


def _kept_short(scene: Scene) -> float:
    """Return the distance that a long body keeps before the first pose that does not fit, m.

    Its poses are checked one by one, so the last that fits is up to one step before that.
    """
    return 0.0 if scene.wide else KEPT_SHORT + POSE_PERIOD * scene.mission.max_speed


def path_too_short(scene: Scene, past: Past, reason: pb.Reason) -> Iterator[str]:
    """Check that the rest of the last way is shorter than the robot needs to stop."""
    yield from stops(scene, reason)
    if reason.path_m > reason.stop_m:
        yield f"{reason.path_m:.2f} m are left, and {reason.stop_m:.2f} m enough to stop"
    yield from same_arc("path_m", reason.path_m, left_of(past.way, scene.path[0]))


def goal_place_moved(scene: Scene, past: Past, reason: pb.Reason) -> Iterator[str]:
    """Check that the last way ends elsewhere than at the goal of now, or its projection."""
    yield from stops(scene, reason)
    target = point_of(reason.target)
    yield from same("distance_m", reason.distance_m, scene.apart(past.way[-1], target))
    if reason.distance_m <= 3.0 * scene.size:
        yield f"{reason.distance_m:.2f} m is no other place"
    if scene.apart(target, scene.goal) > scene.config.behaviour.goal_search_radius + scene.size:
        yield "its place is not near the goal"


def coming_to_rest(scene: Scene, past: Past, reason: pb.Reason) -> Iterator[str]:
    """Check that the robot stops, and that no decision since the stated one has had a path."""
    yield from same("path_m", reason.path_m, length(scene.path))
    steps = past.since(reason.since, scene.decision.sequence)
    if not steps:
        yield f"there is no earlier decision {reason.since}"
        return
    if steps[0].action not in ("stop_and_wait", "recover"):
        yield f"decision {reason.since} had a path: {steps[0].kind}"
    if steps[0].label != scene.decision.label:
        yield f"label {scene.decision.label}, that of decision {reason.since} is {steps[0].label}"
    others = {one.kind for one in steps[1:]} - {"coming_to_rest", "deadline_missed"}
    if others:
        yield f"since decision {reason.since} there was {', '.join(sorted(others))}"


def at_goal(scene: Scene, past: Past, reason: pb.Reason) -> Iterator[str]:
    """Check that the robot is at rest, near enough to the goal."""
    here = np.array(scene.decision.position)
    yield from same("distance_m", reason.distance_m, scene.apart(here, scene.goal))
    yield from same("limit_m", reason.limit_m, 0.8 * scene.config.episode.goal_tolerance)
    if reason.distance_m > reason.limit_m:
        yield "that is too far"
    time_ns = scene.decision.timestamp.ToNanoseconds()
    followed = past.followed(time_ns)
    if followed is not None:
        end_ns = followed.start.ToNanoseconds() + followed.duration_s * 1e9
        if end_ns > time_ns + 1:
            yield f"its trajectory goes on for {(end_ns - time_ns) * 1e-9:.2f} s"


def deadline_missed(scene: Scene, past: Past, reason: pb.Reason) -> Iterator[str]:
    """Check that the decision came late, and the trajectory is the last one."""
    yield from same("delay_s", reason.delay_s, scene.decision.delay_s)
    yield from same("deadline_s", reason.deadline_s, scene.config.latency.deadline)
    if not reason.delay_s > reason.deadline_s:
        yield "that is in time"
    last = past.trajectories[-1] if past.trajectories else scene.decision.trajectory
    if last.path != scene.decision.trajectory.path:
        yield "the trajectory is another one than the last"
    end_ns = last.start.ToNanoseconds() + last.duration_s * 1e9
    over = scene.decision.timestamp.ToNanoseconds() >= end_ns - 1
    if (scene.decision.action == "stop_and_wait") != over:
        yield f"action {scene.decision.action}, while the last trajectory {'is over' * over}"


def stops(scene: Scene, reason: pb.Reason) -> Iterator[str]:
    """Check that the stated stopping distance is that of the trajectory."""
    yield from same("stop_m", reason.stop_m, length(scene.path), 0.012)
    arcs = np.array(scene.decision.trajectory.arc_length)
    period, limits = scene.decision.trajectory.sample_period_s, scene.mission
    speeds = np.diff(np.append(arcs, np.repeat(arcs[-1], 2))) / period
    speed = float(speeds[0])
    # An accelerating body gains speed until its jerk has undone the acceleration.
    rise = float(speeds[1] - speeds[0]) / period + limits.max_jerk * period
    rise = min(max(rise, 0.0), limits.max_acceleration)
    faster = speed + 2.0 * period * limits.max_acceleration + rise**2 / (2.0 * limits.max_jerk)
    if reason.stop_m > stop_from(faster, limits) + faster * rise / limits.max_jerk + NEAR:
        yield f"from {speed:.2f} m/s it could stop in less than {reason.stop_m:.2f} m"


def stop_from(speed: float, limits: Any) -> float:
    """Return the length of a jerk-limited stop from a constant speed, m."""
    if speed * limits.max_jerk >= limits.max_acceleration**2:
        ramp = limits.max_acceleration / limits.max_jerk
        return float(0.5 * speed * (speed / limits.max_acceleration + ramp))
    return float(speed * math.sqrt(speed / limits.max_jerk))
