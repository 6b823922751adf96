"""Adapter of a planner that is no OMPL class: it plans waypoints."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from ompl import base as ob

from wayproof.planners.free_space import FreeSpace
from wayproof.planners.kernels.grid import Floats
from wayproof.planners.ompl.state_spaces import add_solution, query_ends
from wayproof.planners.path import poses_along
from wayproof.plugin import UserCodeError


class PlansWaypoints(Protocol):
    """Interface of a user's class, which is made without arguments for every plan."""

    def plan(
        self, space: FreeSpace, start: Floats, goal: Floats, seed: int, budget: int
    ) -> Floats | None:
        """Plan a path.

        Args:
            space: Free space; `edge_free(a, b)` checks a segment.
            start: (3,) m.
            goal: (3,) m.
            seed: Seed of this plan: the same one has to give the same path.
            budget: Largest number of iterations of its own loop, `planner.iterations`.

        Returns:
            Waypoints (n, 3), m, from start to goal, or None if it found none.
        """
        ...


class WaypointPlanner(ob.Planner):  # type: ignore[misc]
    """Adapter: adds the waypoints of a `PlansWaypoints` to the problem definition."""

    def __init__(
        self,
        information: ob.SpaceInformation,
        planner: PlansWaypoints,
        who: str,
        seed: int,
        budget: int,
    ) -> None:
        """Plan in the space that the information's validity checker holds.

        Args:
            information: Its validity checker is a `BodyValidity`.
            planner: Planner of the user's.
            who: Its name, for errors.
            seed: Seed of this plan.
            budget: Largest number of iterations.
        """
        super().__init__(information, "waypoints")
        self._planner, self._who, self._seed, self._budget = planner, who, seed, budget

    def solve(self, until: ob.PlannerTerminationCondition) -> ob.PlannerStatus:
        """Add the path to the problem definition, if there is one.

        Raises:
            UserCodeError: It returned neither waypoints nor None.
        """
        validity = self.getSpaceInformation().getStateValidityChecker()
        start, goal = query_ends(self)
        ends = np.array(start[:3]), np.array(goal[:3])
        found = self._planner.plan(validity.space, *ends, seed=self._seed, budget=self._budget)
        if found is None:
            return ob.PlannerStatus(False, False)
        waypoints = self._waypoints(found)
        poses = np.pad(waypoints, ((0, 0), (0, 1)))
        if validity.kind.oriented:
            poses = poses_along(waypoints, start, None if validity.any_heading else goal)
        add_solution(self, [tuple(pose) for pose in poses.tolist()])
        return ob.PlannerStatus(True, False)

    def _waypoints(self, found: object) -> Floats:
        try:
            waypoints = np.asarray(found, dtype=np.float64)
        except (TypeError, ValueError):
            waypoints = np.empty(0)
        if waypoints.ndim != 2 or waypoints.shape[1] != 3:
            got = getattr(found, "shape", type(found).__name__)
            raise UserCodeError(
                self._who, f"returned {got} from plan, expected waypoints of shape (n, 3), or None"
            )
        return waypoints
