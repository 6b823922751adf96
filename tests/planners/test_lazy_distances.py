"""Planning on lazy distances equals planning on distances that are all up to date."""

import dataclasses

import numpy as np
import pytest

from tests.planners.stale_distances import StaleSource
from tests.planners.worlds import make_boxes, make_space, point
from wayproof.maps import Distances
from wayproof.maps.costmap.distance_field import BLOCK_ROWS
from wayproof.planners import (
    FreeSpace,
    GoalField,
    PlannerConfig,
    best_frontier,
    blend_corners,
    plan,
)
from wayproof.planners.astar import lattice
from wayproof.planners.kernels import lattice_cells, lattice_search
from wayproof.planners.kernels.grid import BLOCK_BITS


def make_lazy(space: FreeSpace, seed: int) -> tuple[FreeSpace, StaleSource]:
    """The same space with lazy distances, wrong wherever they were not read."""
    source = StaleSource(space.field, seed)
    distances = Distances(source, space.field.shape)
    return dataclasses.replace(space, distances=distances), source


def lazy_again(space: FreeSpace, source: StaleSource, searched_before: np.ndarray) -> FreeSpace:
    """The space after an update of its window, the blocks of the last search given."""
    distances = Distances(source, space.distances.cells.shape, searched_before=searched_before)
    return dataclasses.replace(space, distances=distances)


def resolve_all(space: FreeSpace, query):
    """The answer of a query on up-to-date distances, parts of which resolve by themselves."""
    while True:
        space.distances.reader.missed = False
        answer = query(space)
        if not (space.distances.catch_up() or space.distances.reader.missed):
            return answer


def test_blocks_are_those_of_the_field():
    assert 1 << BLOCK_BITS == BLOCK_ROWS


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("resolution", [0.05, 0.07, 0.1, 0.2])
def test_a_plan_rests_on_no_distance_that_it_did_not_read(seed, resolution):
    """Lattices of 4, 3, 2 and 1 cells, whose steps touch other blocks than their middles lie in."""
    rng = np.random.default_rng(seed)
    blocked = np.zeros((70, 45, 25), dtype=bool)
    for low in rng.integers([15, 0, 0], [50, 40, 18], size=(12, 3)):
        blocked[tuple(slice(corner, corner + 7) for corner in low)] = True
    space = make_space(blocked, resolution)
    lazy, source = make_lazy(space, seed)
    start, goal = point(space, 4.5, 20.5, 12.5), point(space, 65.5, 22.5, 12.5)
    config = PlannerConfig()
    one, same = plan(space, start, goal, config, seed), plan(lazy, start, goal, config, seed)
    assert one.label == same.label
    assert one.cost == same.cost
    assert one.iterations == same.iterations
    np.testing.assert_array_equal(one.waypoints, same.waypoints)
    assert source.worked_out > 0


def test_after_the_first_one_a_plan_along_a_corridor_leaves_most_distances_alone():
    blocked = np.ones((60, 200, 20), dtype=bool)
    blocked[:, 90:110] = False
    space = make_space(blocked, 0.05)
    lazy, source = make_lazy(space, 0)
    start, goal = point(space, 2.5, 99.5, 9.5), point(space, 56.5, 99.5, 9.5)
    assert plan(lazy, start, goal, PlannerConfig(), 1).label == "none"
    assert source.worked_out == source.stale.size
    before = lazy.distances.searched.copy()
    source.stale[:], source.worked_out = True, 0
    lazy = lazy_again(lazy, source, searched_before=before)
    assert plan(lazy, start, goal, PlannerConfig(), 1).label == "none"
    assert 0 < source.worked_out < 0.25 * source.stale.size


POINTS = np.random.default_rng(3).uniform([0, 0, 0], [60, 40, 25], size=(30, 3))

QUERIES = {
    "is_free": lambda space, path: [space.is_free(place) for place in path],
    "edge_free": lambda space, path: space.edge_free(path[0], path[1]),
    "free_length": lambda space, path: space.free_length(path),
    "nearest_free": lambda space, path: space.nearest_free(path[0], 1.0),
    "least_clearance": lambda space, path: space.least_clearance(path),
    "path_cost": lambda space, path: space.path_cost(path),
    "sweep_free": lambda space, path: space.sweep_free([*path[0], 0.0], [*path[1], 1.0]),
    "blend_corners": lambda space, path: blend_corners(space, path, 0.5),
    "best_frontier": lambda space, path: best_frontier(
        space, space, path[0], path[-1], np.empty((0, 3))
    ),
    "rrtconnect": lambda space, path: (
        plan(space, path[0], path[-1], PlannerConfig("rrtconnect", iterations=50), 1).waypoints
    ),
    "goal_field": lambda space, path: (
        GoalField(path[-1], PlannerConfig()).plan(space, path[0], 1).waypoints
    ),
}


