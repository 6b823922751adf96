import itertools
import math

import numpy as np
import pytest

from wayproof.harness.bench.micro import plan as bench_plan
from wayproof.planners import PLANNERS, GoalField, PlannerConfig, plan

FIELDS = [
    "robot",
    "planner",
    "queries",
    "success",
    "p50_ms",
    "p99_ms",
    "length_ratio_mean",
    "length_ratio_p99",
    "clearance_mean_m",
]


@pytest.fixture(scope="module")
def ground():
    return bench_plan.ground(bench_plan.warehouse(0))


@pytest.fixture(scope="module")
def queries(ground):
    return bench_plan.make_queries(ground, 6, seed=0)


def test_references_are_free_and_short(ground, queries):
    space = ground[1]
    for query in queries:
        assert np.array_equal(query.reference[[0, -1]], [query.start, query.goal])
        assert all(space.edge_free(a, b) for a, b in itertools.pairwise(query.reference))
        assert 14.0 <= math.dist(query.start, query.goal) <= query.length + 1e-9
        found = plan(space, query.start, query.goal, PlannerConfig(clearance_weight=0.0), 1)
        assert query.length <= 1.02 * found.length


def test_clearance_by_hand():
    blocked = np.zeros((40, 40, 1), dtype=bool)
    blocked[:, 0] = True
    space = bench_plan._spaces(blocked, bench_plan.DRONE, flat=True)[1]
    y = (20 + 0.5) * bench_plan.RESOLUTION  # 20 cells from the wall's centres
    path = np.array([[0.5, y, 0.025], [1.5, y, 0.025]])
    assert bench_plan.clearance_mean(space, path) == pytest.approx(1.0)


def test_a_box_on_the_path_is_planned_around(ground, queries):
    space = ground[0]
    for query in queries:
        kept = GoalField(query.goal, PlannerConfig())
        found = kept.plan(space, query.start, query.seed, query.heading)
        put = bench_plan.put_box(space, found.waypoints, query.seed)
        if put is None:
            continue
        changed, (low, high) = put
        differ = np.argwhere(changed.field != space.field)
        assert (differ >= low).all()
        assert (differ < high).all()
        poses = np.column_stack((found.waypoints, found.headings))
        assert changed.sweep_cost(poses) == math.inf
        again = kept.plan(changed, query.start, query.seed, query.heading, (low, high))
        poses = np.column_stack((again.waypoints, again.headings))
        assert changed.sweep_cost(poses) == again.cost < math.inf


def test_paths_are_blended_and_timed(ground, queries):
    plans = bench_plan._plan_row("drone", "astar", ground[0], queries[:2], PlannerConfig())[1]
    blends, trajectory = bench_plan._trajectory_rows("drone", ground[0], plans)
    assert (blends.planner, trajectory.planner) == ("blends", "trajectory")
    assert blends.success == trajectory.success == 1.0
    assert 0.9 < blends.length_ratio_mean <= 1.0


def test_every_planner_has_a_row(ground, queries):
    rows = []
    for name in PLANNERS:
        config = PlannerConfig(name=name, iterations=300)
        row, plans = bench_plan._plan_row("quadruped", name, ground[0], queries[:2], config)
        assert row.success == sum(one.label == "none" for one in plans) / 2
        rows.append(row)
    assert [row.planner for row in rows] == list(PLANNERS)
    assert list(vars(rows[0])) == FIELDS
    assert next(row for row in rows if row.planner == "astar").success == 1.0
