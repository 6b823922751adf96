"""Searches on a lattice, their heap and their bounds, against naive ones."""

import heapq
import math

import numpy as np
import pytest

from tests.planners.lattices import (
    closed_costs,
    free_lattice,
    lattice_in_space,
    naive_costs,
    opened,
    random_space,
)
from tests.planners.worlds import long_space, make_space, point
from wayproof.planners.astar import lattice
from wayproof.planners.kernels import (
    free_box,
    heap,
    heuristic,
    lattice_cells,
    lattice_search,
)


@pytest.mark.parametrize("python", [False, True])
def test_the_heap_gives_the_least_key_first(python):
    push, pop = heap.push, heap.pop
    if python:
        push, pop = push.py_func, pop.py_func
    rng = np.random.default_rng(12)
    queue, count, peer = np.empty(4, np.int64), 0, []
    for _ in range(2000):
        if count and rng.random() < 0.45:
            count -= 1
            assert pop(queue, count) == heapq.heappop(peer)
        else:
            key = int(rng.integers(0, 500))
            queue, count = push(queue, count, key), count + 1
            heapq.heappush(peer, key)
    assert count == len(peer) > 4
    for size in range(1, 100):  # small ones: there a last key without another beside it is moved
        keys = rng.integers(0, 500, 1 + size % 12).tolist()
        for n, key in enumerate(keys):
            queue = push(queue, n, key)
        assert [pop(queue, n) for n in range(len(keys) - 1, -1, -1)] == sorted(keys)


def test_a_box_is_free_where_all_its_cells_are():
    rng = np.random.default_rng(6)
    space = make_space(rng.random((14, 12, 5)) < 0.003, resolution=0.25)
    shape = np.array(space.distances.shape)
    free = seen = 0
    for _ in range(600):
        low, size = rng.uniform(0.5, shape - 1.0), rng.uniform(0.0, (4.0, 4.0, 2.0))
        corners = [tuple(space.origin + space.resolution * end) for end in (low, low + size)]
        reach = rng.uniform(0.0, 2.0)
        all_free = free_box.box_free(space.grid, 2, *corners, reach * space.resolution)
        first = np.floor(low - (reach, reach, 0.0)).astype(int) - 1
        end = np.floor(low + size + (reach, reach, 0.0)).astype(int) + 2
        inside = (first >= 0).all() and (end <= shape).all()
        cells = tuple(slice(a, b) for a, b in zip(first, end, strict=True))
        assert all_free == (inside and bool((space.distances[cells] > 2).all()))
        assert (
            free_box.box_free.py_func(space.grid, 2, *corners, reach * space.resolution) == all_free
        )
        free, seen = free + all_free, seen + inside
    assert 20 < free < seen - 20


def test_a_distance_decides_exactly_about_cells_near_it():
    for value, threshold, squared in np.ndindex(60, 12, 12):
        beyond = math.sqrt(value) - math.sqrt(threshold) - math.sqrt(squared)
        assert free_box.all_above(value, threshold, squared) == (beyond > 1e-9)


def test_a_box_that_leaves_the_grid_is_not_free(bend):
    empty = make_space(np.zeros((20, 20, 1), dtype=bool))
    middle = tuple(point(empty, 10, 10).tolist())
    assert free_box.box_free(empty.grid, 4, middle, middle, 0.8)
    assert not free_box.box_free(empty.grid, 4, middle, middle, 1.0)
    assert not free_box.box_free(empty.grid, 4, (math.nan, 0.0, 0.0), middle, 0.1)


