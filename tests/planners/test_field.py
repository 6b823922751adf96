import dataclasses
import heapq
import itertools

import numpy as np
import pytest

from tests.planners.worlds import make_space, point
from wayproof.planners import (
    Body,
    FreeSpace,
    GoalField,
    PlannerConfig,
    plan,
)
from wayproof.planners.astar import lattice
from wayproof.planners.kernels import heuristic, lattice_cells, lattice_search, repair
from wayproof.planners.kernels.segment import walk_path


def random_space(seed: int, shape=(24, 20, 1), pillars: int = 0) -> FreeSpace:
    """Random boxes in cells of 1 m from the origin, whose centres are exact in binary."""
    rng = np.random.default_rng(seed)
    blocked = np.zeros(shape, dtype=bool)
    for low in rng.integers(0, np.array(shape), size=(6, 3)):
        blocked[tuple(slice(corner, corner + 4) for corner in low)] = True
    for x, y in rng.integers(0, np.array(shape[:2]), size=(pillars, 2)):
        blocked[x : x + 4, y : y + 4] = True
    return dataclasses.replace(make_space(blocked), origin=np.zeros(3), resolution=1.0)


def moves_of(grid):
    """Flat offset and length of each move."""
    return zip(grid.move_offsets.tolist(), grid.move_lengths.tolist(), strict=True)


def free_lattice(space: FreeSpace, factor: int, repairable: bool = False):
    grid = lattice.make_lattice(space, factor, 2.0, repairable)
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


