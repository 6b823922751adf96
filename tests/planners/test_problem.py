import hashlib
import itertools
import math
import os
import subprocess
import sys
import types

import numpy as np
import pytest
from ompl import base as ob
from ompl import geometric as og

from tests.planners.worlds import make_space, point
from wayproof.planners import PLANNERS, PlannerConfig, kernels, plan

ITERATIONS = 2000


def config(name: str) -> PlannerConfig:
    return PlannerConfig(name=name, iterations=ITERATIONS, restarts=2, shortcuts=60)


def queries(maze, boxes):
    """(space, start, goal) across the maze and past the boxes."""
    return (
        (maze, point(maze, 5.5, 5.5), point(maze, 55.5, 35.5)),
        (boxes, point(boxes, 4.5, 20.5, 12.5), point(boxes, 55.5, 20.5, 12.5)),
    )


def run_job(worlds, job: str) -> str:
    """Digest of the plan of one job "name:world:seed"."""
    name, world, seed = job.split(":")
    found = plan(*worlds[int(world)], config(name), int(seed))
    path = b"no path" if found.waypoints is None else found.waypoints.tobytes()
    return hashlib.sha256(path + np.float64(found.cost).tobytes()).hexdigest()


@pytest.mark.parametrize("name", PLANNERS)
def test_paths_are_free_edge_by_edge_and_joined_at_both_ends(name, maze, boxes):
    for space, start, goal in queries(maze, boxes):
        found = plan(space, start, goal, config(name), seed=7)
        assert found.label == "none"
        assert np.array_equal(found.waypoints[[0, -1]], [start, goal])
        assert all(space.edge_free(a, b) for a, b in itertools.pairwise(found.waypoints))
        edges = np.linalg.norm(np.diff(found.waypoints, axis=0), axis=1)
        assert found.length == pytest.approx(edges.sum())
        assert found.length >= math.dist(start, goal)
        assert found.cost == space.path_cost(found.waypoints)
        assert found.least_clearance == space.least_clearance(found.waypoints)
        assert found.least_clearance > 0.2  # the threshold: 2 cells of 0.1 m
        assert 1 <= found.iterations <= ITERATIONS


SCRIPT = """
import runpy, sys
from tests.planners.worlds import make_boxes, make_maze
test = runpy.run_path("tests/planners/test_problem.py")
worlds = test["queries"](make_maze(), make_boxes())
for job in sys.stdin.read().split():
    print(job, test["run_job"](worlds, job))
"""


PLANS = int(os.environ.get("PLANS", "2"))
"""Of each planner, a world in turn; PLANS=1000 in the environment is the long run."""


