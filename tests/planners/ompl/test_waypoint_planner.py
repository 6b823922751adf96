"""A planner that is no OMPL class: waypoints in, a checked path out."""

import re

import numpy as np
import pytest

from wayproof.planners import Body, FreeSpace, PlannerConfig, plan
from wayproof.plugin import UserCodeError

PLANNERS = '''
import numpy as np


class Middle:
    """By a place that the seed chooses, beside the straight way."""

    seen = []

    def plan(self, space, start, goal, seed, budget):
        self.seen.append((seed, budget))
        side = np.array([0.0, 0.2 if seed % 2 else -0.2, 0.0])
        path = np.array([start, 0.5 * (start + goal) + side, goal])
        return path if all(map(space.edge_free, path[:-1], path[1:])) else None


class Nowhere:
    def plan(self, space, start, goal, seed, budget):
        return None


class Words:
    def plan(self, space, start, goal, seed, budget):
        return "straight on"


class Flat:
    def plan(self, space, start, goal, seed, budget):
        return np.array([start[:2], goal[:2]])


class Elsewhere:
    def plan(self, space, start, goal, seed, budget):
        return [start, goal + 1.0]


class Through:
    """Straight on, whatever stands there."""

    def plan(self, space, start, goal, seed, budget):
        return [start, goal]
'''

SOLID = (30, 30, 12)
PLANE = (60, 60, 1)
LONG = Body(offsets=(-0.2, 0.0, 0.2), radii=(0.15, 0.15, 0.15))


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    path = tmp_path_factory.mktemp("mine") / "waypoints.py"
    path.write_text(PLANNERS)
    return path


def space_of(shape, wall=False, discs=()):
    field = np.full(shape, 100, np.uint16)
    if wall:
        field[shape[0] // 2] = 0
    threshold = min((disc.collision_distance_sq for disc in discs), default=4)
    return FreeSpace(field, np.zeros(3), 0.1, threshold, np.zeros(101), discs)


def planned(file, kind, space, seed=1):
    height = 0.05 if space.flat else 0.55
    ends = np.array([0.55, 1.45, height]), np.array([2.55, 1.45, height])
    config = PlannerConfig(name=f"{file}:{kind}", restarts=1, shortcuts=0, clearance_weight=0.0)
    return plan(space, *ends, config, seed=seed), ends


@pytest.mark.parametrize("shape", [SOLID, PLANE])
def test_waypoints_become_a_path(file, shape):
    found, (start, goal) = planned(file, "Middle", space_of(shape))
    assert found.label == "none"
    np.testing.assert_array_equal(found.waypoints[[0, -1], :3], [start, goal])
    assert np.abs(found.waypoints[:, 1] - 1.45).max() == pytest.approx(0.2, abs=1e-6)
    again, _ = planned(file, "Middle", space_of(shape))
    np.testing.assert_array_equal(found.waypoints, again.waypoints)


def test_a_long_body_heads_along_the_waypoints(file):
    discs = LONG.discs(margin=0.0, resolution=0.1, flat=True)
    found, _ = planned(file, "Middle", space_of(PLANE, discs=discs))
    assert found.label == "none"
    assert np.abs(found.waypoints[:, 1] - 1.45).max() == pytest.approx(0.2, abs=1e-6)


def test_a_planner_gets_seed_and_budget(file):
    from wayproof.plugin import load_class

    seen = load_class(f"{file}:Middle").seen
    seen.clear()
    planned(file, "Middle", space_of(SOLID), seed=3)
    planned(file, "Middle", space_of(SOLID), seed=3)
    assert seen[0] == seen[1]
    assert seen[0][1] == PlannerConfig().iterations


@pytest.mark.parametrize(
    ("kind", "wall"), [("Nowhere", False), ("Middle", True), ("Through", True)]
)
def test_no_waypoints_and_blocked_ones_are_no_path(file, kind, wall):
    found, _ = planned(file, kind, space_of(SOLID, wall))
    assert (found.waypoints, found.label) == (None, "no_path")


@pytest.mark.parametrize(
    ("kind", "said"),
    [
        ("Words", "returned str from plan, expected waypoints of shape (n, 3), or None"),
        ("Flat", "returned (2, 2) from plan, expected waypoints of shape (n, 3), or None"),
        ("Elsewhere", "added a path with its end at (3.550, 2.450, 1.550), expected (2.550, "),
    ],
)
def test_an_invalid_path_is_reported(file, kind, said):
    with pytest.raises(UserCodeError, match=re.escape(f"planner '{file}:{kind}' {said}")):
        planned(file, kind, space_of(SOLID))
