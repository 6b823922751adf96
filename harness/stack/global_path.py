"""The global path: kept while it is valid, and replanned through space not known to be blocked."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from wayproof.harness.geometry import atan2_rounded
from wayproof.harness.stack.path_timing import fastest_found, travel_time
from wayproof.harness.stack.prices import (
    discounted_space,
    enough_admitted,
)
from wayproof.harness.stack.state import PlannerState, Route
from wayproof.harness.stack.types import (
    Array,
    PlannerInput,
    arc_length,
    distance,
    is_free_along,
    is_stationary,
)
from wayproof.planners import (
    FreeSpace,
    Plan,
    TrajectorySample,
    blend_corners,
    plan,
    plan_seed,
    remaining,
    stopping_distance,
    tangent_at,
    truncate,
    without_hooks,
)

ARRIVED = 0.05
"""Length below which a path counts as driven, m."""

STOP_SLACK = 1e-3
"""Length by which the rest of a stop may be shorter than a stop from there, by rounding, m."""

LEAST_STOP = 0.1
"""Length of a stop below which a walking robot needs no straight piece to bend off its path, m."""

GOAL_MOVED = 3.0
"""Distance beyond which a projected goal counts as another one, cells."""

LEAST_SAVING = 0.2
"""Time that a path of about the same cost has to save to replace a valid one, s."""

HEADINGS = np.linspace(0.0, np.pi, 8, endpoint=False)
"""Headings that a goal is tried at, rad; a body that is free at one is free at the opposite one."""


class GlobalPlan(NamedTuple):
    """The result of keeping or replanning the global path.

    Attributes:
        state: Planner state with the global path from the start of the new trajectory on, or none.
        search: The search made, if any.
        seed: Its seed, 0 if none.
    """

    state: PlannerState
    search: Plan | None = None
    seed: int = 0


def project_goal_to_free(input: PlannerInput) -> Array:
    """Return the goal (3,); if inside the inflation, the nearest position outside."""
    space, reach = input.optimistic, input.behaviour.goal_search_radius
    if not space.discs:
        if space.is_free(input.goal):
            return input.goal
        nearest = space.nearest_free(input.goal, reach)
        return input.goal if nearest is None else nearest
    if any(space.pose_free(input.goal, heading) for heading in HEADINGS):
        return input.goal
    pose = space.nearest_pose(input.goal, reach, HEADINGS)
    return input.goal if pose is None else pose[:3]


def keep_or_replan(input: PlannerInput, state: PlannerState, start: TrajectorySample) -> GlobalPlan:
    """Keep the global path while it is valid and no other is much cheaper; else replan it."""
    rest = None if state.route is None else state.along(remaining(state.path, start.arc_length))
    if rest is not None and arc_length(rest.path) < ARRIVED and _replans_at_end(state, start):
        rest = None
    kept = rest if rest is not None and _is_valid(input, rest) else None
    if kept is not None and not _is_improvement_due(input, kept):
        return GlobalPlan(kept)
    if rest is not None:
        prefix = _prefix_to_keep(input, start, rest.path, slack=0.0)
    else:  # on from the stop that is under way
        stop = remaining(state.trajectory.path, start.arc_length)
        prefix = _prefix_to_keep(input, start, stop, slack=STOP_SLACK)
    if prefix is None:  # if the path is valid, it is too late to bend it, as where it ends
        return GlobalPlan(replace(state, route=None) if kept is None else kept)
    seed = plan_seed(input.config.seed, "guide", input.sequence)
    search, found = fastest_found(
        input,
        start,
        prefix,
        lambda beginning: _replan(
            input,
            beginning,
            start.heading,
            seed,
            only_known=kept is not None and kept.exploring,
        ),
    )
    if kept is not None and not _is_better(input, kept, start, found):
        state = kept.searched(input.time_ns)
    else:
        state = replace(state, route=None if found is None else Route(found, input.time_ns))
    return GlobalPlan(state, search, seed)


def _is_improvement_due(input: PlannerInput, state: PlannerState) -> bool:
    assert state.route is not None
    return input.time_ns - state.route.improved_ns >= input.gait.replan_period * 1e9


def _replans_at_end(state: PlannerState, start: TrajectorySample) -> bool:
    """Return whether the goal is planned for again at the end of the path.

    It is at a viewpoint, and where a robot rests beside a goal that has become free since.
    """
    return state.exploring or is_stationary(start)


def _is_valid(input: PlannerInput, state: PlannerState) -> bool:
    """Return whether the path is not known to be blocked, and leads to the goal or a viewpoint."""
    path = state.path
    valid = is_free_along(input.optimistic, path)
    if state.exploring:
        return valid
    return valid and distance(path[-1], input.goal) <= GOAL_MOVED * input.optimistic.resolution


def _prefix_to_keep(
    input: PlannerInput, start: TrajectorySample, path: Array, slack: float
) -> Array | None:
    """Return the part (n, 3) that the robot drives before a new path can bend off; None if blocked.

    It is as long as the robot takes to stop, so that a stop on the old path always remains. An
    early bend leaves it before (see `path_timing`).
    """
    if is_stationary(start):
        return start.position[None]
    traversable = input.traversable.free_length(path)
    braking = stopping_distance(start.speed, start.acceleration, input.gait.limits)
    if traversable < braking - slack:
        return None
    return truncate(path, min(braking, arc_length(path)))


def _replan(
    input: PlannerInput,
    prefix: Array,
    heading: float,
    seed: int,
    only_known: bool,
) -> tuple[Plan, Array | None]:
    """Plan from the prefix's end: through known space if that reaches the goal, else optimistic.

    With evidence that was not measured, as that guides; and without it where it leaves no way. A
    robot that flies first tries what it will see in time (see `prices`).

    Args:
        input: Planner input of the decision.
        prefix: (n, 3) of the path that is kept, m.
        heading: Heading of the body at its beginning, rad.
        seed: Seed of the search.
        only_known: Whether only a path through known space is of use.

    Returns:
        The search, and the path (m, 3) with the prefix, or None.
    """
    straight = _straight_on(input, prefix)
    if len(straight) > 1:
        heading = heading_at(straight, arc_length(straight))
    elif len(prefix) > 1:
        heading = heading_at(prefix, arc_length(prefix))

    def plan_in(space: FreeSpace) -> Plan:
        return plan(space, straight[-1], input.goal, input.planner, seed, heading)

    def joined(search: Plan, space: FreeSpace) -> Array | None:
        return _joined(input, prefix, straight, search, space)

    if input.gait.sees_ahead and not only_known:
        space = discounted_space(input)
        search = plan_in(space)
        path = joined(search, space)
        if path is not None and enough_admitted(input, path):
            return search, path
    for space in _spaces(input, only_known):
        search = plan_in(space)
        if search.waypoints is not None:
            break
    return search, joined(search, space)


def _spaces(input: PlannerInput, only_known: bool) -> Iterator[FreeSpace]:
    """Yield the spaces that are searched, until a way is found; arguments as of `_replan`.

    Beyond known space at once where gaps closed: the way that the robot knows may lead through one.
    """
    if only_known or not input.spaces.avoids_gaps:
        yield input.known_free
    if only_known:
        return
    if input.spaces.guided is not None:
        yield input.spaces.guided
    yield input.optimistic


def _joined(
    input: PlannerInput, prefix: Array, straight: Array, search: Plan, space: FreeSpace
) -> Array | None:
    """Join a prefix, the straight piece and what a search found to a path (n, 3); None if nothing.

    Its corners are rounded as far as they stay in the space that was searched.
    """
    if search.waypoints is None:
        return None
    waypoints = drop_duplicates(np.concatenate([straight[:-1], search.waypoints]))
    if input.gait.in_plane:
        waypoints = without_hooks(space, waypoints)
    blended = blend_corners(space, waypoints, _blend_length(input))
    return np.concatenate([prefix[:-1], blended])


def _straight_on(input: PlannerInput, prefix: Array) -> Array:
    """Return the straight piece (1 or 2, 3) from the prefix's end, a blend long, if traversable.

    A piece of half or a quarter of that length where the whole is not; the end alone without any.
    A new path that begins there leaves the prefix without a corner, and the corner that it makes
    with the straight piece has room to be blended.
    """
    end = prefix[-1]
    if input.gait.in_plane and arc_length(prefix) < LEAST_STOP:
        return prefix[-1:]
    tangent = tangent_at(prefix, arc_length(prefix))
    for share in (1.0, 0.5, 0.25):
        beyond = end + share * _blend_length(input) * tangent
        if len(prefix) > 1 and _straight_free(input, end, beyond):
            return np.stack([end, beyond])
    return prefix[-1:]


def _blend_length(input: PlannerInput) -> float:
    return input.gait.blend_length(input.behaviour.blend_length)


def _straight_free(input: PlannerInput, a: Array, b: Array) -> bool:
    if not input.traversable.discs:
        return input.traversable.edge_free(a, b)
    return input.traversable.free_length(np.stack([a, b])) > 0.0


def heading_at(path: Array, s: float) -> float:
    """Return the heading of a path at an arc length, rad."""
    tangent = tangent_at(path, s)
    return atan2_rounded(tangent[1], tangent[0])


def drop_duplicates(waypoints: Array) -> Array:
    """Return waypoints without those that repeat the one before, which is where the body turns."""
    moved = np.abs(np.diff(waypoints, axis=0)).max(axis=1) > 1e-9
    if not moved.any():
        return waypoints
    distinct: Array = waypoints[np.append(True, moved)]
    return distinct


def _is_better(
    input: PlannerInput, state: PlannerState, start: TrajectorySample, found: Array | None
) -> bool:
    """Return whether a new path replaces a valid one; any way to the goal is better than exploring.

    It is much cheaper; or about as cheap and, from the motion that the robot is in, faster.
    """
    if found is None or state.exploring:
        return found is not None
    path = state.path
    found_cost, cost = _path_costs(input, found, path)
    if input.planner.replaces(found_cost, cost):
        return True
    if input.planner.replaces(cost, found_cost):
        return False
    saved = travel_time(input, start, path) - travel_time(input, start, found)
    return saved > LEAST_SAVING


def _path_costs(input: PlannerInput, found: Array, path: Array) -> tuple[float, float]:
    """Return the costs of a new and a valid path, by guiding evidence if either is free by it."""
    weight = input.planner.clearance_weight
    if input.gait.sees_ahead and all(enough_admitted(input, one) for one in (found, path)):
        space = discounted_space(input)
        found_cost, cost = (space.path_cost(one, weight) for one in (found, path))
        if not found_cost == cost == np.inf:
            return found_cost, cost
    if input.spaces.guided is not None:
        found_cost, cost = (input.spaces.guided.path_cost(one, weight) for one in (found, path))
        if not found_cost == cost == np.inf:
            return found_cost, cost
    return input.optimistic.path_cost(found, weight), input.optimistic.path_cost(path, weight)
