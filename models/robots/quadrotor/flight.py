"""Flight control: one tick of reference, tracking and drag in one compiled call."""

from __future__ import annotations

from math import isfinite, sqrt
from typing import Any

import numpy as np

from wayproof.models._jit import allocating
from wayproof.models.arrays import Array
from wayproof.models.robots.linear_algebra import dot, rotation_from_quaternion
from wayproof.models.robots.quadrotor.drag import air_drag
from wayproof.models.robots.quadrotor.geometric import (
    desired_attitude,
    desired_force,
    desired_rates,
    desired_torque,
)
from wayproof.models.robots.quadrotor.parameters import Airframe, Gains
from wayproof.models.robots.quadrotor.rotors import allocate, invert_lag
from wayproof.models.robots.quadrotor.smoothing import smooth_setpoint

MEMORY = np.dtype(
    [
        ("reference", "f8", (5, 4)),  # by `smooth_setpoint`
        ("integral", "f8", 3),  # of the position error, m/s^2
        ("lag", "f8", (2, 4)),  # by `invert_lag`
    ],
    align=True,
)
"""State of the controller, kept from tick to tick."""


@allocating
def fly(
    setpoint: Array,
    parameters: Any,
    memories: Any,
    qpos: Array,
    qvel: Array,
    wind: Array,
    command: Array,
    drag: Array,
) -> bool:
    """Advance one tick: smooth the reference, track it, and compute the drag on the body.

    Args:
        setpoint: (8,) row of the setpoint, of which position and heading count.
        parameters: (1,) record of the controller's parameters.
        memories: (1,) `MEMORY` record; advanced.
        qpos: (7,) free joint: position, m, and quaternion wxyz.
        qvel: (6,) free joint: velocity, world frame, and angular velocity, body axes.
        wind: (3,) velocity of the air, world frame, m/s.
        command: (4,) rotor commands, N; written.
        drag: (3,) on the body, world frame, N; written.

    Returns:
        Whether the setpoint was finite; nothing is written where it was not.
    """
    x, y, z, heading = setpoint[0], setpoint[1], setpoint[2], setpoint[6]
    if not isfinite(x + y + z + heading):
        return False
    airframe, gains, timestep = parameters[0].airframe, parameters[0].gains, parameters[0].timestep
    memory = memories[0]
    target = np.array((x, y, z, heading))
    smooth_setpoint(parameters[0].smoothing, memory.reference, target, timestep)
    track(airframe, gains, memory, qpos, qvel, timestep, command)
    R_world_body = np.empty((3, 3))
    rotation_from_quaternion(qpos[3:], R_world_body)
    drag[:] = air_drag(airframe, R_world_body, qvel[:3] - wind)
    return True


@allocating
def track(
    airframe: Airframe,
    gains: Gains,
    memory: Any,
    qpos: Array,
    qvel: Array,
    timestep: float,
    command: Array,
) -> None:
    """Compute the rotor commands of one tick.

    Args:
        airframe: Body and rotors.
        gains: Gains of the controller.
        memory: `MEMORY` record, of which `integral` and `lag` are advanced.
        qpos: (7,) free joint: position, m, and quaternion wxyz.
        qvel: (6,) free joint: velocity, world frame, and angular velocity, body axes.
        timestep: s.
        command: (4,) rotor commands, N; written.
    """
    reference = memory.reference
    R_world_body = np.empty((3, 3))
    rotation_from_quaternion(qpos[3:], R_world_body)
    force = desired_force(
        airframe, gains, reference, qpos[:3], qvel[:3], R_world_body, memory.integral, timestep
    )
    R_world_desired = desired_attitude(force, reference[0, 3])
    rates = desired_rates(reference, R_world_desired, sqrt(dot(force, force)))
    thrust = airframe.mass * dot(force, R_world_body[:, 2])
    torque = desired_torque(airframe, gains, R_world_desired, R_world_body, rates, qvel[3:], thrust)
    rotors = allocate(airframe, gains, thrust, torque)
    command[:] = invert_lag(airframe, gains, rotors, memory.lag, timestep)