@pytest.mark.parametrize("name", sorted(QUERIES))
def test_every_query_is_answered_as_on_up_to_date_distances(name):
    space = make_boxes()
    lazy, _ = make_lazy(space, 5)
    for n in range(0, len(POINTS), 3):
        path = np.array([point(space, *place) for place in POINTS[n : n + 3]])
        expected = QUERIES[name](space, path)
        answer = lazy.resolve(lambda lazy=lazy, path=path: QUERIES[name](lazy, path))
        if expected is None:
            assert answer is None
        else:
            np.testing.assert_array_equal(answer, expected)
        lazy, _ = make_lazy(space, n)


@pytest.mark.parametrize("factor", [1, 2, 3, 4])
def test_a_search_over_a_lattice_records_all_that_it_reads(factor):
    """With other distances in all blocks that it did not record, it is the same search."""
    rng = np.random.default_rng(factor)
    differed = 0
    for _ in range(30):
        place, budget = rng.uniform(5.0, [56.0, 38.0, 17.0]), int(rng.integers(1, 60))
        space = make_space(rng.random((61, 43, 22)) < 0.002)
        lazy, source = make_lazy(space, factor)
        source.bring_up_to_date()

        def search(lazy=lazy, place=place, budget=budget):
            grid = lattice.make_lattice(lazy, factor, 2.0)
            goal = lattice.entry_cell(grid, lazy, point(lazy, *place))
            if goal >= 0:
                lattice.open_goal(grid, goal)
                lattice_search.expand(grid, goal, -1, budget, 10**6)
            return grid

        first = search()
        lattice.record_reads(first, lazy)
        looked = lazy.distances.searched | lazy.distances.read_blocks
        others = ~looked.T[:, np.arange(43) // BLOCK_ROWS]  # (nx, ny)
        source.squared[others] = 0
        second = search()
        differed += int(others.sum())
        for name in ("rate", "state", "cost"):
            seen = first.state != lattice_cells.NEW if name == "cost" else slice(None)
            np.testing.assert_array_equal(getattr(second, name)[seen], getattr(first, name)[seen])
    assert differed > 0


@pytest.mark.parametrize("name", sorted(QUERIES))
def test_a_query_before_a_plan_is_repeated_if_the_plan_refreshed_what_it_read(name):
    """Start and goal in blocks that are stale when they are read first."""
    space = make_boxes()
    for n in range(10):
        start, goal = (point(space, *place) for place in (POINTS[n], POINTS[-n - 1]))
        path = np.array([start, 0.5 * (start + goal), goal])

        def query(space, path=path):
            answer = QUERIES[name](space, path)
            return answer, plan(space, path[0], path[-1], PlannerConfig(), 1)

        lazy, _ = make_lazy(space, n)
        (answer, planned), (expected, true_plan) = resolve_all(lazy, query), query(space)
        assert (planned.label, planned.cost) == (true_plan.label, true_plan.cost)
        if expected is None:
            assert answer is None
        else:
            np.testing.assert_array_equal(answer, expected)


@pytest.mark.parametrize(("end", "label"), [(0, "start_blocked"), (1, "goal_blocked")])
def test_an_end_that_was_blocked_since_the_last_search_is_seen_to_be(end, label):
    """The blocks of that search are refreshed first, though the ends are read before."""
    free = make_space(np.zeros((60, 40, 20), dtype=bool))
    ends = [point(free, *place) for place in ((5.5, 20.5, 9.5), (50.5, 20.5, 9.5))]
    lazy, source = make_lazy(free, 0)
    config = PlannerConfig()
    assert plan(lazy, *ends, config, 1).label == "none"
    lazy = lazy_again(lazy, source, searched_before=np.ones_like(source.stale))
    x = int((ends[end] - lazy.origin)[0] / lazy.resolution)
    source.true = source.true.copy()
    source.true[x, 18:24] = 0
    source.stale[:] = True
    assert plan(lazy, *ends, config, 1).label == label
