"""Goals within the rolling window: the goal itself, or a place where the way to it leaves."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from wayproof.harness.stack.state import PlannerState
from wayproof.harness.stack.types import Array, Horizon, PlannerInput, distance, is_free_along
from wayproof.planners import TrajectorySample, remaining

RENEW = 6.0
"""Distance from an intermediate goal below which the next one is taken, m."""

REACH = 2.0
"""Distance within which an intermediate goal is projected to free space, m."""


def goal_within(input: PlannerInput, state: PlannerState, start: TrajectorySample) -> Array:
    """Return the goal (3,), or an intermediate one where it lies beyond the rolling window.

    An intermediate goal is kept while the global path leads there and is not known to be blocked.
    Else it is where the coarse way to the goal leaves the window.

    Args:
        input: Planner input of the decision.
        state: Planner state before the decision.
        start: Start of the new trajectory.
    """
    horizon = input.horizon
    if _in_window(horizon, input.goal):
        return input.goal
    if state.global_path is not None and not state.exploring:
        path = remaining(state.global_path, start.arc_length)
        end: Array = path[-1]
        far = distance(end, start.position) >= RENEW and _in_window(horizon, end)
        if far and is_free_along(input.optimistic, path):
            return end
    way = horizon.way(start.position, input.goal)
    if way is None:
        way = np.stack([start.position[:2], input.goal[:2]])
    leaves = exit_of(way, horizon.low, horizon.high)
    place = np.array([*leaves, start.position[2]])
    nearest = input.optimistic.nearest_free(place, REACH)
    return place if nearest is None else nearest


def exit_of(way: Array, low: Array, high: Array) -> Array:
    """Return the point (2,) at which a polyline (n, 2) leaves a box, m; its end if it does not.

    Args:
        way: Way from a point in the box on.
        low: (2,) corner of the box.
        high: (2,) corner of the box.
    """
    for a, b in pairwise(way):
        if ((b >= low) & (b <= high)).all():
            continue
        share = 1.0
        for axis in range(2):
            step = float(b[axis] - a[axis])
            if step != 0.0:
                face = float(high[axis] if step > 0.0 else low[axis])
                share = min(share, max((face - float(a[axis])) / step, 0.0))
        return _clipped(a + share * (b - a), low, high)
    return _clipped(way[-1], low, high)


def _clipped(point: Array, low: Array, high: Array) -> Array:
    clipped: Array = np.minimum(np.maximum(point, low), high)
    return clipped


def _in_window(horizon: Horizon, point: Array) -> bool:
    return bool(((point[:2] >= horizon.low) & (point[:2] <= horizon.high)).all())
