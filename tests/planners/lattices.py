import dataclasses
import heapq

import numpy as np

from tests.planners.worlds import make_space
from wayproof.planners import (
    FreeSpace,
)
from wayproof.planners.astar import lattice
from wayproof.planners.kernels import lattice_cells, lattice_search


def random_space(seed: int, shape=(24, 20, 1), pillars: int = 0) -> FreeSpace:
    """Random boxes in cells of 1 m from the origin, whose centres are exact in binary."""
    rng = np.random.default_rng(seed)
    blocked = np.zeros(shape, dtype=bool)
    for low in rng.integers(0, np.array(shape), size=(6, 3)):
        blocked[tuple(slice(corner, corner + 4) for corner in low)] = True
    for x, y in rng.integers(0, np.array(shape[:2]), size=(pillars, 2)):
        blocked[x : x + 4, y : y + 4] = True
    return dataclasses.replace(make_space(blocked), origin=np.zeros(3), resolution=1.0)


def free_lattice(space: FreeSpace, factor: int):
    grid = lattice.make_lattice(space, factor, 2.0)
    free = [n for n in range(len(grid.rate)) if lattice_cells.rate_of(grid, n) > 0]
    return grid, free


def naive_costs(space: FreeSpace, grid, free: list[int], goal: int) -> dict[int, int]:
    """Dijkstra with a heap over the free cells; a step is free if the grid's own walk says so."""
    centre = dict(zip(free, lattice.centres(grid, space, np.array(free)), strict=True))
    costs, queue = {}, [(0, goal)]
    while queue:
        cost, cell = heapq.heappop(queue)
        if cell in costs:
            continue
        costs[cell] = cost
        for offset, step in zip(
            grid.move_offsets.tolist(), grid.move_lengths.tolist(), strict=True
        ):
            other = cell + offset
            if other not in centre or not space.edge_free(centre[cell], centre[other]):
                continue
            both = int(grid.rate[cell]) + int(grid.rate[other])
            heapq.heappush(queue, (cost + step * both, other))
    return costs


def closed_costs(grid) -> dict[int, int]:
    closed = np.flatnonzero(grid.state == lattice_cells.CLOSED)
    return {int(cell): int(grid.cost[cell]) for cell in closed}


def lattice_in_space(seed: int, factor: int):
    """A lattice in space on which nothing is searched; two of its cells that a way joins, far off.

    Also all costs-to-go from the second.
    """
    space = random_space(seed, (62, 57, 12), pillars=20)
    grid, free = free_lattice(space, factor)
    start, costs = free[3], {}
    while len(costs) < 0.5 * len(free):  # it may lie between boxes
        grid, _ = free_lattice(space, factor)
        lattice.open_goal(grid, start)
        lattice_search.expand(grid, 0, -1, 10**6, 0)
        costs = closed_costs(grid)
        start = free[free.index(start) + 1] if len(costs) < 0.5 * len(free) else start
    goal = max(costs, key=costs.__getitem__)
    return space, opened(space, factor, start, goal), goal, start, costs


def opened(space: FreeSpace, factor: int, start: int, goal: int):
    grid = lattice.make_lattice(space, factor, 2.0)
    lattice_cells.rate_of(grid, goal)
    lattice.open_goal(grid, goal, start)
    return grid


def cells_of(swept, motion):
    """All cells that the discs touch on a motion."""
    return {
        tuple(cell)
        for cells, count in zip(swept.cells[motion], swept.counts[motion], strict=True)
        for cell in cells[:count].tolist()
    }
