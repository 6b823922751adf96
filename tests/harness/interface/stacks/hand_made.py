"""Hand-made tasks and observations: a body at the origin among given points."""

import math
from types import MappingProxyType

import numpy as np

from wayproof.harness.inputs import WorldSweep
from wayproof.harness.interface.types import Observation, Reference, Sweep, Task
from wayproof.harness.mission import Mission


def task(robot="quadruped", goal=(5.0, 0.0)):
    ground = robot == "quadruped"
    height = 0.3 if ground else 1.0
    mission = Mission(
        motion="ground" if ground else "air",
        radius=0.45 if ground else 0.36,
        height=0.46 if ground else 0.2,
        step_height=0.03 if ground else 0.0,
        max_speed=1.0 if ground else 2.0,
        max_acceleration=1.5,
        max_jerk=15.0,
        max_yaw_rate=1.0,
        low=(-20.0, -20.0, -0.5),
        high=(20.0, 20.0, 3.0),
        start=(0.0, 0.0, height),
        start_heading=0.0,
        goal=(*goal, height),
        discs=((-0.245, 0.235), (0.0, 0.235), (0.245, 0.235)) if ground else (),
    )
    return Task(
        robot=robot,
        seed=1,
        mission=mission,
        goal_tolerance=0.25,
        period_s=0.1,
        delay_s=0.05,
        deadline_s=0.25,
        sensors=MappingProxyType({}),
        settings="{}",
    )


def observation(task, points=(), sequence=0, heading=0.0, speed=0.0):
    """What a lidar at the base would observe of points, whatever lies behind whatever."""
    position = np.array(task.mission.start)
    offsets = np.array(points, np.float64).reshape(-1, 3) - position
    distances = np.linalg.norm(offsets, axis=1)
    ranges = np.round(distances * 1e3).astype(np.uint16)
    moments = np.zeros(len(offsets), np.int32)
    placed = WorldSweep(position[None], offsets / distances[:, None], ranges, moments)
    velocity = speed * np.array([math.cos(heading), math.sin(heading), 0.0])
    return Observation(
        time_ns=sequence * 100_000_000,
        sequence=sequence,
        position=position,
        quaternion=np.array([math.cos(heading / 2), 0.0, 0.0, math.sin(heading / 2)]),
        position_sigma=0.0,
        heading_sigma=0.0,
        velocity=velocity,
        yaw_rate=0.0,
        sweeps=(Sweep("lidar", ranges, None, lambda: placed),),
        effect_ns=sequence * 100_000_000 + 50_000_000,
        reference=Reference(position, velocity, heading, 0.0, at_rest=speed == 0.0),
        goal=np.array(task.mission.goal),
    )


def wall(task, first, last):
    """Points 5 cm apart on a straight wall, as tall as the body."""
    first, last = np.array(first), np.array(last)
    count = round(float(np.linalg.norm(last - first)) / 0.05) + 1
    along = first + np.linspace(0.0, 1.0, count)[:, None] * (last - first)
    heights = task.mission.start[2] + np.array([-0.1, 0.0, 0.1])
    return np.vstack([np.column_stack([along, np.full(count, height)]) for height in heights])


def ring(task, radius):
    """Points on a circle about the body."""
    angles = np.linspace(0.0, 2.0 * math.pi, 120, endpoint=False)
    flat = radius * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    return np.column_stack([flat, np.full(len(flat), task.mission.start[2])])


def started(kind, task):
    stack = kind()
    stack.start(task)
    return stack
