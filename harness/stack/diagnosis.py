"""Which reason a choice has, with its figures."""

from __future__ import annotations

from typing import Any, NamedTuple

from wayproof.harness.stack import obstruction
from wayproof.harness.stack.decision import Action, Label
from wayproof.harness.stack.footprint_checks import CHECK_STEP, wrapped
from wayproof.harness.stack.global_path import ARRIVED
from wayproof.harness.stack.obstruction import Obstruction
from wayproof.harness.stack.reasons import Kind, Reason
from wayproof.harness.stack.types import Array, Memory, View, distance, length, standing
from wayproof.planners import (
    Plan,
    Trajectory,
    TrajectorySample,
    remaining,
    stopping_distance,
    truncate,
)

BRAKING = 0.01
"""Who has no more than so much beyond what it takes to stop is braking, m."""

SHORT = 0.01
"""A path that ends so near to the goal ends there, m."""


class Kinds(NamedTuple):
    """What a reason is called by what ends the way ahead."""

    unknown: Kind
    blocked: Kind


DRIVING = Kinds("unknown_ahead", "blocked_ahead")
BRAKES = Kinds("braking_before_unknown", "braking_before_blocked")
WAITS = Kinds("waiting_before_unknown", "waiting_before_blocked")


def ahead(kinds: Kinds, found: Obstruction, **figures: Any) -> tuple[Reason, Label]:
    """A reason that names what is unknown or blocked on the way ahead."""
    if found.cell_state == "unknown":
        return _of(kinds.unknown, found, free_m=found.free_m, **figures), "unknown_ahead"
    return _of(kinds.blocked, found, free_m=found.free_m, **figures), "path_blocked"


def inside(kind: Kind, found: Obstruction, **figures: Any) -> Reason:
    """A reason of a body, or of a goal, inside the inflation of a cell."""
    return _of(kind, found, **figures)


def _of(kind: Kind, found: Obstruction, **figures: Any) -> Reason:
    return Reason(kind, cell=found.cell, cell_state=found.cell_state, place=found.place, **figures)


def why_it_drives(
    view: View,
    memory: Memory,
    now: TrajectorySample,
    guide: Array,
    end: float,
    blocked: bool,
    slowed: bool,
) -> tuple[Action, Reason, Label]:
    """Of a robot that follows its guide to an end.

    Args:
        view: Of the decision.
        memory: Whether the guide leads to the goal.
        now: Where the robot will be.
        guide: (n, 3) m.
        end: How far it is followed, m.
        blocked: Whether what the body may not enter ends it.
        slowed: Whether unknown space on it costs speed.
    """
    if slowed:
        path = truncate(guide, end)
        found = obstruction.on_path(view, path, view.known.free_length(path), unknown_blocks=True)
        share = view.behaviour.penalized_speed
        reason = _of("through_unknown", found, free_m=found.free_m, speed_share=share)
        action: Action = "slow"
        label: Label = "unknown_ahead"
    elif blocked:
        found = obstruction.on_path(view, guide, end, view.unknown_blocks)
        needed = stopping_distance(view.limits.speed, 0.0, view.limits)
        reason, label = ahead(DRIVING, found, full_speed_stop_m=needed)
        action = "slow" if end < needed else "follow"
    else:
        action, reason, label = "follow", _whole_way(view, now, guide, end), "none"
    if memory.errand is not None:
        action, reason = errand_reason(memory, guide)
    return action, reason, label


def _whole_way(view: View, now: TrajectorySample, guide: Array, end: float) -> Reason:
    """All of it is admitted, to its end or to a corner."""
    whole = length(guide)
    goal = view.goal if view.mission_goal is None else view.mission_goal
    beside = distance(guide[-1], goal)
    short = beside if beside > SHORT else None
    if end < whole:
        return Reason("path_to_corner", free_m=end, path_m=whole, short_m=short)
    stop = stopping_distance(now.speed, now.acceleration, view.limits)
    if not standing(now) and whole - stop < BRAKING:
        return Reason("braking_to_goal", path_m=whole, stop_m=stop, short_m=short)
    return Reason("path_to_goal", path_m=whole, short_m=short)


def errand_reason(memory: Memory, guide: Array) -> tuple[Action, Reason]:
    """Of a robot on its way to a place to look from."""
    assert memory.errand is not None
    x, y, z = guide[-1].tolist()
    left, since, to = length(guide), memory.errand.since, (x, y, z)
    if memory.errand.backing_up:
        return "recover", Reason("backing_up", path_m=left, since=since, target=to)
    places = len(memory.visited)
    found = Reason("looking_elsewhere", path_m=left, since=since, target=to, places=places)
    return "explore", found


def why_no_path(view: View, search: Plan) -> Reason:
    """Of a robot for which no path to the goal was found."""
    if search.label == "goal_blocked":
        found = obstruction.at_place(view, view.goal, 0.0, unknown_blocks=False)
        return inside("goal_blocked", found, limit_m=view.behaviour.goal_reach)
    exhaustive = view.planner.name == "field" and not view.admitted.discs
    if exhaustive and search.label == "no_path" and search.iterations < view.planner.iterations:
        return Reason("no_path_in_map", iterations=search.iterations)
    return Reason("no_path_found", iterations=search.iterations)


def why_without_path(view: View, before: Memory, now: TrajectorySample) -> tuple[Reason, Label]:
    """Of a robot in motion that has given up its path, in this decision or in an earlier one.

    Args:
        view: Of the decision.
        before: What it remembered before.
        now: Where it will be.
    """
    if before.guide is None:
        return _still_without(view, before)
    guide = remaining(before.guide, now.arc_length)
    if before.on_errand and length(guide) < ARRIVED:
        return Reason("at_viewpoint", path_m=0.0), "none"
    stop = stopping_distance(now.speed, now.acceleration, view.limits)
    free = view.admitted.free_length(guide)
    if free < min(stop, length(guide) - 1e-6):  # no stretch of it is left that could be bent
        found = obstruction.on_path(view, guide, free, view.unknown_blocks)
        return ahead(BRAKES, found, stop_m=stop)
    x, y, z = view.goal.tolist()
    moved = distance(guide[-1], view.goal)
    return Reason("goal_place_moved", distance_m=moved, stop_m=stop, target=(x, y, z)), "none"


def _still_without(view: View, before: Memory) -> tuple[Reason, Label]:
    """The decision that gave the path up is an earlier one."""
    given_up = before.given_up
    if given_up is None:  # nobody who moves without a path has always been without one
        return Reason("coming_to_rest", path_m=0.0, since=view.sequence), "none"
    if given_up.kind == "at_viewpoint":
        return Reason("at_viewpoint", path_m=0.0, since=given_up.sequence), "none"
    return Reason("coming_to_rest", path_m=0.0, since=given_up.sequence), given_up.label


def why_no_room(view: View, now: TrajectorySample, along: Trajectory, target: float) -> Reason:
    """Of a long body that can neither turn into its path nor follow it as it stands."""
    turn = wrapped(target - now.heading)
    found = obstruction.on_turn(view, now.position, now.heading, now.heading + turn)
    if found.cell is not None:
        return _of("no_room_to_turn", found, turn_rad=turn)
    found = obstruction.on_poses(view, along.poses(CHECK_STEP), view.unknown_blocks)
    return _of("no_room_along_path", found, free_m=found.free_m)
