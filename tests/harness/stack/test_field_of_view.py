"""Sensors that see all around, and those that see ahead."""

import pytest

from wayproof.harness.config import Config
from wayproof.harness.input_messages import beams_from_info
from wayproof.harness.scenario.scenario import build, sensor_info
from wayproof.harness.stack.gait import is_omnidirectional


def sensors_of(robot):
    scene = build(Config("empty", robot, 0)).scene
    infos = [sensor_info(caster) for caster in scene.casters]
    return {info.name: beams_from_info(info) for info in infos}


@pytest.mark.parametrize("robot", ["drone", "quadruped"])
def test_the_lidar_of_a_robot_sees_all_around(robot):
    sensors = sensors_of(robot)
    assert is_omnidirectional(sensors.values())
    assert is_omnidirectional([sensors["lidar"]])


def test_a_camera_sees_ahead_alone():
    assert not is_omnidirectional([sensors_of("drone")["depth"]])


def test_an_altimeter_and_no_sensor_see_nothing_around():
    assert not is_omnidirectional([sensors_of("drone")["altimeter"]])
    assert not is_omnidirectional([])