@pytest.mark.parametrize("repairable", [False, True])
@pytest.mark.parametrize(
    ("shape", "factor"), [((24, 20, 1), 1), ((25, 21, 1), 2), ((21, 18, 13), 3)]
)
def test_costs_to_go_are_those_of_a_naive_search(shape, factor, repairable):
    space = random_space(3, shape)
    grid, free = free_lattice(space, factor, repairable)
    goal = free[len(free) // 2]
    lattice.open_goal(grid, goal)
    lattice_search.expand(grid, 0, -1, 10**6, 0)  # the border's cell is never closed
    assert closed_costs(grid) == naive_costs(space, grid, free, goal)


def test_a_search_drawn_to_a_target_costs_the_same_and_looks_at_less():
    space = random_space(5, (60, 60, 1))
    whole, free = free_lattice(space, 1)
    goal = free[10]
    lattice.open_goal(whole, goal)
    lattice_search.expand(whole, 0, -1, 10**6, 0)
    for start in [cell for cell in free[::97] if whole.state[cell] == lattice_cells.CLOSED]:
        drawn, _ = free_lattice(space, 1)
        lattice.open_goal(drawn, goal, start)
        assert lattice_search.expand(drawn, start, start, 10**6, 0)
        assert drawn.cost[start] == whole.cost[start]
        assert drawn.counters[2] <= whole.counters[2]
        cells = lattice_search.descend(drawn, start)
        assert (cells[0], cells[-1]) == (start, goal)


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


@pytest.mark.parametrize(("seed", "factor"), [(5, 1), (6, 2), (7, 3)])
def test_columns_tell_never_more_than_it_costs(seed, factor):
    _, grid, goal, start, costs = lattice_in_space(seed, factor)
    straight = {cell: heuristic.heuristic(grid, cell, start) for cell in costs}
    assert heuristic.bound_columns(grid, goal, start)
    told = {cell: int(grid.column_bound[cell // grid.shape[2]]) for cell in costs}
    assert all(told[cell] <= cost for cell, cost in costs.items())
    assert sum(told[cell] > 1.2 * straight[cell] for cell in costs) > 0.4 * len(costs)
    for cell in list(costs)[::9]:
        for offset, step in zip(
            grid.move_offsets.tolist(), grid.move_lengths.tolist(), strict=True
        ):
            if cell + offset in costs:  # as A* asks for, no step gains more than it costs
                both = sum(lattice_cells.rate_of(grid, at) for at in (cell, cell + offset))
                assert told[cell] <= told[cell + offset] + step * both


@pytest.mark.parametrize(("seed", "factor"), [(5, 1), (6, 2), (7, 3)])
def test_a_search_drawn_by_columns_finds_the_same_way_and_looks_at_less(seed, factor):
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


def test_plans_that_spare_distances_are_as_cheap_and_search_more_cells():
    blocked = np.zeros((280, 260, 60), dtype=bool)
    rng = np.random.default_rng(2)
    for x, y in rng.integers(20, [230, 210], size=(16, 2)):
        blocked[x : x + 30, y : y + 30] = True
    space = make_space(blocked, 0.05)  # a lattice cell is 4 of them along each axis
    start, goal = point(space, 8.5, 8.5, 20.5), point(space, 270.5, 250.5, 40.5)
    config = PlannerConfig(name="astar", shortcuts=0, corner_cost=0.0)
    plans = [
        plan(dataclasses.replace(space, few_reads=few_reads), start, goal, config, seed=1)
        for few_reads in (False, True)
    ]
    assert plans[0].cost == pytest.approx(plans[1].cost, rel=0.02)
    assert plans[0].iterations < 0.7 * plans[1].iterations


def test_columns_that_were_not_noted_decide_nothing():
    space, grid, _, start, costs = lattice_in_space(5, 1)
    near = min(costs, key=lambda cell: abs(costs[cell] - 2000))
    assert heuristic.bound_columns(grid, near, start)
    noted = np.zeros((grid.shape[1] - 2, grid.shape[0] - 2), np.bool_)
    lattice_cells.mark_read_blocks(grid.rate, grid.shape, grid.factor, 0, noted)
    assert 0 < noted.sum() < 0.5 * noted.size
    space.grid.field[~noted.T] = 0
    again = opened(space, 1, start, near)
    assert heuristic.bound_columns(again, near, start)
    assert again.column_bound.tobytes() == grid.column_bound.tobytes()


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
    pair = [free_lattice(space, 2, repairable=True) for _ in range(2)]
    goal, start = pair[0][1][0], pair[0][1][-1]
    for (grid, _), python in zip(pair, (False, True), strict=True):
        lattice.open_goal(grid, goal)
        expand, mend, refresh_box, descend, requeue = (
            kernel.py_func if python else kernel
            for kernel in (
                lattice_search.expand,
                repair.repair,
                repair.refresh_box,
                lattice_search.descend,
                lattice_search.requeue,
            )
        )
        assert expand(grid, start, -1, 10**6, 0)
        space.grid.field[6:9, 4:8, 2:5] = 0
        changed = refresh_box(grid, np.ones(3, np.int64), grid.shape - 1)
        mend(grid, changed)
        opened = np.flatnonzero(grid.state == lattice_cells.OPEN)
        requeue(grid, start, opened)
        assert grid.counters[lattice_cells.OPENED] == len(opened) > 0
        expand(grid, start, start, 10**6, 1)
        if grid.state[start] == lattice_cells.CLOSED:
            assert descend(grid, start)[-1] == goal
        space.grid.field[6:9, 4:8, 2:5] = 200
    (compiled, _), (python, _) = pair
    assert closed_costs(compiled) == closed_costs(python)
    assert compiled.rate.tobytes() == python.rate.tobytes()


def test_a_gap_that_the_coarse_lattice_lacks_is_found_on_the_grid():
    blocked = np.zeros((60, 60, 1), dtype=bool)
    blocked[30] = True
    field = np.where(blocked, 0, 100).astype(np.uint16)
    field[30, 32] = 100  # one cell wide, not in the middle of any block of two
    space = FreeSpace(field, np.zeros(3), 0.05, 4, np.zeros(101))
    start, goal = np.array([0.5, 0.5, 0.025]), np.array([2.5, 0.5, 0.025])
    found = plan(space, start, goal, PlannerConfig(name="astar"), seed=1)
    assert found.label == "none"
    assert all(space.edge_free(a, b) for a, b in itertools.pairwise(found.waypoints))
    crossing = np.abs(found.waypoints[:, 0] - 1.525).argmin()
    assert found.waypoints[crossing, 1] == pytest.approx(1.625, abs=0.1)


def put_box(space: FreeSpace, rng: np.random.Generator, boxes: list[np.ndarray]):
    """A random box comes and the oldest of four goes; the new space, and the cells that differ."""
    low = rng.integers(0, np.array(space.field.shape))
    boxes.append(np.array([low, low + rng.integers(2, 7, size=3)]))
    del boxes[:-4]
    blocked = np.zeros(space.field.shape, dtype=bool)
    for box in boxes:
        blocked[tuple(slice(a, b) for a, b in zip(*box, strict=True))] = True
    after = make_space(blocked)
    differ = np.argwhere(after.field != space.field)
    return after, (differ.min(axis=0), differ.max(axis=0) + 1)


def test_all_cells_of_all_cheapest_ways_are_closed_when_drawn_on():
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


def test_a_long_body_is_replanned_for_as_anew():
    rng = np.random.default_rng(3)
    body = Body((-0.3, 0.0, 0.3), (0.2, 0.2, 0.2)).discs(0.0, 0.1, flat=True)
    walls = np.zeros((60, 50, 1), dtype=bool)
    walls[:25, 40] = walls[:25, 49] = True  # between them it cannot turn about
    space, boxes, turned = make_space(walls), [], 0
    kept = GoalField(point(space, 55.5, 5.5), PlannerConfig())
    for step in range(30):
        space, _ = put_box(space, rng, boxes)
        both = make_space(walls | (space.field == 0))
        long = dataclasses.replace(both, collision_distance_sq=7, discs=body)
        start, heading = point(space, 5.5 + 0.3 * step, 44.9), 0.4 * (step % 2)
        again = kept.plan(long, start, seed=step + 1, heading=heading)
        fresh = GoalField(kept.goal, PlannerConfig()).plan(long, start, step + 1, heading)
        assert again.label == fresh.label
        if again.waypoints is not None:
            assert again.waypoints.tobytes() == fresh.waypoints.tobytes()
            assert again.headings.tobytes() == fresh.headings.tobytes()
            assert not long.turnable(start[None])[0]
            turned += 1
    assert turned > 8


@pytest.mark.parametrize("shape", [(60, 50, 1), (30, 26, 16)])
@pytest.mark.parametrize("told", [False, True])
def test_replanning_is_the_same_as_planning_anew(shape, told):
    rng = np.random.default_rng(7)
    space, boxes = make_space(np.zeros(shape, dtype=bool)), []
    depth = 0.5 if shape[2] == 1 else 8.5
    goal = point(space, shape[0] - 4.5, 5.5, depth)
    kept, plans = GoalField(goal, PlannerConfig()), set()
    for step in range(40):
        space, box = put_box(space, rng, boxes)
        start = point(space, 4.5 + 0.2 * step, shape[1] - 5.5, depth)
        if step % 5 == 4:  # a start or goal that is blocked must not make it miss a change
            start = point(space, -1.0, 0.0, depth)
        again = kept.plan(space, start, seed=step + 1, changed=box if told else None)
        fresh = GoalField(goal, PlannerConfig()).plan(space, start, seed=step + 1)
        assert again.label == fresh.label
        if again.waypoints is None:
            continue
        plans.add(again.waypoints.tobytes())
        assert again.waypoints.tobytes() == fresh.waypoints.tobytes()
        assert again.cost == fresh.cost
        _, least, _ = walk_path(space.grid, space.collision_distance_sq, 0.0, again.waypoints)
        assert least > space.collision_distance_sq
    assert len(plans) > 25
