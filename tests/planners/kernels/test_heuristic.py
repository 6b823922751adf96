import numpy as np
import pytest

from tests.planners.lattices import free_lattice, lattice_in_space, opened
from tests.planners.worlds import make_space
from wayproof.planners.astar import lattice
from wayproof.planners.kernels import heuristic, lattice_cells, lattice_search


@pytest.mark.parametrize(("seed", "factor"), [(5, 1), (6, 2), (7, 3)])
def test_column_bounds_never_exceed_the_cost(seed, factor):
    _, grid, goal, start, costs = lattice_in_space(seed, factor)
    straight = {cell: heuristic.heuristic(grid, cell, start) for cell in costs}
    assert heuristic.bound_columns(grid, goal, start)
    bound = {cell: int(grid.column_bound[cell // grid.shape[2]]) for cell in costs}
    assert all(bound[cell] <= cost for cell, cost in costs.items())
    assert sum(bound[cell] > 1.2 * straight[cell] for cell in costs) > 0.4 * len(costs)
    for cell in list(costs)[::9]:
        for offset, step in zip(
            grid.move_offsets.tolist(), grid.move_lengths.tolist(), strict=True
        ):
            if cell + offset in costs:  # consistent: no step gains more than it costs
                both = sum(lattice_cells.rate_of(grid, at) for at in (cell, cell + offset))
                assert bound[cell] <= bound[cell + offset] + step * both


@pytest.mark.parametrize(("seed", "factor"), [(5, 1), (6, 2), (7, 3)])
def test_a_search_with_column_bounds_finds_the_same_way_and_expands_less(seed, factor):
    space, straight, goal, start, costs = lattice_in_space(seed, factor)
    by_columns = opened(space, factor, start, goal)
    for grid in (straight, by_columns):
        assert not lattice_search.expand(grid, start, start, 5, 1)
        assert grid is straight or lattice.set_column_heuristic(grid, goal, start)
        assert lattice_search.expand(grid, start, start, 10**6, 1)
        assert grid.cost[start] == costs[goal]
    ways = [lattice_search.descend(grid, start).tolist() for grid in (straight, by_columns)]
    assert ways[0] == ways[1]
    assert by_columns.counters[2] < 0.7 * straight.counters[2]


def test_compiled_columns_equal_python():
    _, grid, goal, start, _ = lattice_in_space(5, 2)
    heuristic.bound_columns(grid, goal, start)
    compiled = grid.column_bound.copy()
    heuristic.bound_columns.py_func(grid, goal, start)
    assert compiled.tobytes() == grid.column_bound.tobytes()


def test_where_columns_have_no_way_there_is_none():
    blocked = np.zeros((12, 10, 8), dtype=bool)
    blocked[6] = True
    grid, free = free_lattice(make_space(blocked), 1)
    assert not lattice.set_column_heuristic(grid, free[0], free[-1])
    assert lattice.set_column_heuristic(grid, free[0], free[9])
