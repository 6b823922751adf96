"""Areas larger than the rolling window: the window, goals within it, and ways beyond it."""

from dataclasses import replace

import numpy as np
import pytest

from tests.harness.interface.stacks.hand_made import task
from tests.harness.stack.make_input import (
    GOAL,
    START,
    at_rest,
    make_input,
    make_states,
    place,
)
from wayproof.harness.config import Config
from wayproof.harness.config_document import override
from wayproof.harness.scenario.scenario import build
from wayproof.harness.stack.horizon import RENEW, FarWays, exit_of, goal_within
from wayproof.harness.stack.mapping import Mapper
from wayproof.harness.stack.planner_input import FreeSpaceBuilder
from wayproof.harness.stack.rolling_window import INSET, RollingWindow, edge_of
from wayproof.harness.stack.types import Horizon, arc_length
from wayproof.maps import OCCUPIED
from wayproof.maps.cell_sets import box_mask
from wayproof.planners import PlannerConfig, plan

LOW, HIGH = np.array([0.5, 0.5]), np.array([7.5, 3.5])
FAR = (60.0, 2.05)


def straight(start, goal):
    return np.stack([start[:2], goal[:2]])


def refused(start, goal):
    raise AssertionError(f"asked for a way from {start} to {goal}")


def within(input, state):
    return goal_within(input, state, state.trajectory.at(input.effect_ns))


def test_a_way_leaves_a_box_where_its_first_edge_crosses_a_face():
    way = np.array([[1.0, 1.0], [3.0, 1.0], [3.0, 9.0], [1.0, 1.0]])
    np.testing.assert_allclose(exit_of(way, LOW, HIGH), [3.0, 3.5])
    np.testing.assert_allclose(exit_of(way[:2], LOW, HIGH), [3.0, 1.0])
    through_a_corner = np.array([[6.5, 2.5], [9.5, 5.5]])
    np.testing.assert_allclose(exit_of(through_a_corner, LOW, HIGH), [7.5, 3.5])
    steep = np.array([[6.5, 2.5], [7.0, 6.5]])
    np.testing.assert_allclose(exit_of(steep, LOW, HIGH), [6.625, 3.5])


def test_a_way_from_beyond_a_box_leaves_it_at_the_nearest_point():
    way = np.array([[8.0, 2.0], [20.0, 2.0]])
    np.testing.assert_allclose(exit_of(way, LOW, HIGH), [7.5, 2.0])


def test_without_a_way_it_lies_straight_towards_the_goal():
    input = make_input(goal=(60.0, 40.0), horizon=Horizon(LOW, HIGH, lambda *_: None))
    found = within(input, at_rest())
    assert found[1] == pytest.approx(HIGH[1], abs=0.11)
    assert START[0] < found[0] < HIGH[0]


def test_an_intermediate_goal_is_kept_while_its_path_is_valid_and_long():
    path = np.array([place(*START), np.add(place(*START), (RENEW + 0.1, 0.0, 0.0))])
    input = make_input(goal=FAR, horizon=Horizon(LOW, HIGH, refused))
    np.testing.assert_array_equal(within(input, at_rest(global_path=path)), path[-1])
    blocked = make_states(occupied=[(4.0, 4.3, 0.0, 4.0)])
    for states, end in ((blocked, path[-1]), (None, place(*GOAL))):
        renewed = make_input(states, goal=FAR, horizon=Horizon(LOW, HIGH, straight))
        state = at_rest(global_path=np.stack([path[0], end]))
        np.testing.assert_allclose(within(renewed, state)[:2], [HIGH[0], START[1]], atol=0.1)


EDGE = 32.0
MISSION = replace(
    task().mission,
    low=(0.0, 0.0, -0.5),
    high=(100.0, 20.0, 3.0),
    start=(5.0, 10.0, 0.3),
    goal=(95.0, 10.0, 0.3),
)


def config_of(*settings):
    return override(Config("empty", "quadruped", 0), [f"costmap.window={EDGE:g}", *settings])


def moved_to(window, x, y=10.0):
    """Let the robot stand somewhere; return whether the window moves."""
    centre = window.centred_on(np.array([x, y, 0.3]))
    moves = window.leaves_behind(centre)
    if moves:
        window.move(centre)
    return moves


def along_x(corners):
    return [float(corner[0]) for corner in corners]


def test_only_an_area_half_as_long_again_as_the_window_is_not_held_whole():
    small = replace(MISSION, high=(48.0, 20.0, 3.0), goal=(40.0, 10.0, 0.3))
    assert edge_of(config_of(), MISSION) == EDGE
    for settings, mission in (
        ((), small),
        (("costmap.window=0",), MISSION),
        (("costmap.max_slope=0.3",), MISSION),
    ):
        window = RollingWindow(config_of(*settings), mission)
        np.testing.assert_array_equal(window.corners, [mission.low, mission.high])
        assert not moved_to(window, 40.0)
        window.move((0, 0))
        np.testing.assert_array_equal(window.inner, [mission.low[:2], mission.high[:2]])


def test_it_moves_once_the_robot_is_an_eighth_of_an_edge_from_its_centre():
    window = RollingWindow(config_of(), MISSION)
    assert not moved_to(window, 15.9)  # centred as near as the area's end allows
    assert not moved_to(window, 19.9)
    assert moved_to(window, 20.2)
    assert along_x(window.corners) == pytest.approx([4.2, 36.2])
    assert not moved_to(window, 16.3)
    assert not moved_to(window, 24.1)
    assert moved_to(window, 24.4)


def test_it_reaches_the_end_of_the_area_as_soon_as_the_robot_is_near():
    window = RollingWindow(config_of(), MISSION)
    moved_to(window, 82.0)
    assert along_x(window.corners) == pytest.approx([66.0, 98.0])
    assert moved_to(window, 84.5)  # less than an eighth on
    assert along_x(window.corners) == pytest.approx([68.0, 100.0])
    assert not moved_to(window, 83.9)  # and does not go to and fro
    assert not moved_to(window, 84.1)


@pytest.mark.parametrize("beyond", [0.0, 0.03, 0.05, 0.07, 0.1])
def test_a_goal_at_the_border_is_in_the_last_window_whatever_the_extent(beyond):
    wide = replace(MISSION, low=(-beyond, 0.0, -0.5), high=(100.0 + beyond, 20.0, 3.0))
    window = RollingWindow(config_of(), wide)
    assert along_x(window.inner) == pytest.approx([-beyond, EDGE - INSET], abs=0.2)
    assert window.inner[0][0] == -beyond
    moved_to(window, 99.0)
    assert window.inner[1][0] == 100.0 + beyond


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
