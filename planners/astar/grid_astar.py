"""Our own planner: the cheapest way on a coarse lattice, pulled straight at full resolution.

It is written as an OMPL planner, so that it is chosen, bounded, logged and measured as the others.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np
from ompl import base as ob
from ompl import geometric as og

from wayproof.planners import _lattice_kernels, kernels
from wayproof.planners._lattice_kernels import Lattice
from wayproof.planners.astar import lattice
from wayproof.planners.astar.se2 import head_along, reversible, turning_path
from wayproof.planners.free_space import FreeSpace
from wayproof.planners.kernels import Floats, Pose
from wayproof.planners.ompl.state_spaces import StateSpace

NO_WAY, SPENT = -1, -2  # in place of a cell
EXPANSIONS = 1000
"""Lattice cells that are closed in one turn, after which the termination condition is asked."""

TURNS = 1_000_000
"""States of a place and a way that are closed at most."""

FINE = 4
"""Grid cells to a lattice cell from which on it pays to spare distances (see `FreeSpace.sparing`):
64 of them are worked out for each cell of the lattice. Drawn by columns, whole episodes of the
drone took 0.95 of the time with 2 grid cells to a lattice cell, and with 4 of them 1.02."""

NARROW = 3.0
"""What length costs more where a body of discs has no room to turn."""


class FieldPlanner(ob.Planner):  # type: ignore[misc]
    """Any-angle planning over a cost field; bounded, and the same for any seed.

    The search costs length and nearness to obstacles on lattices that grow finer until one has a
    way, so a gap that is closed on the coarse lattice is found on the grid itself. Its path is
    pulled straight where that costs no more. A body of discs heads along the path and turns in
    place; where it has no room for that, places and headings are searched together, and at last
    by RRT-Connect.
    """

    def __init__(self, information: ob.SpaceInformation, clearance_weight: float) -> None:
        """Plan in the space that the information's validity checker holds.

        Args:
            information: Its validity checker is a ``BodyValidity``.
            clearance_weight: Weight of the cell cost against length.
        """
        super().__init__(information, "field")
        self._weight = float(clearance_weight)

    def solve(self, until: ob.PlannerTerminationCondition) -> ob.PlannerStatus:
        """Add the path to the problem definition, if there is one within the bound."""
        validity = self.getSpaceInformation().getStateValidityChecker()
        definition = self.getProblemDefinition()
        kind, space = validity.kind, validity.space
        # Not definition.getStartState: its binding frees the state that it lends.
        start = kind.read(self.getPlannerInputStates().nextStart(), validity.z)
        goal = kind.read(definition.getGoal().getState(), validity.z)
        costs, weight = searched(space, kind, self._weight)
        found = lattice_path(costs, start, goal, weight, until)
        if found is None:
            return ob.PlannerStatus(False, False)
        points, grid = found
        if not kind.oriented:
            self._add([(x, y, z, 0.0) for x, y, z in points.tolist()])
            return ob.PlannerStatus(True, False)
        end = None if validity.any_heading else goal
        poses = with_headings(space, costs, points, start, goal, end, grid)
        if poses is not None:
            self._add([tuple(pose) for pose in poses.tolist()])
            return ob.PlannerStatus(True, False)
        sampling = og.RRTConnect(self.getSpaceInformation())
        sampling.setProblemDefinition(definition)
        sampling.setup()
        return sampling.solve(until)

    def _add(self, poses: list[Pose]) -> None:
        information = self.getSpaceInformation()
        write = information.getStateValidityChecker().kind.write
        path, state = og.PathGeometric(information), information.allocState()
        for pose in poses:
            write(state, pose)
            path.append(state)  # copies it
        self.getProblemDefinition().addSolutionPath(path, False, 0.0, self.getName())


def searched(space: FreeSpace, kind: StateSpace, weight: float) -> tuple[FreeSpace, float]:
    """The costs that positions are searched with, and their weight.

    A body of discs can turn only where the disc about it is free: cells that lack that room cost
    more by ``NARROW``, so a way leads through a gap only if that is much shorter, and bends beside
    it.
    """
    if not kind.oriented:
        return space, weight
    room = max(
        abs(offset) / space.resolution + math.sqrt(threshold)
        for offset, threshold in zip(space.shape.offsets, space.shape.thresholds, strict=True)
    )
    squared = np.arange(max(len(space.cost_by_distance), math.ceil(room * room) + 2))
    table = space.grid.cost_by_distance[np.minimum(squared, len(space.cost_by_distance) - 1)]
    costs = np.where(table < math.inf, weight * table, 0.0) + NARROW * (squared <= room * room)
    return dataclasses.replace(space, cost_by_distance=costs), 1.0


def with_headings(
    space: FreeSpace,
    costs: FreeSpace,
    points: Floats,
    start: Pose,
    goal: Pose,
    end: Pose | None,
    grid: Lattice,
) -> Floats | None:
    """Poses along a path of positions, or on another way where the body does not fit along it.

    Args:
        space: With the body's discs.
        costs: The same, with the costs that positions were searched with.
        points: The path, shape (n, 3) [m].
        start: Where it begins.
        goal: Place that it leads to.
        end: Pose at the goal; None for any heading.
        grid: The lattice that it was found on.
    """
    poses = head_along(points, start, end)
    if kernels.poses_free(space.grid, space.shape, poses):
        return poses
    if end is None and space.flat and reversible(space):
        return turning_path(costs, start, goal, TURNS, grid)
    return None


def lattice_path(
    space: FreeSpace,
    start: Pose,
    goal: Pose,
    weight: float,
    until: ob.PlannerTerminationCondition,
) -> tuple[Floats, Lattice] | None:
    """The cheapest way on the first lattice that has one, pulled straight, shape (n, 3) [m].

    None if none has one, or if something that was read is outdated: then ``plan`` begins anew.
    """
    a, b = np.array(start[:3]), np.array(goal[:3])
    if not space.begin_search():
        return None
    for factor in lattice.factors(space):
        grid = lattice.make_lattice(space, factor, weight)
        entered = _search(grid, space, a, b, until)
        if not lattice.note_searched(grid, space) or entered == SPENT:
            return None
        if entered >= 0:
            path = lattice.way_down(grid, space, a, b, entered)
            return kernels.prune(space.grid, space.collision_distance_sq, weight, path), grid
    return None


def _search(
    grid: Lattice,
    space: FreeSpace,
    start: Floats,
    goal: Floats,
    until: ob.PlannerTerminationCondition,
) -> int:
    """The cell by which the start enters the lattice, its way found; or NO_WAY, or SPENT.

    A search in space that takes more than a turn is drawn by what the plane of its columns tells,
    for which it looks at many of them. It closes all cells of all cheapest ways, so that which way
    is taken does not depend on how it was drawn.
    """
    entered, goal_cell = lattice.entry(grid, space, start), lattice.entry(grid, space, goal)
    if entered < 0 or goal_cell < 0:
        return NO_WAY
    lattice.open_goal(grid, goal_cell, entered)
    drawn = space.flat or (space.sparing and int(grid.factor[0]) >= FINE)
    beyond = 0 if drawn else 1
    while grid.now[_lattice_kernels.OPENED] > 0:
        if until():
            return SPENT
        if _lattice_kernels.spread(grid, entered, entered, EXPANSIONS, beyond):
            return entered
        if not drawn and not lattice.draw_by_columns(grid, goal_cell, entered):
            return NO_WAY
        drawn = True
    return NO_WAY
