"""A* on a coarse lattice, its path pulled straight at full resolution.

It is an OMPL planner, so that it is chosen, bounded, logged and measured as the others are.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np
from ompl import base as ob
from ompl import geometric as og

from wayproof.planners.astar import lattice
from wayproof.planners.astar.se2 import reversible, se2_path
from wayproof.planners.free_space import FreeSpace
from wayproof.planners.kernels import lattice_search, shortcut, sweep
from wayproof.planners.kernels.grid import Floats, Pose
from wayproof.planners.kernels.lattice_cells import OPENED, Lattice
from wayproof.planners.ompl.state_spaces import StateSpace, add_solution, query_ends
from wayproof.planners.path import poses_along

NO_WAY, SPENT = -1, -2
"""Values in place of a cell: there is no way; the budget is spent."""

EXPANSIONS = 1000
"""Number of lattice cells expanded between two checks of the termination condition."""

SE2_EXPANSIONS = 1_000_000
"""Largest number of states of position and heading that are expanded."""

NARROW_COST = 3.0
"""Extra cost of length where a body of discs has no room to turn."""


class GridAStar(ob.Planner):  # type: ignore[misc]
    """Any-angle planning over a cost field; bounded, and the same for any seed.

    The search minimizes length and nearness to obstacles on lattices that grow finer until one has
    a way, so a gap that is closed on the coarse lattice is found on the grid itself. Its path is
    pulled straight where that costs no more. A body of discs heads along the path and turns in
    place; where it has no room for that, positions and headings are searched together, and at last
    by RRT-Connect.
    """

    def __init__(self, information: ob.SpaceInformation, clearance_weight: float) -> None:
        """Plan in the space that the information's validity checker holds.

        Args:
            information: Its validity checker is a `BodyValidity`.
            clearance_weight: Weight of the cell cost against length.
        """
        super().__init__(information, "astar")
        self._weight = float(clearance_weight)

    def solve(self, until: ob.PlannerTerminationCondition) -> ob.PlannerStatus:
        """Add the path to the problem definition, if there is one within the bound."""
        validity = self.getSpaceInformation().getStateValidityChecker()
        kind, space = validity.kind, validity.space
        start, goal = query_ends(self)
        costs, weight = search_costs(space, kind, self._weight)
        found = lattice_path(costs, start, goal, weight, until)
        if found is None:
            return ob.PlannerStatus(False, False)
        points, grid = found
        if not kind.oriented:
            add_solution(self, [(x, y, z, 0.0) for x, y, z in points.tolist()])
            return ob.PlannerStatus(True, False)
        query = PoseQuery(space, costs, start, goal, validity.any_heading)
        poses = poses_on(query, points, grid)
        if poses is not None:
            add_solution(self, [tuple(pose) for pose in poses.tolist()])
            return ob.PlannerStatus(True, False)
        sampling = og.RRTConnect(self.getSpaceInformation())
        sampling.setProblemDefinition(self.getProblemDefinition())
        sampling.setup()
        return sampling.solve(until)


@dataclasses.dataclass(frozen=True)
class PoseQuery:
    """A query of a body of discs.

    Attributes:
        space: Free space of the body.
        costs: The free space with the costs by which positions are searched.
        start: Pose.
        goal: Pose.
        any_heading: Whether the path may end at any heading.
    """

    space: FreeSpace
    costs: FreeSpace
    start: Pose
    goal: Pose
    any_heading: bool


def search_costs(space: FreeSpace, kind: StateSpace, weight: float) -> tuple[FreeSpace, float]:
    """Free space with the costs that positions are searched with, and their weight.

    A body of discs can turn only where its circumscribed disc is free: cells that lack that room
    cost more by `NARROW_COST`, so a way leads through a gap only if that is much shorter, and has
    its corners beside it. So do cells with a price: what is there is not sure.
    """
    if not kind.oriented:
        return space, weight
    room = space.turning_room()
    squared = np.arange(max(len(space.cost_by_distance), math.ceil(room * room) + 2))
    table = space.grid.cost_by_distance[np.minimum(squared, len(space.cost_by_distance) - 1)]
    costs = np.where(table < math.inf, weight * table, 0.0)
    costs = costs + NARROW_COST * (squared <= room * room)
    priced = tuple(weight * cost + NARROW_COST for cost in space.cost_by_price)
    return dataclasses.replace(space, cost_by_distance=costs, cost_by_price=priced), 1.0


def poses_on(query: PoseQuery, points: Floats, grid: Lattice) -> Floats | None:
    """Return poses along a path of positions, or on another way where the body does not fit.

    Args:
        query: Ends of the path.
        points: The path, shape (n, 3), m.
        grid: The lattice on which it was found.

    Returns:
        Shape (n, 4), or None if no way was found.
    """
    space = query.space
    poses = poses_along(points, query.start, None if query.any_heading else query.goal)
    if sweep.poses_free(space.grid, space.shape, poses):
        return poses
    if query.any_heading and space.flat and reversible(space):
        return se2_path(query.costs, query.start, query.goal, SE2_EXPANSIONS, grid)
    return None


def lattice_path(
    space: FreeSpace,
    start: Pose,
    goal: Pose,
    weight: float,
    until: ob.PlannerTerminationCondition,
) -> tuple[Floats, Lattice] | None:
    """Return the cheapest way on the first lattice that has one, pulled straight, shape (n, 3), m.

    None if no lattice has one.
    """
    a, b = np.array(start[:3]), np.array(goal[:3])
    for factor in lattice.factors(space):
        grid = lattice.make_lattice(space, factor, weight)
        entered = _search(grid, space, a, b, until)
        if entered == SPENT:
            return None
        if entered >= 0:
            path = lattice.extract_path(grid, space, a, b, entered)
            path = shortcut.prune(space.grid, space.collision_distance_sq, weight, path)
            return path, grid
    return None


def _search(
    grid: Lattice,
    space: FreeSpace,
    start: Floats,
    goal: Floats,
    until: ob.PlannerTerminationCondition,
) -> int:
    """Search the start's entry cell from the goal's; return it, or `NO_WAY`, or `SPENT`.

    In space a search that takes more than one iteration gets the column heuristic, for which many
    columns are read. It closes all cells of all cheapest ways, so that the path does not depend on
    the heuristic.
    """
    entered = lattice.entry_cell(grid, space, start)
    goal_cell = lattice.entry_cell(grid, space, goal)
    if entered < 0 or goal_cell < 0:
        return NO_WAY
    lattice.open_goal(grid, goal_cell, entered)
    directed = space.flat
    margin = 0 if directed else 1
    while grid.counters[OPENED] > 0:
        if until():
            return SPENT
        if lattice_search.expand(grid, entered, entered, EXPANSIONS, margin):
            return entered
        if not directed and not lattice.set_column_heuristic(grid, goal_cell, entered):
            return NO_WAY
        directed = True
    return NO_WAY
