"""Limits of the robots' motion by world, as a log keeps them."""

import math

from wayproof.harness.config import Config
from wayproof.harness.config_document import from_json, override, to_json
from wayproof.harness.scenario.scenario import build
from wayproof.harness.stack.planner_input import motion_limits
from wayproof.models.robots import LIMITS_IN_STATIC_WORLDS, ROBOTS, ROBOTS_BY_LIMITS


def test_a_log_says_which_limits_a_robot_had_in_its_world():
    for robot, slow, fast in (("quadruped", 1.0, 1.5), ("drone", 2.0, 4.0)):
        full = build(override(Config("empty", robot, 0), ["motion.limits=full"]))
        assert (full.config.motion.limits, full.mission.max_speed) == ("full", fast)
        assert full.mission.sideways_speed == {"quadruped": 0.35, "drone": 4.0}[robot]
        moving = build(Config("crossing", robot, 0))
        assert (moving.config.motion.limits, moving.mission.max_speed) == ("cautious", slow)
        cautious = build(override(Config("empty", robot, 0), ["motion.limits=cautious"])).mission
        assert (cautious.max_speed, cautious.sideways_speed) == (slow, 0.0)


def test_a_robot_that_walks_turns_by_the_acceleration_of_its_gait():
    for robot, most in (("quadruped", 4.0), ("drone", 0.0)):
        config = Config("empty", robot, 0)
        mission = build(config).mission
        assert mission.max_yaw_acceleration == most
        assert motion_limits(config, mission).yaw_acceleration == (most or math.inf)


def test_both_robots_are_fast_by_themselves_but_where_something_is_known_to_move_or_appear():
    for robot in ROBOTS:
        for world, limits in (("empty", "full"), ("crossing", "cautious"), ("ghosts", "cautious")):
            config = build(Config(world, robot, 0)).config
            assert config.motion.limits == limits
            assert from_json(to_json(config)) == config


def test_on_slopes_the_quadruped_is_slower_by_itself():
    for world, limits in (("empty", "sloping"), ("crossing", "sloping")):
        built = build(override(Config(world, "quadruped", 0), ["costmap.max_slope=0.2"]))
        assert (built.config.motion.limits, built.mission.max_speed) == (limits, 0.7)
        assert from_json(to_json(built.config)) == built.config
    chosen = ["costmap.max_slope=0.2", "motion.limits=full"]
    assert build(override(Config("empty", "quadruped", 0), chosen)).mission.max_speed == 1.5


def test_the_registry_says_of_every_robot_what_auto_stands_for():
    assert set(LIMITS_IN_STATIC_WORLDS) == set(ROBOTS)
    assert all(set(robots) == set(ROBOTS) for robots in ROBOTS_BY_LIMITS.values())
