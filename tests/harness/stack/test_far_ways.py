"""Ways beyond the rolling window: as short as over all cells, and the same whatever came before."""

import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from wayproof.harness.config import Config
from wayproof.harness.config_document import override
from wayproof.harness.scenario.scenario import build
from wayproof.harness.stack.horizon import FarWays
from wayproof.harness.stack.mapping import Mapper
from wayproof.harness.stack.planner_input import FreeSpaceBuilder
from wayproof.harness.stack.types import arc_length
from wayproof.maps import OCCUPIED
from wayproof.maps.cell_sets import box_mask
from wayproof.planners import PlannerConfig, plan

ROOT = Path(__file__).parents[3]
LARGE = ("world.empty.length=60", "world.empty.width=40", "costmap.window=24")
ENDS = ("start=[4.0,10.0]", "goal=[56.0,31.0]")
ROBOTS = ("quadruped", "drone")


def mapper_of(robot, window=24):
    settings = [*LARGE, *ENDS, f"costmap.window={window}"]
    scenario = build(override(Config("empty", robot, 0), settings))
    mapper = Mapper(scenario.config, scenario.mission, {})
    return scenario.config, scenario.mission, mapper


def put(mapper, x, x_end, y, y_end):
    """Put an obstacle from floor to ceiling into the map."""
    for _ in range(2):
        cells = box_mask((x, y, 0.05), (x_end, y_end, 3.0), mapper.map.resolution)
        mapper.map.mark(cells, OCCUPIED, 0)


def crates(mapper, seed):
    rng = np.random.default_rng(seed)
    for x, y in rng.uniform((8.0, 2.0), (50.0, 34.0), (25, 2)):
        width, depth = rng.uniform(0.3, 4.0, 2)
        put(mapper, x, x + width, y, y + depth)


@pytest.mark.parametrize("robot", ROBOTS)
def test_a_way_is_that_of_a_new_search_whatever_came_before(robot):
    config, mission, mapper = mapper_of(robot)
    kept = FarWays(config, mission, mapper)
    goal = np.array(mission.goal)
    ways = []
    for seed, start in enumerate([(4.0, 10.0), (7.0, 12.0), (5.0, 30.0), (6.0, 12.0)]):
        crates(mapper, seed)
        place = np.array([*start, 0.3])
        ways.append(kept.way(place, goal))
        fresh = FarWays(config, mission, mapper)
        np.testing.assert_array_equal(ways[-1], fresh.way(place, goal))
    assert len({way.tobytes() for way in ways}) == len(ways)


@pytest.mark.few(1)
@pytest.mark.parametrize("robot", ROBOTS)
def test_a_way_is_about_as_long_as_the_shortest_over_all_cells(robot):
    config, mission, mapper = mapper_of(robot)
    crates(mapper, 0)
    start, goal = mapper.planning_point(np.array(mission.start)), np.array(mission.goal)
    way = FarWays(config, mission, mapper).way(start, goal)
    config, mission, whole = mapper_of(robot, window=0)
    crates(whole, 0)
    whole.costmap.update(config.costmap.localization_margin)
    space = (
        FreeSpaceBuilder(config, mission, whole.costmap, omnidirectional=True)
        .spaces(circumscribed=True)
        .optimistic
    )
    space = replace(space, cost_by_distance=np.zeros_like(space.cost_by_distance))
    shortest = plan(space, start, whole.planning_point(goal), PlannerConfig(), seed=1)
    length = arc_length(np.column_stack([way, np.zeros(len(way))]))
    assert 0.95 < length / shortest.length < 1.05


def test_a_wall_across_the_area_leaves_no_way():
    config, mission, mapper = mapper_of("quadruped")
    ways = FarWays(config, mission, mapper)
    start, goal = np.array(mission.start), np.array(mission.goal)
    put(mapper, 30.0, 30.2, 0.0, 38.0)
    around = ways.way(start, goal)
    assert around[:, 1].max() > 38.0
    put(mapper, 30.0, 30.2, 0.0, 40.0)
    assert ways.way(start, goal) is None


def test_a_goal_within_an_obstacle_is_projected_to_a_place_beside_it():
    config, mission, mapper = mapper_of("quadruped")
    x, y = mission.goal[:2]
    put(mapper, x - 0.5, x + 0.5, y - 0.5, y + 0.5)
    way = FarWays(config, mission, mapper).way(np.array(mission.start), np.array(mission.goal))
    assert 0.4 < np.hypot(*(way[-1] - mission.goal[:2])) < 2.5


FIRST_WAY = """
import sys
from numba.core.dispatcher import Dispatcher
from tests.harness.stack.test_far_ways import mapper_of, put
from wayproof.harness.stack.horizon import FarWays
import numpy as np

config, mission, mapper = mapper_of("quadruped")
ways = FarWays(config, mission, mapper)
put(mapper, 20.0, 21.0, 5.0, 15.0)
kernels = {
    f"{name}.{key}": value
    for name, module in list(sys.modules.items()) if name.startswith("wayproof.")
    for key, value in vars(module).items() if isinstance(value, Dispatcher)
}
before = {name: len(kernel.signatures) for name, kernel in kernels.items()}
ways.way(np.array(mission.start), np.array(mission.goal))
print(sum(before.values()), *(n for n, k in kernels.items() if len(k.signatures) > before[n]))
"""


def test_no_decision_compiles_what_finds_a_way():
    done = subprocess.run(
        [sys.executable, "-c", FIRST_WAY], cwd=ROOT, capture_output=True, text=True, check=True
    )
    compiled, *later = done.stdout.split()
    assert int(compiled) > 0
    assert later == []
