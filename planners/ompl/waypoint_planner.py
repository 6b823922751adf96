"""A planner that is no OMPL class, behind OMPL's interface: waypoints in place of states."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from ompl import base as ob
from ompl import geometric as og

from wayproof.planners.astar.se2 import head_along
from wayproof.planners.free_space import FreeSpace
from wayproof.planners.kernels import Floats
from wayproof.planners.ompl._plugin import UserCodeError


class PlansWaypoints(Protocol):
    """What a class of the user's own has to offer; it is made without arguments for every plan."""

    def plan(
        self, space: FreeSpace, start: Floats, goal: Floats, seed: int, budget: int
    ) -> Floats | None:
        """Plan a path.

        Args:
            space: Where the body may be; `edge_free(a, b)` checks a segment.
            start: (3,) m.
            goal: (3,) m.
            seed: Of this plan: the same one has to give the same path.
            budget: How many turns of its own loop it may take, `planner.iterations`.

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
            planner: The user's.
            who: Its name, for errors.
            seed: Of this plan.
            budget: Turns that it may take.
        """
        super().__init__(information, "waypoints")
        self._planner, self._who, self._seed, self._budget = planner, who, seed, budget

    def solve(self, until: ob.PlannerTerminationCondition) -> ob.PlannerStatus:
        """Add the path to the problem definition, if there is one.

        Raises:
            UserCodeError: What was returned is neither waypoints nor None.
        """
        information, definition = self.getSpaceInformation(), self.getProblemDefinition()
        validity = information.getStateValidityChecker()
        kind, z = validity.kind, validity.z
        start = kind.read(self.getPlannerInputStates().nextStart(), z)
        goal = kind.read(definition.getGoal().getState(), z)
        ends = np.array(start[:3]), np.array(goal[:3])
        found = self._planner.plan(validity.space, *ends, seed=self._seed, budget=self._budget)
        if found is None:
            return ob.PlannerStatus(False, False)
        path, state = og.PathGeometric(information), information.allocState()
        waypoints = self._waypoints(found)
        poses = np.pad(waypoints, ((0, 0), (0, 1)))
        if kind.oriented:
            poses = head_along(waypoints, start, None if validity.any_heading else goal)
        for x, y, height, heading in poses.tolist():
            kind.write(state, (x, y, height, heading))
            path.append(state)
        definition.addSolutionPath(path, False, 0.0, self.getName())
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
