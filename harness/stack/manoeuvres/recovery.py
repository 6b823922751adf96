"""Recoveries of a robot that waits: explore a frontier, backtrack, or give the mission up."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from wayproof.harness.behaviour_config import MIN_ADVANCE
from wayproof.harness.stack.global_path import drop_duplicates
from wayproof.harness.stack.manoeuvres.following import follow
from wayproof.harness.stack.manoeuvres.stopping import seconds_waited
from wayproof.harness.stack.situation import Situation
from wayproof.harness.stack.state import Exploration, PlannerState, Route
from wayproof.harness.stack.types import Array, Decided, PlannerInput, arc_length, distance
from wayproof.planners import (
    Plan,
    TrajectorySample,
    best_frontier,
    blend_corners,
    plan,
    plan_seed,
    truncate,
)

MAX_FRONTIERS = 4
"""Number of frontiers that an elongated body, which cannot get to each, tries to plan to."""

BACKTRACK_LENGTH = 1.0
"""Length of one backtrack, m; chosen: out of reach of what blocked the robot."""

BREADCRUMB_SPACING = 0.1
"""Minimum distance between breadcrumbs, m."""

SPARE_BREADCRUMBS = 2
"""Number of breadcrumbs kept beyond what the longest path back needs."""


def record_breadcrumb(state: PlannerState, input: PlannerInput) -> PlannerState:
    """Append the robot's position to the state if it is a spacing away from the last one."""
    crumbs = state.trails.breadcrumbs
    if len(crumbs) and distance(crumbs[-1], input.position) < BREADCRUMB_SPACING:
        return state
    kept = int(BACKTRACK_LENGTH / BREADCRUMB_SPACING) + SPARE_BREADCRUMBS
    crumbs = np.vstack([crumbs, input.position])[-kept:]
    return replace(state, trails=replace(state.trails, breadcrumbs=crumbs))


@dataclass(frozen=True)
class Wait:
    """A wait, and what a recovery goes by.

    Attributes:
        situation: Situation of the decision.
        decided: The decision to wait.
    """

    situation: Situation
    decided: Decided

    @property
    def seconds(self) -> float:
        """Time for which the robot has waited, s."""
        return seconds_waited(self.situation.input, self.decided.state)

    @cached_property
    def recovering(self) -> PlannerState:
        """The planner state in which the wait is over, and its place one looked from."""
        state = self.decided.state
        viewpoints = np.vstack([state.tries.viewpoints, self.situation.start.position])
        return replace(state, tries=replace(state.tries, viewpoints=viewpoints), rest_since_ns=-1)

    @property
    def seed(self) -> int:
        """Seed of the search for a frontier."""
        return plan_seed(self.situation.input.config.seed, "errand", self.situation.input.sequence)

    @cached_property
    def search(self) -> Plan | None:
        """The path to the best frontier that can be reached; None if no frontier is left."""
        input, start = self.situation.heading_for, self.situation.start
        return _search_frontier(input, start, self.recovering.tries.viewpoints, self.seed)


def wait_for_goal(wait: Wait) -> Decided | None:
    """Wait beside a blocked goal until its own timeout, then give up: there is nowhere to go."""
    if wait.decided.command.reason.kind != "goal_blocked" or not wait.situation.rests_beside_goal:
        return None
    if wait.seconds < wait.situation.input.behaviour.goal_wait_timeout:
        return wait.decided
    command = replace(wait.decided.command, action="abort")
    return wait.decided._replace(command=command)


def wait_on(wait: Wait) -> Decided | None:
    """Wait for the map to change, until the timeout."""
    return wait.decided if wait.seconds < wait.situation.input.behaviour.wait_timeout else None


def abort(wait: Wait) -> Decided | None:
    """Give the mission up: the robot has explored from as many viewpoints as it may."""
    command, state = wait.decided
    places = len(state.tries.viewpoints)
    if places < wait.situation.input.behaviour.max_recoveries:
        return None
    reason = replace(command.reason, places=places)
    return Decided(replace(command, action="abort", reason=reason), state)


