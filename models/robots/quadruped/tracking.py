"""Tracking of setpoints: velocity commands for the gait, one tick at a time."""

from __future__ import annotations

from math import atan2, cos, hypot, isfinite, sin
from typing import Any

import numpy as np

from wayproof.models._jit import allocating, kernel
from wayproof.models.arrays import Array
from wayproof.models.robots.quadruped.gait import advance
from wayproof.models.robots.quadruped.kinematics import observe
from wayproof.models.robots.quadruped.parameters import Tracking


@allocating
def follow(
    setpoint: Array,
    parameters: Any,
    qpos: Array,
    qvel: Array,
    touch: Array,
    observations: Any,
    memories: Any,
) -> bool:
    """Advance one tick toward a setpoint: observe the body, command a velocity, step the gait.

    One compiled call a tick: to call a kernel after a physics step takes longer than what it
    computes.

    Args:
        setpoint: (8,) row of the setpoint.
        parameters: (1,) record of the controller's parameters.
        qpos: (19,) free joint (position, quaternion wxyz), then 4 x (hip, thigh, calf).
        qvel: (18,) linear velocity in the world, angular velocity in the body, joint rates.
        touch: (4,) normal force on each foot, N.
        observations: (1,) this tick's `OBSERVATION` record; filled.
        memories: (1,) `MEMORY` record; advanced.

    Returns:
        Whether the setpoint was finite; nothing is advanced where it was not.
    """
    command = np.empty(3)
    observe(parameters, qpos, qvel, observations)
    tracking, standing_speed = parameters[0].tracking, parameters[0].gait.standing_speed
    observation, memory = observations[0], memories[0]
    if not velocity_command(tracking, standing_speed, setpoint, observation, memory, command):
        return False
    advance(parameters, command, touch, observations, memories)
    return True


@kernel
def velocity_command(
    tracking: Tracking,
    resting_speed: float,
    setpoint: Array,
    observation: Any,
    memory: Any,
    command: Array,
) -> bool:
    """Compute feed-forward velocity plus proportional feedback, within the gait's limits.

    A setpoint at rest counts as reached inside a small circle and as lost outside a larger one,
    so that the robot stands still there instead of stepping after millimetres.

    Args:
        tracking: Gains and limits.
        resting_speed: Speed below which a setpoint is at rest, m/s and rad/s.
        setpoint: (8,) row of the setpoint.
        observation: `OBSERVATION` record.
        memory: `MEMORY` record, whose `arrived` is updated.
        command: (3,) forward m/s, left m/s and yaw rate rad/s, in the base's yaw frame; written.

    Returns:
        Whether the setpoint is finite.
    """
    yaw = observation.angles[2]
    dx, dy = setpoint[0] - observation.position[0], setpoint[1] - observation.position[1]
    vx, vy, rate = setpoint[3], setpoint[4], setpoint[7]
    if not isfinite(setpoint[0] + setpoint[1] + vx + vy + setpoint[6] + rate):
        return False
    turn = setpoint[6] - yaw
    turn = atan2(sin(turn), cos(turn))
    moving = max(hypot(vx, vy), abs(rate)) > resting_speed
    memory.arrived = not moving and _has_arrived(tracking, memory.arrived, hypot(dx, dy), abs(turn))
    if memory.arrived:
        command[:] = 0.0
        return True
    vx += tracking.position_gain * dx
    vy += tracking.position_gain * dy
    rate += tracking.heading_gain * turn
    c, s = cos(yaw), sin(yaw)
    command[0] = min(max(c * vx + s * vy, tracking.forward_low), tracking.forward_high)
    command[1] = min(max(c * vy - s * vx, -tracking.lateral), tracking.lateral)
    command[2] = min(max(rate, -tracking.yaw_rate), tracking.yaw_rate)
    return True


@kernel
def _has_arrived(tracking: Tracking, arrived: bool, distance: float, angle: float) -> bool:
    if arrived:
        return distance < tracking.depart_distance and angle < tracking.depart_angle
    return distance < tracking.arrive_distance and angle < tracking.arrive_angle
