import dataclasses
import heapq
import itertools
import math

import numpy as np
import pytest
from scipy.interpolate import RegularGridInterpolator

from tests.planners.worlds import make_space, point
from wayproof.planners import Body, FreeSpace, PlannerConfig, plan
from wayproof.planners.astar import lattice
from wayproof.planners.astar.primitives import LENGTHS, STEPS, motion_primitives
from wayproof.planners.astar.se2 import reversible, se2_path
from wayproof.planners.kernels import (
    angles,
    free_box,
    headed,
    heap,
    lattice_cells,
    lattice_search,
    pose_shortcut,
    se2_search,
    sweep,
    sweep_cost,
)
from wayproof.planners.kernels.se2_search import Plane

BODY = Body((-0.3, 0.0, 0.3), (0.2, 0.2, 0.2))


def long_space(blocked: np.ndarray, body: Body = BODY) -> FreeSpace:
    space = make_space(blocked)
    discs = body.discs(0.0, space.resolution, flat=True)
    least = min(disc.collision_distance_sq for disc in discs)
    return dataclasses.replace(space, collision_distance_sq=least, discs=discs)


@pytest.fixture(scope="module")
def bend() -> FreeSpace:
    """A lane 0.9 m wide that bends by a right angle over a chamfer; the body's disc needs 1.1 m."""
    blocked = np.ones((60, 60, 1), dtype=bool)
    blocked[5:40, 10:19] = False
    blocked[31:40, 10:55] = False
    for k in range(8):
        blocked[23 + k : 32, 19 + k] = False
    return long_space(blocked)


def bits(value: object) -> list[float]:
    return np.asarray(value, dtype=np.float64).tolist()


def test_a_body_gets_round_a_bend_that_its_disc_does_not(bend):
    start, goal = point(bend, 12.5, 14.5), point(bend, 35.5, 48.5)
    poses = se2_path(bend, (*start, 0.0), (*goal, 0.0), 10**6)
    assert poses is not None
    assert bend.free_poses(poses) == len(poses)
    assert bits(poses[0, :3]) == bits(start)
    assert bits(poses[-1, :3]) == bits(goal)
    found = plan(bend, start, goal, PlannerConfig(), seed=1)
    assert found.label == "none"
    again = plan(bend, start, goal, PlannerConfig(), seed=1)
    assert again.waypoints.tobytes() == found.waypoints.tobytes()


def test_it_backs_out_of_a_dead_end(bend):
    blocked = np.zeros((60, 30, 1), dtype=bool)
    blocked[:30, :10] = blocked[:30, 19:] = True
    space = long_space(blocked)
    start, goal = point(space, 8.5, 14.5), point(space, 50.5, 14.5)
    poses = se2_path(space, (*start, math.pi), (*goal, 0.0), 10**6)
    inside = poses[poses[:, 0] < point(space, 24, 0)[0]]
    assert len(inside) > 1
    assert np.abs(np.cos(inside[:, 3]) + 1.0).max() < 0.15  # tail first, where it cannot turn


def test_no_way_and_no_node_are_told(bend):
    blocked = np.zeros((60, 30, 1), dtype=bool)
    blocked[30] = True
    space = long_space(blocked)
    start, goal = (*point(space, 8.5, 14.5), 0.0), (*point(space, 50.5, 14.5), 0.0)
    assert se2_path(space, start, goal, 10**6) is None
    assert se2_path(space, start, (*point(space, 30.5, 14.5), 0.0), 10**6) is None


def test_only_bodies_as_long_behind_as_ahead_go_tail_first(bend):
    assert reversible(bend)
    assert not reversible(long_space(np.zeros((9, 9, 1), bool), Body((0.0, 0.3), (0.2, 0.2))))


def test_tables_by_hand():
    ways = motion_primitives((0.0,), 0, 1)
    assert ways.lengths.tolist() == [LENGTHS[x * x + y * y] for x, y in STEPS]
    cells = [cells_of(ways.stepped, way) for way in range(16)]
    assert cells[0] == {(0, 0), (1, 0)}
    assert cells[2] == {(0, 0), (1, 0), (0, 1), (1, 1)}  # through the corner of four
    assert cells[1] == {(0, 0), (1, 0), (1, 1), (2, 1)}
    assert ways.turned.counts.tolist() == [[1]] * 16  # the centre of the body stays


def cells_of(swept, motion):
    """All cells that the discs touch on a motion."""
    return {
        tuple(cell)
        for cells, count in zip(swept.cells[motion], swept.counts[motion], strict=True)
        for cell in cells[:count].tolist()
    }


