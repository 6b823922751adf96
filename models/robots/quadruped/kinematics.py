"""Kinematics: body and feet in the world, from the free joint and the leg joints."""

from __future__ import annotations

from math import atan2, cos, hypot, sin
from typing import Any

import numpy as np

from wayproof.models._jit import allocating, kernel
from wayproof.models.arrays import Array
from wayproof.models.robots.linear_algebra import add_cross, rotate, rotation_from_quaternion
from wayproof.models.robots.quadruped.parameters import Geometry


@kernel
def observe(parameters: Any, qpos: Array, qvel: Array, observations: Any) -> None:
    """Fill the `OBSERVATION` record.

    Args:
        parameters: (1,) record of the controller's parameters.
        qpos: (19,) free joint (position, quaternion wxyz), then 4 x (hip, thigh, calf).
        qvel: (18,) linear velocity in the world, angular velocity in the body, joint rates.
        observations: (1,) record to fill.
    """
    geometry, observation = parameters[0].geometry, observations[0]
    R = observation.rotation
    rotation_from_quaternion(qpos[3:7], R)
    observation.angles[0] = atan2(R[2, 1], R[2, 2])
    observation.angles[1] = -atan2(R[2, 0], hypot(R[0, 0], R[1, 0]))
    observation.angles[2] = atan2(R[1, 0], R[0, 0])
    rotate(R, qvel[3:6], observation.angular_velocity)
    rotate(R, parameters[0].com_in_body, observation.lever)
    for i in range(3):
        observation.position[i] = qpos[i]
        observation.com[i] = qpos[i] + observation.lever[i]
    add_cross(qvel[:3], observation.angular_velocity, observation.lever, observation.com_velocity)
    for leg in range(4):
        _observe_foot(geometry, leg, qpos, qvel, observation)


@allocating
def _observe_foot(geometry: Geometry, leg: int, qpos: Array, qvel: Array, observation: Any) -> None:
    in_body = np.empty(3)
    jacobian = np.empty((3, 3))
    arm = np.empty(3)
    relative = np.empty(3)
    joint = 3 * leg
    foot_position(geometry, leg, qpos[7 + joint : 10 + joint], in_body)
    foot_jacobian(geometry, leg, qpos[7 + joint : 10 + joint], jacobian)
    rotate(observation.rotation, in_body, arm)
    for i in range(3):
        relative[i] = qvel[i]
        observation.foot[leg, i] = qpos[i] + arm[i]
        for j in range(3):
            entry = 0.0
            for k in range(3):
                entry += observation.rotation[i, k] * jacobian[k, j]
            observation.jacobian[leg, i, j] = entry
            relative[i] += entry * qvel[6 + joint + j]
    add_cross(relative, observation.angular_velocity, arm, observation.foot_velocity[leg])


@kernel
def foot_position(geometry: Geometry, leg: int, joints: Array, position: Array) -> None:
    """Write the foot centre (3,), body frame, m, for hip, thigh and calf angles (3,), rad."""
    front, side = 1.0 - 2.0 * (leg // 2), 1.0 - 2.0 * (leg % 2)
    outward = side * geometry.thigh_y
    thigh, shank = joints[1], joints[1] + joints[2]
    forward = -geometry.thigh_length * sin(thigh) - geometry.calf_length * sin(shank)
    upward = -geometry.thigh_length * cos(thigh) - geometry.calf_length * cos(shank)
    position[0] = front * geometry.hip_x + forward
    position[1] = side * geometry.hip_y + cos(joints[0]) * outward - sin(joints[0]) * upward
    position[2] = sin(joints[0]) * outward + cos(joints[0]) * upward


@kernel
def foot_jacobian(geometry: Geometry, leg: int, joints: Array, jacobian: Array) -> None:
    """Write the derivative (3, 3) of `foot_position` by the joint angles, body frame, m/rad."""
    outward = (1.0 - 2.0 * (leg % 2)) * geometry.thigh_y
    s, c = sin(joints[0]), cos(joints[0])
    thigh, shank = joints[1], joints[1] + joints[2]
    upward = -geometry.thigh_length * cos(thigh) - geometry.calf_length * cos(shank)
    forward_by_calf = -geometry.calf_length * cos(shank)
    upward_by_calf = geometry.calf_length * sin(shank)
    upward_by_thigh = geometry.thigh_length * sin(thigh) + upward_by_calf
    jacobian[0, 0], jacobian[0, 1], jacobian[0, 2] = 0.0, upward, forward_by_calf
    jacobian[1, 0], jacobian[1, 1] = -s * outward - c * upward, -s * upward_by_thigh
    jacobian[2, 0], jacobian[2, 1] = c * outward - s * upward, c * upward_by_thigh
    jacobian[1, 2], jacobian[2, 2] = -s * upward_by_calf, c * upward_by_calf
