"""The task as a text on the topic `/task`."""

import json

import pytest

from wayproof import Config, build
from wayproof.harness.errors import InputError
from wayproof.harness.interface.observations import task_of
from wayproof.harness.interface.ros2.task import read_task, write_task
from wayproof.harness.scenario.scenario import sensor_info


@pytest.fixture(scope="module")
def task():
    config = Config("office", "drone", 3)
    scenario = build(config)
    infos = [sensor_info(caster) for caster in scenario.scene.casters]
    return task_of(config, scenario.mission, {info.name: info for info in infos})


def test_every_number_comes_back_bit_by_bit(task):
    read = read_task(write_task(task, 1_100_000_000))
    assert (read.start_ns, read.robot, read.mission) == (1_100_000_000, "drone", task.mission)
    assert list(read.sensors) == list(task.sensors)
    for name, sensor in task.sensors.items():
        assert read.sensors[name].info == sensor.info


def test_it_does_not_hold_the_settings(task):
    assert set(json.loads(write_task(task, 0))) == {"start_ns", "robot", "mission", "sensors"}


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("start_ns", 1.5),
        ("start_ns", 10**30),
        ("robot", None),
        ("mission", {}),
        ("mission", [1]),
        ("sensors", 3),
        ("sensors", [{"nonsense": 1}]),
        ("sensors", [{"name": "lidar"}]),
        ("sensors", [{"name": "lidar", "order": "grid", "beams": 10**9, "row_width": 2}]),
    ],
)
def test_another_text_is_refused(task, key, value):
    parts = json.loads(write_task(task, 0))
    with pytest.raises(InputError):
        read_task(json.dumps({**parts, key: value}))


@pytest.mark.parametrize("text", ["", "{}", "[1]", "[" * 100_000, "NaN", '{"start_ns": 1e999}'])
def test_a_text_of_anything_is_refused(text):
    with pytest.raises(InputError):
        read_task(text)
