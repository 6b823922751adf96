"""Settings of fast motion: off by default, and in a log as they were."""

import json

from wayproof.harness.config import Config, document_of, from_json, override, to_json
from wayproof.harness.scenario.scenario import build
from wayproof.models.robots import FAST_ROBOTS, LIMITS_IN_STATIC_WORLDS, ROBOTS

FAST = ("motion.limits=auto", "behaviour.keep_moving=true", "behaviour.narrow_speed_fraction=0.7")


def test_they_are_off_by_default_and_in_logs_without_them():
    config = Config("empty", "quadruped", 0)
    settings = config.motion.limits, config.behaviour.keep_moving
    assert (*settings, config.behaviour.narrow_speed_fraction) == ("cautious", False, 1.0)
    document = document_of(override(config, FAST))
    del document["motion"]["limits"], document["behaviour"]["keep_moving"]
    del document["behaviour"]["narrow_speed_fraction"]
    assert from_json(json.dumps(document).encode()) == config


def test_a_log_says_which_limits_a_robot_had_in_its_world():
    for robot, slow, fast in (("quadruped", 1.0, 1.5), ("drone", 2.0, 4.0)):
        full = build(override(Config("empty", robot, 0), ["motion.limits=full"]))
        assert (full.config.motion.limits, full.mission.max_speed) == ("full", fast)
        moving = build(override(Config("crossing", robot, 0), FAST))
        assert (moving.config.motion.limits, moving.mission.max_speed) == ("cautious", slow)
        former = build(Config("empty", robot, 0)).mission
        assert (former.max_speed, former.sideways_speed) == (slow, 0.0)


def test_both_robots_are_fast_by_themselves_but_where_something_is_known_to_move():
    for robot in ROBOTS:
        for world, limits in (("empty", "full"), ("crossing", "cautious")):
            config = build(override(Config(world, robot, 0), FAST)).config
            assert config.motion.limits == limits
            assert from_json(to_json(config)) == config


def test_the_registry_says_of_every_robot_what_auto_stands_for():
    assert set(LIMITS_IN_STATIC_WORLDS) == set(FAST_ROBOTS) == set(ROBOTS)
