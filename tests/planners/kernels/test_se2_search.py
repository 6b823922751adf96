import heapq

import numpy as np
import pytest
from scipy.interpolate import RegularGridInterpolator

from tests.planners.lattices import cells_of
from tests.planners.worlds import long_space
from wayproof.planners.astar.primitives import motion_primitives
from wayproof.planners.kernels import (
    se2_search,
)
from wayproof.planners.kernels.se2_search import Plane


def test_motions_are_free_where_all_their_cells_are():
    rng = np.random.default_rng(4)
    space = long_space(rng.random((40, 30, 1)) < 0.02)
    plane = Plane(
        space.distances[:, :, 0],
        space.collision_distance_sq,
        space.grid.price[:, :, 0],
        np.full(201, 8, np.int32),
        np.zeros(1, np.int32),
        2,
        (20, 15),
    )
    ways = motion_primitives((-1.5, 0.0, 2.0), plane.threshold, plane.factor)
    shortened = 0
    for swept in (ways.stepped, ways.turned, ways.spun):
        for motion, (i, j) in zip(
            rng.integers(0, len(swept.counts), 400), rng.integers(-2, 42, (400, 2)), strict=True
        ):
            free = se2_search.motion_free(plane, i, j, swept, motion)
            assert se2_search.motion_free.py_func(plane, i, j, swept, motion) == free
            assert free == fits(plane, i, j, cells_of(swept, motion))
            x, y = np.clip((i, j) + swept.middles[motion, 0], 0, (39, 29))
            shortened += bool(free and plane.field[x, y] > swept.enough[motion, 0])
    assert shortened > 100


def fits(plane, i, j, cells):
    """Whether all cells at these offsets from a grid cell are in the plane and free."""
    at = np.array(sorted(cells)) + np.array((i, j))
    inside = ((at >= 0) & (at < plane.field.shape)).all()
    return bool(inside) and bool((plane.field[tuple(at.T)] > plane.threshold).all())


def search_problem():
    blocked = np.zeros((24, 20, 1), dtype=bool)
    blocked[12, :10] = True
    blocked[4:10, 3] = blocked[4:10, 13] = True
    space = long_space(blocked)
    rates = np.full(201, 8, np.int32)
    price, priced = space.grid.price[:, :, 0], np.zeros(1, np.int32)
    threshold = space.collision_distance_sq
    plane = Plane(space.distances[:, :, 0], threshold, price, rates, priced, 1, (24, 20))
    ways = motion_primitives((-0.3 / 0.1, 0.0, 0.3 / 0.1), plane.threshold, 1)
    ways = ways._replace(turn_cost=40, reversal_cost=900)
    goal, starts = 18 * 20 + 8, np.array([(5 * 20 + 8) * 16, (5 * 20 + 8) * 16 + 8])
    # Bounds of nothing: the search is one in all directions, and exact.
    to_go = np.zeros(24 * 20, np.int32)
    return plane, ways, to_go, starts, np.array([0, 900]), goal, 10**6


@pytest.mark.parametrize(
    "run", [se2_search.interpolate_bounds, se2_search.interpolate_bounds.py_func]
)
def test_cells_lie_between_the_nodes(run):
    rng = np.random.default_rng(3)
    for factor, shape in ((2, (9, 14)), (3, (10, 6)), (4, (5, 17))):
        nodes = rng.integers(0, 1 << 20, [n // factor for n in shape]).astype(np.int32)
        cells = np.empty(shape, np.int32)
        run(nodes, factor, cells)
        places = [(np.arange(n) - factor // 2) / factor for n in shape]
        inner = [  # left of the outer nodes the cells are mirrored, right of them they are the same
            np.minimum(np.where(p < 0, p % 1, p), n - 1)
            for p, n in zip(places, nodes.shape, strict=True)
        ]
        interpolated = RegularGridInterpolator([*map(np.arange, nodes.shape)], nodes.astype(float))
        there = np.stack(np.meshgrid(*inner, indexing="ij"), axis=-1)
        assert np.abs(cells - interpolated(there) * factor).max() <= 1.0


def test_compiled_search_equals_python():
    arguments = search_problem()
    states, wide = se2_search.search_states(*arguments)
    assert states[0] == arguments[3][0]
    assert states[-1] // 16 == arguments[5]
    assert not wide[0]
    assert wide[-1]
    python = se2_search.search_states.py_func(*arguments)
    assert python[0].tobytes() == states.tobytes()
    assert python[1].tobytes() == wide.tobytes()
    assert len(se2_search.search_states(*arguments[:-1], 3)[0]) == 0


def moves(plane, ways, state):
    """All moves from a state, (state, cost), and whether the body turns about freely there."""
    node, way = divmod(state, 16)
    i, j = divmod(node, plane.shape[1])
    turned = [fits(plane, i, j, cells_of(ways.turned, n)) for n in range(16)]
    wide = all(turned)
    found = [(node * 16 + (way + 8) % 16, 0 if wide else ways.reversal_cost)]
    for n, to in ((way, (way + 1) % 16), ((way - 1) % 16, (way - 1) % 16)):
        if turned[n]:
            found.append((node * 16 + to, 0 if wide else ways.turn_cost))
    if fits(plane, i, j, cells_of(ways.stepped, way)):
        x, y = np.array((i, j)) + ways.steps[way]
        if 0 <= x < plane.shape[0] and 0 <= y < plane.shape[1]:
            found.append(((x * plane.shape[1] + y) * 16 + way, 8 * int(ways.lengths[way])))
    return found, wide


def test_a_search_without_bounds_costs_what_a_naive_one_does():
    plane, ways, to_go, starts, prices, goal, budget = search_problem()
    costs, queue = {}, [(int(p), int(s)) for p, s in zip(prices, starts, strict=True)]
    while queue:
        cost, state = heapq.heappop(queue)
        if state in costs:
            continue
        costs[state] = cost
        if state // 16 == goal:
            break
        for to, price in moves(plane, ways, state)[0]:
            heapq.heappush(queue, (cost + price, int(to)))
    states, wide = se2_search.search_states(plane, ways, to_go, starts, prices, goal, budget)
    total = int(prices[starts.tolist().index(states[0])])
    for a, b, turns in zip(states[:-1].tolist(), states[1:].tolist(), wide[:-1], strict=True):
        assert bool(moves(plane, ways, a)[1]) == turns
        if turns and a // 16 == b // 16:
            continue
        total += dict(moves(plane, ways, a)[0])[b]
    assert total == cost
    assert not wide.all()