def test_motions_are_free_where_all_their_cells_are():
    rng = np.random.default_rng(4)
    space = long_space(rng.random((40, 30, 1)) < 0.02)
    plane = Plane(
        space.field[:, :, 0], space.collision_distance_sq, np.full(201, 8, np.int32), 2, (20, 15)
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
    # Of what a search in all directions has closed as well, nothing else is told.
    assert lattice_search.bounds_to_go(grid, start, limit).tobytes() == bounds.tobytes()
    told = 0
    for (i, j), bound in np.ndenumerate(bounds.reshape(24, 25)):
        cell = ((i + 1) * 27 + j + 1) * 3 + 1
        x, y = abs(i + 1 - start // 81), abs(j + 1 - start // 3 % 27)
        least = 16 * (12 * max(x, y) + 5 * min(x, y))
        reached = grid.state[cell] == lattice_cells.CLOSED and exact[cell] + least <= limit
        assert bound == (exact[cell] if reached else max(limit - least, 0)) // 2
        told += reached
    assert 50 < told < len(free)


def search_problem():
    blocked = np.zeros((24, 20, 1), dtype=bool)
    blocked[12, :10] = True
    blocked[4:10, 3] = blocked[4:10, 13] = True
    space = long_space(blocked)
    rates = np.full(201, 8, np.int32)
    plane = Plane(space.field[:, :, 0], space.collision_distance_sq, rates, 1, (24, 20))
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
        told = RegularGridInterpolator([*map(np.arange, nodes.shape)], nodes.astype(float))
        there = np.stack(np.meshgrid(*inner, indexing="ij"), axis=-1)
        assert np.abs(cells - told(there) * factor).max() <= 1.0


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


def test_the_first_place_that_sweeps_lead_to(bend):
    start = (*point(bend, 12.5, 14.5).tolist(), 0.3)
    places = np.array([point(bend, x, y)[:2] for x, y in ((12.5, 11.5), (13.5, 14.5))])
    headings = np.arange(16) * math.pi / 8.0
    place, free = sweep.free_headings(bend.grid, bend.shape, start, places, headings)
    python = sweep.free_headings.py_func(bend.grid, bend.shape, start, places, headings)
    assert python[0] == place == 1
    assert python[1].tobytes() == free.tobytes()
    for (m, gear), one in np.ndenumerate(free):
        there = angles.wrap(headings[m] + gear * math.pi)
        near = gear == 0 or abs(angles.wrap(there - 0.3)) <= 0.5 * math.pi
        pose = np.array([*places[1], start[2], there])
        assert one == (near and bend.sweep_free(np.array(start), pose))
    assert 0 < free.sum() < 16


def naive_headed_length(space: FreeSpace, path: np.ndarray) -> float:
    """Every step of every sweep looked at, in Python."""
    length, heading = 0.0, None
    for a, b in itertools.pairwise(path):
        ahead = angles.yaw_of_direction(b[0] - a[0], b[1] - a[1])
        for facing in (ahead, ahead + math.pi):
            poses = np.array([[*a, facing], [*b, facing]])
            if heading is not None:
                poses = np.vstack(([[*a, heading]], poses))
            if space.free_sweep_length(poses) >= math.dist(a, b) - 1e-9 and _turns(space, poses):
                heading = facing
                break
        else:
            return length
        length += math.dist(a, b)
    return length


def _turns(space: FreeSpace, poses: np.ndarray) -> bool:
    share = np.linspace(0.0, 1.0, 200)
    turn = angles.wrap(poses[1, 3] - poses[0, 3])
    if len(poses) == 2:
        return space.pose_free(poses[0, :3], poses[0, 3])
    return all(space.pose_free(poses[0, :3], poses[0, 3] + s * turn) for s in share)


def test_edges_in_free_boxes_are_free_one_by_one():
    partly = 0
    for seed in range(12):
        rng = np.random.default_rng(seed)
        space = long_space(rng.random((60, 60, 1)) < 0.006)
        corners = np.array([point(space, x, y) for x, y in rng.uniform(8.0, 52.0, size=(5, 2))])
        t = np.linspace(0.0, 1.0, 20)[:-1, None]
        path = np.vstack([a + t * (b - a) for a, b in itertools.pairwise(corners)])
        found = space.free_length(path)
        assert found == headed.headed_free_length.py_func(space.grid, space.shape, path)
        assert found == pytest.approx(naive_headed_length(space, path), abs=1e-9)
        partly += 0.0 < found < 1.0
        low, high = tuple(path[:4].min(axis=0)), tuple(path[:4].max(axis=0))
        box = free_box.box_free(space.grid, 7, low, high, 0.3)
        reach = np.array([0.3, 0.3, 0.0])
        first = np.floor((np.array(low) - reach - space.origin) / 0.1).astype(int)
        last = np.floor((np.array(high) + reach - space.origin) / 0.1).astype(int)
        cells = space.field[first[0] - 1 : last[0] + 2, first[1] - 1 : last[1] + 2]
        assert box == bool((cells > 7).all())
        assert free_box.box_free.py_func(space.grid, 7, low, high, 0.3) == box
    assert partly > 0


def test_a_box_that_leaves_the_grid_is_not_free(bend):
    empty = make_space(np.zeros((20, 20, 1), dtype=bool))
    middle = tuple(point(empty, 10, 10).tolist())
    assert free_box.box_free(empty.grid, 4, middle, middle, 0.8)
    assert not free_box.box_free(empty.grid, 4, middle, middle, 1.0)
    assert not free_box.box_free(empty.grid, 4, (math.nan, 0.0, 0.0), middle, 0.1)


def slanted_lane() -> FreeSpace:
    """A dead end at 11 degrees, too narrow for the headings that a search has."""
    x, y = np.meshgrid(np.arange(120) + 0.5, np.arange(60) + 0.5, indexing="ij")
    off = np.abs((y - 20.0) * math.cos(0.19) - (x - 5.0) * math.sin(0.19))
    return long_space(((off > 3.1) & (x < 45))[:, :, None])


def test_where_no_heading_of_the_search_fits_others_are_drawn():
    space = slanted_lane()
    start, goal = point(space, 16.0, 20.0 + 11.0 * math.tan(0.19)), point(space, 100.5, 30.5)
    assert space.pose_free(start, 0.19)
    assert se2_path(space, (*start, 0.19), (*goal, 0.0), 10**6) is None
    found = plan(space, start, goal, PlannerConfig(), seed=1, heading=0.19)
    assert found.label == "none"
    assert space.free_poses(np.column_stack((found.waypoints, found.headings))) == len(
        found.waypoints
    )


def test_poses_are_counted_up_to_the_first_that_does_not_fit(bend):
    start, far = point(bend, 12.5, 14.5), point(bend, 33.5, 14.5)
    poses = np.array([[*start, 0.0], [*far, 0.0], [*far, 1.3], [*start, 1.3]])
    assert bend.free_poses(poses[:2]) == 2
    assert bend.free_poses(poses[::-1]) == 0  # across the lane
    count = bend.free_poses(poses)
    assert sweep.poses_free_count.py_func(bend.grid, bend.shape, poses) == count < 4


def test_the_length_along_which_a_body_heads(bend):
    lane = np.array([point(bend, 12.5, 14.5), point(bend, 22.5, 14.5), point(bend, 32.5, 14.5)])
    assert bend.free_length(lane) == pytest.approx(2.0)
    assert bend.free_length(lane[::-1]) == pytest.approx(2.0)  # nose or tail first
    across = np.vstack((lane[:2], point(bend, 22.5, 16.5)))
    assert bend.free_length(across) == pytest.approx(1.0)  # it cannot turn there
    python = headed.headed_free_length.py_func(bend.grid, bend.shape, across)
    assert python == bend.free_length(across)


def test_the_nearest_pose(bend):
    wall = point(bend, 15.5, 12.0)
    along, across = np.zeros(1), np.full(1, 0.5 * math.pi)
    found = bend.nearest_pose(wall, 0.5, along)
    assert bend.pose_free(found[:3], found[3])
    assert found[0] == pytest.approx(wall[0])
    assert bend.nearest_pose(wall, 0.5, across) is None
    arguments = bend.grid, bend.shape, (*wall.tolist(), 0.0), 5.0, along
    python = sweep.nearest_pose.py_func(*arguments)
    assert python == sweep.nearest_pose(*arguments)


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


@pytest.mark.parametrize("python", [False, True])
def test_cheaper_is_the_sum_of_the_sweeps(python):
    cheaper = pose_shortcut.is_cheaper.py_func if python else pose_shortcut.is_cheaper
    rng = np.random.default_rng(13)
    space = long_space(rng.random((60, 60, 1)) < 0.003)
    grid, discs, told = space.grid, space.shape, []
    size = np.array(space.field.shape[:2]) * space.resolution
    for k in range(100 if python else 600):
        places = space.origin[:2] + rng.uniform(0.2, 0.8, (3, 2)) * size
        u, apex, v = (
            (float(x), float(y), float(space.origin[2]), float(h))
            for (x, y), h in zip(places, rng.uniform(-3.0, 3.0, 3), strict=True)
        )
        poses = np.empty((8, 4))
        poses[0] = u
        end = pose_shortcut.write_detour(u, apex[:3], v, bool(k % 2), poses)
        poses[end] = v
        edges = zip(poses[:end].tolist(), poses[1 : end + 1].tolist(), strict=True)
        cost = sum(sweep_cost.sweep_cost(grid, discs, 2.0, tuple(a), tuple(b)) for a, b in edges)
        length = sum(math.dist(a[:3], b[:3]) for a, b in itertools.pairwise(poses[: end + 1]))
        for than in (cost - 1e-6, cost + 1e-6, cost + 0.1, length + 0.3):
            told.append(cheaper(grid, discs, 2.0, poses[: end + 1], than))
            assert told[-1] == (cost < than)
    assert 10 < sum(told) < len(told) - 10
