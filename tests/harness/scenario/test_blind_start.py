"""Robots whose sensors see no floor about their start."""

import math
import re

import pytest

from wayproof.harness.config import Config
from wayproof.harness.config_document import override
from wayproof.harness.runner import run_episode
from wayproof.harness.scenario.ground import nearest_floor
from wayproof.harness.scenario.scenario import build

BACK_LIDAR = "sensors.lidar=ouster-os1-64"


def configured(robot, *settings):
    return override(Config("corridor", robot, 301), list(settings))


def test_the_nearest_floor_follows_from_mounting_and_lowest_beam():
    scenario = build(configured("quadruped", BACK_LIDAR))
    (lidar,) = scenario.scene.casters
    (ahead, _, up), spec = lidar.mounting[0], scenario.spec
    ring = (spec.rest_height + up) / math.tan(math.radians(16.6))
    assert nearest_floor(lidar, spec.rest_height) == pytest.approx(ring - ahead, abs=1e-3)


@pytest.mark.parametrize(
    ("robot", "settings"),
    [
        ("quadruped", []),
        ("drone", ["sensors.depth=ouster-os1-64"]),
        ("quadruped", [BACK_LIDAR, "costmap.unknown_policy=penalize"]),
    ],
)
def test_who_sees_its_floor_flies_or_enters_the_unknown_is_not_warned(robot, settings):
    assert not build(configured(robot, *settings)).warnings


def test_the_proposed_radius_leads_out(tmp_path):
    (warning,) = build(configured("quadruped", BACK_LIDAR)).warnings
    assert warning.startswith("the sensors see no floor nearer than 1.26 m")
    setting = re.search(r"--set (\S+)", warning)[1]
    scenario = build(configured("quadruped", BACK_LIDAR, setting))
    assert not scenario.warnings
    result = run_episode(scenario, tmp_path / "episode.mcap")
    assert (result.outcome, result.collisions) == ("success", 0)
    assert result.sim_time_s < 20.0
