"""The task as a text, which a recording of the topics needs to give the same maps."""

from __future__ import annotations

import json
from dataclasses import dataclass

import msgspec
from google.protobuf import json_format

from wayproof.harness.errors import InputError
from wayproof.harness.interface.types import Sensor, Task
from wayproof.harness.mission import Mission
from wayproof.harness.schema import wayproof_pb2 as pb

LATEST_NS = 2**62
"""Latest stamp, ns."""

MALFORMED = (
    *(msgspec.MsgspecError, json_format.ParseError),
    *(ValueError, KeyError, TypeError, RecursionError),
)
"""Exceptions of reading a text that is no task."""


@dataclass(frozen=True)
class Announcement:
    """The task of an episode whose topics were recorded.

    Attributes:
        start_ns: ROS time of simulated time 0, ns.
        robot: Name of the robot.
        mission: Body, operating area, start and goal.
        sensors: Sensors by name, with their beam tables and mountings.
    """

    start_ns: int
    robot: str
    mission: Mission
    sensors: dict[str, Sensor]


def write_task(task: Task, start_ns: int) -> str:
    """Write a task as JSON; numbers come back bit by bit.

    Args:
        task: Task of the episode.
        start_ns: ROS time of simulated time 0, ns.
    """
    infos = [
        json_format.MessageToDict(sensor.info, preserving_proto_field_name=True)
        for sensor in task.sensors.values()
    ]
    mission = msgspec.to_builtins(task.mission)
    parts = {"start_ns": start_ns, "robot": task.robot, "mission": mission, "sensors": infos}
    return json.dumps(parts, allow_nan=False)


def read_task(text: str) -> Announcement:
    """Read a task of `write_task`.

    Raises:
        InputError: The text is none.
    """
    try:
        parts = json.loads(text)
        start_ns, robot = parts["start_ns"], parts["robot"]
        mission = msgspec.convert(parts["mission"], Mission)
        infos = [json_format.ParseDict(one, pb.SensorInfo()) for one in parts["sensors"]]
    except MALFORMED as error:
        raise InputError(f"task: {type(error).__name__}: {error}") from None
    if type(start_ns) is not int or abs(start_ns) > LATEST_NS or type(robot) is not str:
        raise InputError("task: expected start_ns in ns, and the name of the robot")
    sensors = {info.name: Sensor(info) for info in infos}
    for sensor in sensors.values():
        sensor.beams  # noqa: B018  # checked when they are made
    return Announcement(start_ns, robot, mission, sensors)