def test_a_plan_is_the_same_in_any_order_and_process(maze, boxes, pytestconfig):
    counts = [(n % 2, n // 2) for n in range(PLANS)]
    jobs = [f"{name}:{world}:{seed}" for name in PLANNERS for world, seed in counts]
    worlds = queries(maze, boxes)

    here = {job: run_job(worlds, job) for job in jobs}
    shuffled = np.random.default_rng(0).permutation(jobs).tolist()
    output = subprocess.run(
        [sys.executable, "-c", SCRIPT],
        cwd=pytestconfig.rootpath,
        input=" ".join(shuffled),
        capture_output=True,
        text=True,
        check=True,
    ).stdout
    assert dict(line.split() for line in output.splitlines()) == here
    assert len(set(here.values())) > 0.9 * len(jobs)  # another seed is mostly another path


class Straight(ob.Planner):
    """A user's planner: the straight line or nothing."""

    def __init__(self, information):
        super().__init__(information, "straight")

    def solve(self, until):
        until()
        information, definition = self.getSpaceInformation(), self.getProblemDefinition()
        start = self.getPlannerInputStates().nextStart()
        goal = definition.getGoal().getState()
        if not information.checkMotion(start, goal):
            return ob.PlannerStatus(False, False)
        path = og.PathGeometric(information, start, goal)
        definition.addSolutionPath(path, False, 0.0, "straight")
        return ob.PlannerStatus(True, False)


def test_a_users_planner_is_named_by_its_module(maze, room, monkeypatch):
    module = types.ModuleType("users_planner")
    module.Straight = Straight
    monkeypatch.setitem(sys.modules, "users_planner", module)
    settings = PlannerConfig(name="users_planner:Straight")
    found = plan(room, point(room, 20, 20), point(room, 150, 120), settings, seed=1)
    assert found.length == pytest.approx(math.hypot(13.0, 10.0))
    blocked = plan(maze, point(maze, 5.5, 5.5), point(maze, 55.5, 35.5), settings, seed=1)
    assert (blocked.label, blocked.waypoints) == ("no_path", None)


@pytest.mark.parametrize("name", PLANNERS)
def test_an_unreachable_goal_ends_within_the_budget(name):
    blocked = np.zeros((40, 40, 1), dtype=bool)
    blocked[20] = True
    space = make_space(blocked)
    found = plan(space, point(space, 5.5, 5.5), point(space, 35.5, 5.5), config(name), seed=1)
    assert (found.label, found.waypoints) == ("no_path", None)
    assert found.cost == found.length == math.inf
    assert 1 <= found.iterations <= ITERATIONS


def test_blocked_ends_have_labels_of_their_own(maze):
    free, wall = point(maze, 5.5, 5.5), point(maze, 20.5, 5.5)
    far_above = point(maze, 5.5, 5.5, 90.0)
    assert plan(maze, wall, free, PlannerConfig(), seed=1).label == "start_blocked"
    assert plan(maze, free, wall, PlannerConfig(), seed=1).label == "goal_blocked"
    assert plan(maze, free, far_above, PlannerConfig(), seed=1).label == "goal_blocked"


@pytest.mark.parametrize("heading", [0.0, 1.2])
@pytest.mark.parametrize("name", PLANNERS)
def test_a_start_at_the_goal_is_a_plan(name, heading, maze, boxes):
    for space, start, _ in queries(maze, boxes):
        found = plan(space, start, start, config(name), seed=1, heading=heading)
        assert (found.label, found.length, found.cost) == ("none", 0.0, 0.0)
        assert np.array_equal(found.waypoints, [start, start])


def test_the_clearance_weight_buys_distance_with_length(maze):
    start, goal = point(maze, 5.5, 5.5), point(maze, 55.5, 35.5)
    short = plan(maze, start, goal, PlannerConfig(clearance_weight=0.0), seed=2)
    clear = plan(maze, start, goal, PlannerConfig(clearance_weight=5.0), seed=2)
    assert short.cost == pytest.approx(short.length)
    assert clear.length > short.length
    assert clear.least_clearance > short.least_clearance
    assert maze.path_cost(clear.waypoints, 5.0) < maze.path_cost(short.waypoints, 5.0)


def test_more_restarts_never_cost_more(maze):
    start, goal = point(maze, 5.5, 5.5), point(maze, 55.5, 35.5)
    costs = [
        plan(maze, start, goal, PlannerConfig("rrtconnect", 20_000, restarts=n), seed=6).cost
        for n in (1, 2, 4, 8)
    ]
    assert costs == sorted(costs, reverse=True)
    assert costs[-1] < costs[0]


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"name": "rtt"}, r"planner\.name: got 'rtt', expected one of astar, "),
        (
            {"name": "nowhere:Planner"},
            r"planner\.name: got 'nowhere:Planner', which cannot be loaded",
        ),
        (
            {"name": "math:floor"},
            r"planner\.name: got 'math:floor', which cannot be loaded: 'math' has no class",
        ),
        (
            {"state_space": "se3"},
            r"planner\.state_space: got 'se3', expected one of auto, position",
        ),
        (
            {"name": "astar", "state_space": "dubins"},
            r"planner\.state_space: got dubins for the planner astar",
        ),
        ({"turning_radius": 0.0}, r"planner\.turning_radius: got 0, expected 1e-09 to 1e"),
        ({"iterations": 0}, r"planner\.iterations: got 0, expected 1 to 1e"),
        ({"restarts": 0}, r"planner\.restarts: got 0, expected 1 to 1e"),
        ({"shortcuts": -1}, r"planner\.shortcuts: got -1, expected 0 to 1e"),
        ({"clearance_weight": math.nan}, r"planner\.clearance_weight: got nan"),
        ({"switch_ratio": 0.0}, r"planner\.switch_ratio: got 0, expected 1e-09 to 1"),
    ],
)
def test_wrong_configs_are_refused(wrong, message):
    with pytest.raises(ValueError, match=message):
        PlannerConfig(**wrong)


def test_a_path_is_replaced_only_by_a_clearly_cheaper_one():
    assert PlannerConfig(switch_ratio=0.9).replaces(8.9, 10.0)
    assert not PlannerConfig(switch_ratio=0.9).replaces(9.1, 10.0)
    assert PlannerConfig().replaces(1e6, math.inf)
    assert not PlannerConfig().replaces(math.inf, math.inf)


def test_what_ompl_finds_is_rounded_to_the_grain(maze, boxes):
    """The last bits of its samples may follow the processor; a user's own planner's, too."""
    bare = dict(iterations=ITERATIONS, restarts=1, shortcuts=0)
    for space, start, goal in queries(maze, boxes):
        rounded = plan(space, start, goal, PlannerConfig("rrtconnect", **bare), 7)
        inner = rounded.waypoints[1:-1] * 2.0**30
        assert np.array_equal(inner, np.rint(inner))
        assert len(inner) > 0
        assert np.array_equal(rounded.waypoints[[0, -1]], [start, goal])


def test_a_start_heading_that_is_wrapped_beyond_half_a_turn_by_a_rounding_is_planned_from(bend):
    heading = 19.0 * math.pi
    assert kernels.angles.wrap(heading) < -math.pi
    start, goal = point(bend, 12.0, 14.5), point(bend, 25.0, 14.5)
    found = plan(bend, start, goal, PlannerConfig(), 1, heading=heading)
    assert found.label == "none"
    assert found.headings[0] == -math.pi
