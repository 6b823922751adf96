"""Settings of fast motion: on by default, off in logs without them, and in a log as they were."""

import json
import math

from wayproof.harness.config import Config
from wayproof.harness.config_document import document_of, from_json, override, to_json
from wayproof.harness.scenario.scenario import build
from wayproof.harness.stack.planner_input import motion_limits
from wayproof.models.robots import LIMITS_IN_STATIC_WORLDS, ROBOTS, ROBOTS_BY_LIMITS

FORMER = (
    "motion.limits=cautious",
    "behaviour.keep_moving=false",
    "behaviour.narrow_speed_fraction=1.0",
    "behaviour.rules=1",
)


def test_they_are_on_by_default_and_off_in_logs_without_them():
    config = Config("empty", "quadruped", 0)
    settings = config.motion.limits, config.behaviour.keep_moving
    assert (*settings, config.behaviour.narrow_speed_fraction) == ("auto", True, 0.7)
    document = document_of(config)
    del document["motion"]["limits"], document["behaviour"]["keep_moving"]
    del document["behaviour"]["narrow_speed_fraction"], document["behaviour"]["rules"]
    assert from_json(json.dumps(document).encode()) == override(config, FORMER)


def test_a_log_says_which_limits_a_robot_had_in_its_world():
    for robot, slow, fast in (("quadruped", 1.0, 1.5), ("drone", 2.0, 4.0)):
        full = build(override(Config("empty", robot, 0), ["motion.limits=full"]))
        assert (full.config.motion.limits, full.mission.max_speed) == ("full", fast)
        assert full.mission.sideways_speed == {"quadruped": 0.35, "drone": 4.0}[robot]
        moving = build(Config("crossing", robot, 0))
        assert (moving.config.motion.limits, moving.mission.max_speed) == ("cautious", slow)
        former = build(override(Config("empty", robot, 0), FORMER)).mission
        assert (former.max_speed, former.sideways_speed) == (slow, 0.0)


def test_a_robot_that_walks_turns_by_the_acceleration_of_its_gait_and_formerly_at_once():
    for robot, rules, most in (("quadruped", 7, 4.0), ("quadruped", 6, 0.0), ("drone", 7, 0.0)):
        config = override(Config("empty", robot, 0), [f"behaviour.rules={rules}"])
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
