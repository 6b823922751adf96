"""Breadcrumbs of the way travelled, and the path back along them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from wayproof.harness.behaviour_config import MIN_ADVANCE
from wayproof.harness.stack.types import Array, PlannerInput, PlannerState, arc_length, distance
from wayproof.planners import TrajectorySample, truncate

BACKTRACK_LENGTH = 1.0
"""Length of one backtrack, m; chosen: out of reach of what blocked the robot."""

BREADCRUMB_SPACING = 0.1
"""Minimum distance between breadcrumbs, m."""

SPARE_BREADCRUMBS = 2
"""Number of breadcrumbs kept beyond what the longest path back needs."""


def record_breadcrumb(state: PlannerState, input: PlannerInput) -> PlannerState:
    """Append the robot's position to the state if it is a spacing away from the last one."""
    crumbs = state.breadcrumbs
    if len(crumbs) and distance(crumbs[-1], input.position) < BREADCRUMB_SPACING:
        return state
    kept = int(BACKTRACK_LENGTH / BREADCRUMB_SPACING) + SPARE_BREADCRUMBS
    return replace(state, breadcrumbs=np.vstack([crumbs, input.position])[-kept:])


def backtrack_path(
    input: PlannerInput, state: PlannerState, start: TrajectorySample
) -> Array | None:
    """Return the breadcrumbs from the last one backwards, (n, 3), as far as they are traversable.

    Returns:
        None if that is too short to be worth it, or if the robot has backtracked often enough.
    """
    if state.backtracks >= input.behaviour.max_backtracks or len(state.breadcrumbs) == 0:
        return None
    crumbs = state.breadcrumbs[::-1]
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