@pytest.mark.parametrize(
    ("shape", "factor"), [((24, 20, 1), 1), ((25, 21, 1), 2), ((21, 18, 13), 3)]
)
def test_costs_to_go_are_those_of_a_naive_search(shape, factor):
    space = random_space(3, shape)
    grid, free = free_lattice(space, factor)
    goal = free[len(free) // 2]
    lattice.open_goal(grid, goal)
    lattice_search.expand(grid, 0, -1, 10**6, 0)  # the border's cell is never closed
    assert closed_costs(grid) == naive_costs(space, grid, free, goal)


def test_a_search_with_a_heuristic_costs_the_same_and_expands_less():
    space = random_space(5, (60, 60, 1))
    whole, free = free_lattice(space, 1)
    goal = free[10]
    lattice.open_goal(whole, goal)
    lattice_search.expand(whole, 0, -1, 10**6, 0)
    for start in [cell for cell in free[::400] if whole.state[cell] == lattice_cells.CLOSED]:
        drawn, _ = free_lattice(space, 1)
        lattice.open_goal(drawn, goal, start)
        assert lattice_search.expand(drawn, start, start, 10**6, 0)
        assert drawn.cost[start] == whole.cost[start]
        assert drawn.counters[2] <= whole.counters[2]
        cells = lattice_search.descend(drawn, start)
        assert (cells[0], cells[-1]) == (start, goal)


def test_a_straight_way_costs_its_length_by_hand():
    space = make_space(np.zeros((20, 9, 1), dtype=bool))
    grid = lattice.make_lattice(space, 1, 0.0)
    start, goal = (lattice.entry_cell(grid, space, point(space, x, 4.5)) for x in (2.5, 12.5))
    lattice.open_goal(grid, goal, start)
    assert lattice_search.expand(grid, start, start, 1000, 0)
    assert grid.cost[start] == 10 * 12 * (8 + 8)  # steps, their length, both cells' rates
    assert len(lattice_search.descend(grid, start)) == 11


def test_compiled_lattice_kernels_equal_python():
    space = random_space(3, (13, 12, 7))
    pair = [free_lattice(space, 2) for _ in range(2)]
    goal, start = pair[0][1][0], pair[0][1][-1]
    for (grid, _), python in zip(pair, (False, True), strict=True):
        lattice.open_goal(grid, goal)
        expand, descend, requeue = (
            kernel.py_func if python else kernel
            for kernel in (
                lattice_search.expand,
                lattice_search.descend,
                lattice_search.requeue,
            )
        )
        assert not expand(grid, start, -1, 10, 0)
        opened = np.flatnonzero(grid.state == lattice_cells.OPEN)
        requeue(grid, start, opened)
        assert grid.counters[lattice_cells.OPENED] == len(opened) > 0
        assert expand(grid, start, start, 10**6, 1)
        assert descend(grid, start)[-1] == goal
    (compiled, _), (python, _) = pair
    assert closed_costs(compiled) == closed_costs(python)
    assert compiled.rate.tobytes() == python.rate.tobytes()


def test_all_cells_of_all_cheapest_ways_are_closed_with_a_new_target():
    space = random_space(5, (40, 40, 1))
    whole, free = free_lattice(space, 1)
    lattice.open_goal(whole, free[10])
    lattice_search.expand(whole, 0, -1, 10**6, 0)
    start = next(n for n in free[::-1] if whole.state[n] == lattice_cells.CLOSED)
    drawn, _ = free_lattice(space, 1)
    lattice.open_goal(drawn, free[10])
    assert lattice_search.expand(drawn, free[200], -1, 50, 0) is False
    lattice.set_heuristic_target(drawn, start)  # what is open is kept
    assert lattice_search.expand(drawn, start, start, 10**6, 1)
    onto = {start}
    for cell in sorted(free, key=lambda n: -int(whole.cost[n])):
        for offset, step in zip(
            whole.move_offsets.tolist(), whole.move_lengths.tolist(), strict=True
        ):
            both = int(whole.rate[cell]) + int(whole.rate[cell + offset])
            cost = int(whole.cost[cell]) - int(whole.cost[cell + offset])
            if cell in onto and whole.rate[cell + offset] > 0 and cost == step * both:
                if space.edge_free(*lattice.centres(whole, space, np.array([cell, cell + offset]))):
                    onto.add(cell + offset)
    assert len(onto) > 20
    for cell in onto:
        assert drawn.state[cell] == lattice_cells.CLOSED
        assert drawn.cost[cell] == whole.cost[cell]
    assert drawn.counters[2] < whole.counters[2]


def test_bounds_are_costs_to_go_up_to_a_limit():
    rng = np.random.default_rng(1)
    space = long_space(rng.random((24, 25, 1)) < 0.006)
    grid = lattice.make_lattice(space, 1, 2.0)
    free = [n for n in range(len(grid.rate)) if lattice_cells.rate_of(grid, n) > 0]
    goal, start = free[5], free[-5]
    lattice.open_goal(grid, goal)
    lattice_search.expand(grid, 0, -1, 10**6, 0)  # the border's cell is never closed
    exact = grid.cost.copy()
    limit = int(exact[start]) + 500
    drawn = lattice.make_lattice(space, 1, 2.0)
    assert lattice_cells.rate_of(drawn, goal) > 0
    lattice.open_goal(drawn, goal, start)
    assert lattice_search.expand(drawn, start, start, 10**6, 501)
    bounds = lattice_search.bounds_to_go(drawn, start, limit)
    python = lattice_search.bounds_to_go.py_func(drawn, start, limit)
    assert python.tobytes() == bounds.tobytes()
    # No bound depends on the cells that a search in all directions closes beyond them.
    assert lattice_search.bounds_to_go(grid, start, limit).tobytes() == bounds.tobytes()
    exact_bounds = 0
    for (i, j), bound in np.ndenumerate(bounds.reshape(24, 25)):
        cell = ((i + 1) * 27 + j + 1) * 3 + 1
        x, y = abs(i + 1 - start // 81), abs(j + 1 - start // 3 % 27)
        least = 16 * (12 * max(x, y) + 5 * min(x, y))
        reached = grid.state[cell] == lattice_cells.CLOSED and exact[cell] + least <= limit
        assert bound == (exact[cell] if reached else max(limit - least, 0)) // 2
        exact_bounds += reached
    assert 50 < exact_bounds < len(free)


@pytest.mark.parametrize(("seed", "factor"), [(6, 2), (7, 3)])
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


@pytest.mark.parametrize(("seed", "factor"), [(6, 2), (7, 3)])
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
