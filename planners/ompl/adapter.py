"""Ends of a query read from OMPL, and solutions added to it, for planners of our own."""

from __future__ import annotations

from collections.abc import Iterable

from ompl import base as ob
from ompl import geometric as og

from wayproof.planners.kernels.grid import Pose


def query_ends(planner: ob.Planner) -> tuple[Pose, Pose]:
    """Return the start and goal pose of the problem that a planner was given."""
    validity = planner.getSpaceInformation().getStateValidityChecker()
    # Not definition.getStartState: its binding frees the state that it lends.
    start = planner.getPlannerInputStates().nextStart()
    goal = planner.getProblemDefinition().getGoal().getState()
    return validity.kind.read(start, validity.z), validity.kind.read(goal, validity.z)


def add_solution(planner: ob.Planner, poses: Iterable[Pose]) -> None:
    """Add a path through poses to the problem definition of a planner."""
    information = planner.getSpaceInformation()
    write = information.getStateValidityChecker().kind.write
    path, state = og.PathGeometric(information), information.allocState()
    for pose in poses:
        write(state, pose)
        path.append(state)  # copies it
    planner.getProblemDefinition().addSolutionPath(path, False, 0.0, planner.getName())