def explore_frontier(wait: Wait) -> Decided | None:
    """Leave for the best frontier within reach."""
    search = wait.search
    if search is None or search.waypoints is None:
        return None
    input = wait.situation.heading_for
    path = blend_corners(
        input.traversable, drop_duplicates(search.waypoints), input.behaviour.blend_length
    )
    command, state = _detour(wait, path, Exploration(input.sequence))
    return Decided(replace(command, search=search, search_seed=wait.seed), state)


def backtrack(wait: Wait) -> Decided | None:
    """Go back along the breadcrumbs, to explore from there."""
    input, state = wait.situation.heading_for, wait.recovering
    path = backtrack_path(input, state, wait.situation.start)
    if path is None:
        return None
    command, state = _detour(wait, path, Exploration(input.sequence, backtracking=True))
    waited = wait.decided.command
    command = replace(command, search=waited.search, search_seed=waited.search_seed)
    tries = replace(state.tries, backtracks=state.tries.backtracks + 1)
    return Decided(command, replace(state, tries=tries))


def wait_once_more(wait: Wait) -> Decided:
    """Wait again: there is nowhere to explore."""
    command = wait.decided.command
    frontier = "none" if wait.search is None else "out_of_reach"
    reason = replace(command.reason, frontier=frontier)
    state = replace(wait.recovering, route=None)
    return Decided(replace(command, reason=reason, global_path=None), state)


RECOVERIES = (
    # A wait has its time, and the mission a number of tries; then where something new may be seen
    # is worth more than what was seen before.
    wait_for_goal,
    wait_on,
    abort,
    explore_frontier,
    backtrack,
    wait_once_more,
)
"""What a robot that waits does, by precedence."""


def _detour(wait: Wait, path: Array, exploration: Exploration) -> Decided:
    """Follow a path (n, 3) to a viewpoint."""
    input, start = wait.situation.heading_for, wait.situation.start
    state = replace(wait.recovering, route=Route(path, input.time_ns, exploration))
    return follow(input, state, start, previous=state)


def _search_frontier(
    input: PlannerInput, start: TrajectorySample, viewpoints: Array, seed: int
) -> Plan | None:
    """Return the path to the best frontier that can be reached; None if no frontier is left."""
    search = None
    for _ in range(MAX_FRONTIERS if input.traversable.discs else 1):
        target = best_frontier(
            input.traversable, input.optimistic, start.position, input.goal, visited=viewpoints
        )
        if target is None:
            return search
        search = plan(
            input.traversable,
            start=start.position,
            goal=target,
            config=input.planner,
            seed=seed,
            heading=start.heading,
        )
        if search.waypoints is not None:
            return search
        viewpoints = np.vstack([viewpoints, target])
    return search


def backtrack_path(
    input: PlannerInput, state: PlannerState, start: TrajectorySample
) -> Array | None:
    """Return the breadcrumbs from the last one backwards, (n, 3), as far as they are traversable.

    Returns:
        None if that is too short to be worth it, or if the robot has backtracked often enough.
    """
    if state.tries.backtracks >= input.behaviour.max_backtracks:
        return None
    crumbs = state.trails.breadcrumbs[::-1]
    # The way to a place right beside has no direction that an elongated body could lie in.
    away = np.flatnonzero(
        np.sqrt(np.square(crumbs - start.position).sum(axis=1)) >= BREADCRUMB_SPACING
    )
    if len(away) == 0:
        return None
    path = np.vstack([start.position, crumbs[away[0] :]])
    path = path[np.append(True, np.abs(np.diff(path, axis=0)).max(axis=1) > 1e-6)]
    length = min(input.traversable.free_length(path), BACKTRACK_LENGTH, arc_length(path))
    return None if length < MIN_ADVANCE else truncate(path, length)
