"""Goals within the rolling window, and ways beyond it over the global costmap.

A goal beyond the window is replaced by the place where the way to it leaves.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from wayproof.harness.config import Config
from wayproof.harness.mission import Mission
from wayproof.harness.stack.mapping import Mapper
from wayproof.harness.stack.state import PlannerState
from wayproof.harness.stack.types import Array, Horizon, PlannerInput, distance, is_free_along
from wayproof.maps.costmap.global_costmap import BLOCKED, PASSABLE, GlobalCostmap
from wayproof.planners import FreeSpace, PlannerConfig, TrajectorySample, plan, remaining

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


SEED = 1
"""Seed of the shortcuts; a way depends on the map, its ends and this alone."""

PROJECTION = 3.0
"""Distance within which a goal in a blocked coarse cell is projected to a free one, m."""


class FarWays:
    """Plans over the whole operating area in coarse cells, for one map.

    A way depends on the map as it is and on its ends, not on earlier requests. It is the shortest
    one, whether what it leads through is known or not: nearly all of what lies beyond the window
    has not been seen yet.
    """

    def __init__(self, config: Config, mission: Mission, mapper: Mapper) -> None:
        """Plan to a first goal beyond the window, so that no decision waits to compile that."""
        costmap = mapper.costmap
        low, high = mission.low, mission.high
        height = mission.height if mission.planar else 2.0 * costmap.radius
        self._coarse = coarse = GlobalCostmap(
            mapper.measured, low, high, costmap.project, costmap.collision_distance_sq, height
        )
        weight = config.planner.clearance_weight
        self._planner = PlannerConfig(iterations=config.planner.iterations, clearance_weight=weight)
        self._origin = np.array([*coarse.origin, -0.5 * coarse.size])  # the layer's centre at z = 0
        goal, (least, greatest) = np.array(mission.goals[0]), mapper.window.inner
        beyond = (goal[:2] < least) | (goal[:2] > greatest)
        if beyond.any():
            self.way(np.array(mission.start), goal)

    def way(self, start: Array, goal: Array) -> Array | None:
        """Plan from a position to a goal, both (3,), m.

        Returns:
            (n, 2) from the start on, m; None if the map holds none.
        """
        self._coarse.update()
        space = FreeSpace(
            self._coarse.states[:, :, None].astype(np.uint16),
            self._origin,
            resolution=self._coarse.size,
            collision_distance_sq=BLOCKED,
            cost_by_distance=np.zeros(PASSABLE + 1),
        )
        end = space.nearest_free(_flat(goal), PROJECTION)
        if end is None:
            return None
        found = plan(space, _flat(start), end, self._planner, SEED)
        return None if found.waypoints is None else found.waypoints[:, :2]


def _flat(point: Array) -> Array:
    return np.array([point[0], point[1], 0.0])
