"""Keeping and renewing the guide: the path to the goal through what is not known to be blocked."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from wayproof.harness.inputs import heading_of
from wayproof.harness.stack.types import Array, Memory, View, distance, length, standing
from wayproof.planners import (
    Plan,
    TrajectorySample,
    blend_corners,
    plan_seed,
    remaining,
    stopping_distance,
    tangent_at,
    truncate,
)

ARRIVED = 0.05
"""A path shorter than this is driven, m."""

MOVED = 3.0
"""A goal's place that moves by more than so many cells is another one."""

HEADINGS = np.linspace(0.0, np.pi, 8, endpoint=False)
"""At which a goal is tried: a body that is free at one is free at the opposite one, rad."""


def place_for_goal(view: View) -> Array:
    """The goal, or where it lies inside the inflation the nearest place that does not."""
    space, reach = view.passable, view.behaviour.goal_reach
    if not space.discs:
        nearest = view.goal if space.is_free(view.goal) else space.nearest_free(view.goal, reach)
        return view.goal if nearest is None else nearest
    if any(space.pose_free(view.goal, heading) for heading in HEADINGS):
        return view.goal
    pose = space.nearest_pose(view.goal, reach, HEADINGS)
    return view.goal if pose is None else pose[:3]


def keep_or_replan_guide(
    view: View, memory: Memory, now: TrajectorySample
) -> tuple[Memory, Plan | None, int]:
    """The guide from where the robot will be: kept while it is valid and none is much cheaper.

    Returns:
        The memory with its guide, the search made if any, and its seed.
    """
    guide = None if memory.guide is None else remaining(memory.guide, now.arc_length)
    if memory.on_errand and guide is not None and length(guide) < ARRIVED:
        guide = None
    valid = guide is not None and view.passable.free_length(guide) >= length(guide) - 1e-6
    if guide is not None and not memory.on_errand:  # the goal has become free, or is no longer
        valid = valid and distance(guide[-1], view.goal) <= MOVED * view.passable.resolution
    improve_due = view.time_ns - memory.improved_ns >= view.behaviour.improve_period * 1e9
    if valid and not improve_due:
        return replace(memory, guide=guide), None, 0
    prefix = _prefix_to_keep(view, now, guide)
    if prefix is None:
        if valid:  # it is too late to bend it, as where the robot brakes to its end
            return replace(memory, guide=guide), None, 0
        return replace(memory, guide=None, errand=None), None, 0
    seed = plan_seed(view.seed, "guide", view.sequence)
    only_known = valid and memory.on_errand
    search, fresh = _search(view, prefix, now.heading, seed, only_known, anew=guide is None)
    if valid and guide is not None and not _better(view, memory, fresh, guide):
        return replace(memory, guide=guide, improved_ns=view.time_ns), search, seed
    return replace(memory, guide=fresh, errand=None, improved_ns=view.time_ns), search, seed


def _prefix_to_keep(view: View, now: TrajectorySample, guide: Array | None) -> Array | None:
    """The stretch that the robot will drive before a new path can bend it; none if it is blocked.

    It is as long as the robot takes to stop, so that a stop on the old path always remains.
    """
    if standing(now):
        return now.position[None]
    if guide is None:
        return None
    admitted = view.admitted.free_length(guide)
    braking = stopping_distance(now.speed, now.acceleration, view.limits)
    if admitted < braking:
        return None
    return truncate(guide, min(braking, length(guide)))


def _search(
    view: View, prefix: Array, heading: float, seed: int, only_known: bool, anew: bool
) -> tuple[Plan, Array | None]:
    """Plan from the prefix's end: through known space if that reaches the goal, else beyond it.

    Beyond known space, with no guide to improve on, a way may lead anywhere: nothing is spared.
    """
    straight = _straight_on(view, prefix)
    if len(straight) > 1:
        heading = heading_at(straight, length(straight))
    elif len(prefix) > 1:
        heading = heading_at(prefix, length(prefix))
    space = view.known
    search = view.plan(space, straight[-1], view.goal, view.planner, seed, heading)
    if search.waypoints is None and not only_known:
        space = replace(view.passable, sparing=not anew)
        search = view.plan(space, straight[-1], view.goal, view.planner, seed, heading)
    if search.waypoints is None:
        return search, None
    waypoints = apart(np.concatenate([straight[:-1], search.waypoints]))
    blended = blend_corners(space, waypoints, view.behaviour.blend_length)
    return search, np.concatenate([prefix[:-1], blended])


def _straight_on(view: View, prefix: Array) -> Array:
    """From the prefix's end straight on for the length of a blend, as far as that is admitted.

    A new path that begins there leaves the prefix without a corner, and the corner that it makes
    with the straight piece has room to be blended.
    """
    end = prefix[-1]
    tangent = tangent_at(prefix, length(prefix))
    for share in (1.0, 0.5, 0.25):
        beyond = end + share * view.behaviour.blend_length * tangent
        if len(prefix) > 1 and _straight_free(view, end, beyond):
            return np.stack([end, beyond])
    return prefix[-1:]


def _straight_free(view: View, a: Array, b: Array) -> bool:
    if not view.admitted.discs:
        return view.admitted.edge_free(a, b)
    return view.admitted.free_length(np.stack([a, b])) > 0.0


def heading_at(path: Array, s: float) -> float:
    """Heading of a path at an arc length, rad."""
    tangent = tangent_at(path, s)
    return heading_of(tangent[1], tangent[0])


def apart(waypoints: Array) -> Array:
    """Way points without those that repeat the one before: there the body turns."""
    moved = np.abs(np.diff(waypoints, axis=0)).max(axis=1) > 1e-9
    if not moved.any():
        return waypoints
    kept: Array = waypoints[np.append(True, moved)]
    return kept


def _better(view: View, memory: Memory, fresh: Array | None, guide: Array) -> bool:
    """Whether a new guide replaces a valid one; any way to the goal is better than an errand."""
    if fresh is None or memory.on_errand:
        return fresh is not None
    weight = view.planner.clearance_weight
    costs = (view.passable.path_cost(path, weight) for path in (fresh, guide))
    return view.planner.replaces(*costs)
