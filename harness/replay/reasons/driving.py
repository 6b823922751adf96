"""Predicates of a robot that follows a path to its goal."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from wayproof.harness.behaviour_config import MAX_CORNER_ANGLE
from wayproof.harness.geometry import wrap_angle
from wayproof.harness.log.paths import arc_at, length
from wayproof.harness.replay.reasons.along import (
    NEAR,
    directions_near,
    heading_of_body,
    nearest,
    same,
    same_arc,
    turn_at,
)
from wayproof.harness.replay.reasons.overlap import free_before, obstructed
from wayproof.harness.replay.reasons.past import STILL, Past
from wayproof.harness.replay.reasons.scene import Scene
from wayproof.harness.replay.reasons.stopping import stop_from, stops
from wayproof.harness.schema import wayproof_pb2 as pb

LEADS_AT, LEADS_LONG_AT = 0.2, 0.1
"""Arc length at which a path leads somewhere, at most half of its length, m: of a round body, and
of a long one. A path may bend before, where the body has turned already.
"""

LEADS_WITHIN = 0.06
"""Distance of a segment of a thinned path from that place, m: a step of a path is 5 cm."""

TURNED_INTO = 0.5
"""Tolerance of the direction of a segment of a thinned path, rad."""

TURNED = 0.35
"""Tolerance of the direction of a thinned path, and of the heading of a body, rad.
"""

PAST_CORNER = 0.03
"""Distance beyond a corner within which a long body that stops still turns into it, m."""

SPEED_SLACK = 1.05
"""Tolerance factor of speeds, read from samples 0.1 s apart."""

LEAST_SPEED = 0.02
"""Speed below which nothing slows a body down, m/s."""

STEP_LEFT = 0.01
"""Tolerance of what is left of a step, m: a trajectory is logged every 0.1 s."""


def path_to_goal(scene: Scene, past: Past, reason: pb.Reason) -> Iterator[str]:
    """Check that all of the path is admitted, and it ends where stated."""
    yield from _path_ends(scene, reason)
    if not len(scene.global_path):
        return
    yield from free_before(scene, scene.global_path, math.inf)
    if not scene.mission.discs:
        yield from same("path_m", reason.path_m, length(scene.path))


def braking_to_goal(scene: Scene, past: Past, reason: pb.Reason) -> Iterator[str]:
    """Check that the path to its end is no longer than the robot needs to stop."""
    yield from path_to_goal(scene, past, reason)
    yield from stops(scene, reason)
    if reason.path_m - reason.stop_m > 0.011:
        yield f"{reason.path_m:.2f} m are left, and {reason.stop_m:.2f} m are enough to stop"


def path_to_corner(scene: Scene, past: Past, reason: pb.Reason) -> Iterator[str]:
    """Check that the committed part ends at a corner too sharp to take in motion."""
    yield from _path_ends(scene, reason)
    yield from _committed(scene, reason.free_m, PAST_CORNER)
    if not reason.free_m < reason.path_m or not len(scene.global_path):
        yield "the corner is not on the path"
        return
    # A thinned path may leave a corner out: of the committed part, where that ends, or near its own
    # begin, where the one before it has it.
    ways = [way for way in (scene.way_ahead, past.way) if len(way) > 1]
    ends = [nearest(way, scene.path[-1], scene)[0] for way in ways]
    if scene.mission.discs:  # which may fit along less than what leads to the corner
        begins = [nearest(way, scene.path[0], scene)[0] for way in ways]
        ends = [begin + reason.free_m for begin in begins]
    turn = max(turn_at(way, scene.path, end) for way, end in zip(ways, ends, strict=True))
    if turn < MAX_CORNER_ANGLE - TURNED:
        yield f"the path turns by {turn:.2f} rad at {reason.free_m:.2f} m, which is no corner"


def driving_ahead(scene: Scene, past: Past, reason: pb.Reason) -> Iterator[str]:
    """Check that the way is free up to a cell, which makes the robot slow."""
    yield from obstructed(scene, reason, scene.way_ahead, scene.unknown_blocks)
    yield from _committed(scene, reason.free_m)
    limits = scene.mission
    full = stop_from(limits.max_speed * scene.config.motion.speed_fraction, limits)
    yield from same("full_speed_stop_m", reason.full_speed_stop_m, full, 0.01)
    slow = reason.free_m < reason.full_speed_stop_m or _costs_speed(reason)
    rounded = reason.free_m == reason.full_speed_stop_m  # which may have been the less
    if (scene.decision.action == "slow") != slow and not rounded:
        yield f"action {scene.decision.action}, with {reason.free_m:.2f} m admitted"


def _costs_speed(reason: pb.Reason) -> bool:
    """Return whether the pose, or the ranges, are too uncertain for full speed."""
    return reason.HasField("sigma_m") or reason.HasField("range_sigma_m")


def through_unknown(scene: Scene, past: Past, reason: pb.Reason) -> Iterator[str]:
    """Check that the way leads through unknown space, as the policy allows, slowly.

    A long body that fits along less of it may come to rest before.
    """
    yield from obstructed(scene, reason, scene.way_ahead, unknown_blocks=True)
    if scene.config.costmap.unknown_policy != "penalize":
        yield f"unknown policy {scene.config.costmap.unknown_policy}"
    share = scene.config.behaviour.unknown_speed_fraction
    yield from same("speed_share", reason.speed_share, share)
    if not scene.mission.discs and reason.free_m > length(scene.path) + NEAR:
        yield "what is unknown lies beyond the committed part"
    yield from _slowed_at(scene, reason.free_m, share)


def _slowed_at(scene: Scene, free: float, share: float) -> Iterator[str]:
    """Check that the body is slow from an arc length on, m, unless it could not stop before."""
    limits, decision = scene.mission, scene.decision
    full = limits.max_speed * scene.config.motion.speed_fraction
    spare = free - stop_from(full, limits)
    slow = spare < 0.0 or _costs_speed(decision.predicate)
    if (decision.action == "slow") != slow and abs(spare) > NEAR:
        yield f"action {decision.action}, with {free:.2f} m known"
    arcs = np.array(decision.trajectory.arc_length)
    speeds = np.diff(arcs) / decision.trajectory.sample_period_s
    beyond = speeds[arcs[:-1] >= free].max(initial=0.0)
    could = len(speeds) and stop_from(float(speeds[0]) * SPEED_SLACK, limits) <= free
    if could and beyond > max(share * full, LEAST_SPEED) * SPEED_SLACK:
        yield f"{beyond:.2f} m/s where space is unknown"


def turning_into_path(scene: Scene, past: Past, reason: pb.Reason) -> Iterator[str]:
    """Check that the body stays in its place and turns to where the path leads."""
    if length(scene.path) >= STILL:
        yield "the trajectory leaves its place"
    long = bool(scene.mission.discs)  # which may move tail first
    towards = heading_of_body(scene.decision) + reason.turn_rad
    at = min(LEADS_LONG_AT if long else LEADS_AT, 0.5 * length(scene.global_path))
    leads = directions_near(scene.global_path, at, LEADS_WITHIN) or [0.0]  # it stands on its end
    turns = [towards - one - tail for one in leads for tail in ((0.0, math.pi) if long else (0.0,))]
    off = min(abs(wrap_angle(turn)) for turn in turns)
    if off > TURNED_INTO:
        yield f"the path leads {off:.2f} rad off where it turns to"


def stepping_aside(scene: Scene, past: Past, reason: pb.Reason) -> Iterator[str]:
    """Check that the body moves as far as stated along its path, and does not turn."""
    yield from same("distance_m", reason.distance_m, length(scene.path))
    headings = scene.decision.trajectory.heading
    if max(headings) - min(headings) > TURNED_INTO:
        yield "the body turns"
    if len(scene.global_path) < 2 or scene.apart(scene.global_path[0], scene.path[0]) > NEAR:
        yield "the trajectory does not begin on the path"


def stepping_to_pose(scene: Scene, past: Past, reason: pb.Reason) -> Iterator[str]:
    """Check that so much of the step and of its turn is left, and that it follows no path."""
    trajectory = scene.decision.trajectory
    left = length(scene.path) - arc_at(trajectory, scene.effect_ns)
    yield from same("distance_m", reason.distance_m, left, STEP_LEFT)
    towards = heading_of_body(scene.decision) + reason.turn_rad
    off = abs(wrap_angle(trajectory.heading[-1] - towards))
    if off > TURNED_INTO:
        yield f"the trajectory ends {off:.2f} rad off where it turns to"
    if len(scene.global_path):
        yield "it follows a path"


def keeping_course(scene: Scene, past: Past, reason: pb.Reason) -> Iterator[str]:
    """Check that the trajectory is the last one."""
    last = past.trajectories[-1] if past.trajectories else None
    if last is None or last.path != scene.decision.trajectory.path:
        yield "the trajectory is another one than the last"


def _path_ends(scene: Scene, reason: pb.Reason) -> Iterator[str]:
    """Check that the way is as long as stated, and ends as near to the goal."""
    if not len(scene.global_path):
        yield "it names no path"
        return
    yield from same("path_m", reason.path_m, scene.decision.path_length_m)
    yield from same_arc("path_m", reason.path_m, length(scene.global_path))
    if (scene.decision.action == "slow") != _costs_speed(reason):
        yield f"action {scene.decision.action} on a path that is admitted"
    beside = scene.apart(scene.global_path[-1], scene.goal)
    yield from same("short_m", reason.short_m, beside, 0.011)


def _committed(scene: Scene, free: float, beyond: float = 0.0) -> Iterator[str]:
    """Check that the committed part is that long; a long body may fit along less of it.

    Args:
        scene: Decision and map.
        free: Length stated, m.
        beyond: Length that a long body may take more to stop, m.
    """
    committed = length(scene.path)
    if scene.mission.discs:
        if committed > free + beyond + NEAR:
            yield f"{free:.3f} m are free, {committed:.3f} m committed"
        return
    yield from same("free_m", free, committed)
