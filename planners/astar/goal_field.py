"""Replanning to one goal: costs-to-go are kept, and repaired where the map has changed."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wayproof.planners.astar import lattice
from wayproof.planners.astar.grid_astar import EXPANSIONS, PoseQuery, poses_on, search_costs
from wayproof.planners.free_space import FreeSpace
from wayproof.planners.kernels import lattice_search, shortcut
from wayproof.planners.kernels.angles import wrap
from wayproof.planners.kernels.grid import Floats
from wayproof.planners.kernels.lattice_cells import EXPANDED, OPENED, Lattice
from wayproof.planners.kernels.repair import refresh_box, repair
from wayproof.planners.problem import Plan, PlannerConfig, finish_path, plan, state_space_of

Cells = NDArray[np.int64]


class GoalField:
    """The costs-to-go of one goal on the coarse lattice, from which any start is planned at once.

    Costs are integers and exact, so what is kept is what a new search would find: a plan is the
    same as that of a new `GoalField`, bit by bit, whatever was planned before. When the map
    changes, the costs of all ways over what changed are reset, and the search goes on from the
    border of those (after Ramalingam and Reps, "An Incremental Algorithm for a Generalization of
    the Shortest-Path Problem", Journal of Algorithms 1996). The first plan searches all around the
    goal, so that much is known; later ones are directed to the start, and close only cells of which
    a way over them can be as cheap (as in D* Lite, Koenig and Likhachev, AAAI 2002).

    Attributes:
        goal: World frame, m, shape (3,).
        config: The planner's settings; its name and restarts are used only for the plans that the
            coarse lattice has no way for.
    """

    def __init__(self, goal: Floats, config: PlannerConfig) -> None:
        """Set the goal; the first plan searches."""
        self.goal = np.array(goal, dtype=np.float64)
        self.config = config
        self._lattice: Lattice | None = None
        self._known: tuple[object, ...] = ()
        self._goal_cell = -1

    def plan(
        self,
        space: FreeSpace,
        start: Floats,
        seed: int,
        heading: float = 0.0,
        changed: tuple[Cells, Cells] | None = None,
    ) -> Plan:
        """Plan from a start to the goal.

        Args:
            space: Free space.
            start: World frame, m, shape (3,).
            seed: Seed of the shortcuts.
            heading: Heading of the body at the start, rad, where headings are planned.
            changed: Box of the field's cells, low and one past high, each shape (3,), outside of
                which the field is as in the last plan; None compares all of it.

        Returns:
            The path with its cost, or a label that says why there is none.
        """
        kind = state_space_of(self.config, space)
        costs, weight = search_costs(space, kind, float(self.config.clearance_weight))
        grid = self._follow(costs, weight, changed)
        entered = lattice.entry_cell(grid, space, start) if self._goal_cell >= 0 else -1
        before = int(grid.counters[EXPANDED])
        budget = self.config.iterations * EXPANSIONS
        target = entered if before > 0 else -1
        if entered >= 0:
            lattice.set_heuristic_target(grid, target)
        if entered < 0 or not lattice_search.expand(grid, entered, target, budget, 1):
            if grid.counters[OPENED] > 0:
                self._lattice = None  # the next plan has the whole budget, as a new object has
            return plan(space, start, self.goal, self.config, seed, heading)
        spent = int(grid.counters[EXPANDED]) - before
        path = lattice.extract_path(grid, space, start, self.goal, entered)
        path = shortcut.prune(costs.grid, space.collision_distance_sq, weight, path)
        poses: Floats | None = np.column_stack((path, np.zeros(len(path))))
        if kind.oriented:
            begin, end = (*start.tolist(), float(wrap(heading))), (*self.goal.tolist(), 0.0)
            poses = poses_on(PoseQuery(space, costs, begin, end, any_heading=True), path, grid)
        if poses is None:
            return plan(space, start, self.goal, self.config, seed, heading)
        used = 1 + spent // EXPANSIONS
        return finish_path(space, start, self.goal, self.config, seed, heading, poses, used)

    def _follow(
        self, space: FreeSpace, weight: float, changed: tuple[Cells, Cells] | None
    ) -> Lattice:
        """Return the space's current lattice, with costs-to-go reset that a change can alter."""
        rates = lattice.rates_of(space, weight)
        geometry = (space.grid.field.shape, space.grid.origin.tobytes(), space.grid.resolution)
        tables = rates.by_distance.tobytes(), rates.by_price.tobytes()
        known = (*geometry, space.collision_distance_sq, *tables)
        if self._lattice is None or known != self._known:
            return self._begin(space, weight, known)
        field = space.grid.field
        grid = self._lattice._replace(field=field, cells=field.reshape(-1), rates=rates)
        low, high = _lattice_box(grid, changed)
        changes = refresh_box(grid, low, high)
        if self._goal_cell in changes or self._goal_cell != lattice.entry_cell(
            grid, space, self.goal
        ):
            return self._begin(space, weight, known)
        repair(grid, changes)
        self._lattice = grid
        return grid

    def _begin(self, space: FreeSpace, weight: float, known: tuple[object, ...]) -> Lattice:
        """Return a lattice on which only the goal's cell is open."""
        grid = lattice.make_lattice(space, lattice.factors(space)[0], weight, repairable=True)
        self._goal_cell = lattice.entry_cell(grid, space, self.goal)
        if self._goal_cell >= 0:
            lattice.open_goal(grid, self._goal_cell)
        self._lattice, self._known = grid, known
        return grid


def _lattice_box(grid: Lattice, changed: tuple[Cells, Cells] | None) -> tuple[Cells, Cells]:
    """Return the lattice cells that a box touches, low and one past high, without the border."""
    if changed is None:
        return np.ones(3, np.int64), grid.shape - 1
    low, high = (np.asarray(corner, np.int64) for corner in changed)
    first = np.maximum(low // grid.factor, 0) + 1
    end = np.minimum(-(-high // grid.factor), grid.shape - 2) + 1
    return first, end
