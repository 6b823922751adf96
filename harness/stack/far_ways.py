"""Ways beyond the rolling window: over the global costmap, from costs-to-go that are repaired."""

from __future__ import annotations

import numpy as np

from wayproof.harness.config import Config
from wayproof.harness.mission import Mission
from wayproof.harness.stack.mapping import Mapper
from wayproof.harness.stack.types import Array
from wayproof.maps.costmap.global_costmap import BLOCKED, PASSABLE, GlobalCostmap
from wayproof.planners import FreeSpace, GoalField, PlannerConfig

SEED = 1
"""Seed of the shortcuts; a way depends on the map, its ends and this alone."""

PROJECTION = 3.0
"""Distance within which a goal in a blocked coarse cell is projected to a free one, m."""


class FarWays:
    """Plans over the whole operating area in coarse cells, for one map.

    A way depends on the map as it is and on its ends, not on earlier requests: see
    `GlobalCostmap` and `GoalField`. It is the shortest one, whether what it leads through is known
    or not: nearly all of what lies beyond the window has not been seen yet.
    """

    def __init__(self, config: Config, mission: Mission, mapper: Mapper) -> None:
        """Search the costs-to-go of a first goal beyond the window, and compile what repairs them.

        So that no decision waits for that.
        """
        costmap = mapper.costmap
        low, high = mission.low, mission.high
        height = mission.height if mission.planar else 2.0 * costmap.radius
        self._coarse = coarse = GlobalCostmap(
            mapper.measured, low, high, costmap.project, costmap.collision_distance_sq, height
        )
        weight = config.planner.clearance_weight
        self._planner = PlannerConfig(iterations=config.planner.iterations, clearance_weight=weight)
        self._field = coarse.states[:, :, None].astype(np.uint16)
        origin = np.array([*coarse.origin, -0.5 * coarse.size])  # the layer's centre at z = 0
        self._space = FreeSpace(
            self._field,
            origin,
            resolution=coarse.size,
            collision_distance_sq=BLOCKED,
            cost_by_distance=np.zeros(PASSABLE + 1),
        )
        self._goal_field: GoalField | None = None
        goal, (least, greatest) = np.array(mission.goals[0]), mapper.window.inner
        beyond = (goal[:2] < least) | (goal[:2] > greatest)
        for _ in range(2 if beyond.any() else 0):
            self.way(np.array(mission.start), goal)

    def way(self, start: Array, goal: Array) -> Array | None:
        """Plan from a position to a goal, both (3,), m.

        Returns:
            (n, 2) from the start on, m; None if the map holds none.
        """
        changed = self._coarse.update()
        box = None
        if changed is not None:
            (x0, y0), (x1, y1) = (corner.tolist() for corner in changed)
            self._field[x0:x1, y0:y1, 0] = self._coarse.states[x0:x1, y0:y1]
            box = np.array([x0, y0, 0]), np.array([x1, y1, 1])
        end = self._space.nearest_free(_flat(goal), PROJECTION)
        if end is None:
            return None
        known = self._goal_field
        if known is None or not np.array_equal(known.goal, end):
            self._goal_field = known = GoalField(end, self._planner)
        found = known.plan(self._space, _flat(start), SEED, changed=box or _NOTHING)
        return None if found.waypoints is None else found.waypoints[:, :2]


_NOTHING = np.zeros(3, np.int64), np.zeros(3, np.int64)
"""Box of no cells."""


def _flat(point: Array) -> Array:
    return np.array([point[0], point[1], 0.0])
