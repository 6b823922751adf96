"""Where the body and the feet are: rotation, centre of mass, leg kinematics and Jacobians."""

from __future__ import annotations

from math import acos, atan2, cos, hypot, sin
from typing import Any

import numpy as np
from numpy.typing import NDArray

from models._jit import kernel
from models.robots.quadruped.parameters import Geometry

Array = NDArray[np.float64]


def standing_joints(geometry: Geometry, height: float) -> tuple[float, float, float]:
    """Hip, thigh and calf angle that put the foot under the hip, by the law of cosines, rad.

    Args:
        geometry: Leg geometry.
        height: Base origin above the ground, m.

    Raises:
        ValueError: The leg does not reach that far.
    """
    thigh, calf = geometry.thigh_length, geometry.calf_length
    reach = height - geometry.foot_radius
    if not abs(thigh - calf) < reach < thigh + calf:
        raise ValueError(f"height: got {height} m, legs reach to {thigh + calf} m above the foot")
    bend = acos((reach**2 - thigh**2 - calf**2) / (2.0 * thigh * calf))
    return 0.0, atan2(calf * sin(bend), thigh + calf * cos(bend)), -bend


@kernel
def observe(
    geometries: Any, com_in_body: Array, qpos: Array, qvel: Array, observations: Any
) -> None:
    """Fill the `OBSERVATION` record.

    Args:
        geometries: (1,) leg geometry, packed.
        com_in_body: (3,) base origin to centre of mass in the body frame, m.
        qpos: (19,) free joint (position, quaternion wxyz), then 4 x (hip, thigh, calf).
        qvel: (18,) linear velocity in the world, angular velocity in the body, joint rates.
        observations: (1,) record to fill.
    """
    geometry, observation = geometries[0], observations[0]
    R = observation.rotation
    rotation_from_quaternion(qpos[3:7], R)
    observation.angles[0] = atan2(R[2, 1], R[2, 2])
    observation.angles[1] = -atan2(R[2, 0], hypot(R[0, 0], R[1, 0]))
    observation.angles[2] = atan2(R[1, 0], R[0, 0])
    _rotate(R, qvel[3:6], observation.angular_velocity)
    _rotate(R, com_in_body, observation.lever)
    for i in range(3):
        observation.position[i] = qpos[i]
        observation.com[i] = qpos[i] + observation.lever[i]
    _add_cross(qvel[:3], observation.angular_velocity, observation.lever, observation.com_velocity)
    for leg in range(4):
        _observe_foot(geometry, leg, qpos, qvel, observation)


@kernel
def _observe_foot(geometry: Geometry, leg: int, qpos: Array, qvel: Array, observation: Any) -> None:
    in_body = np.empty(3)
    jacobian = np.empty((3, 3))
    arm = np.empty(3)
    relative = np.empty(3)
    joint = 3 * leg
    foot_position(geometry, leg, qpos[7 + joint : 10 + joint], in_body)
    foot_jacobian(geometry, leg, qpos[7 + joint : 10 + joint], jacobian)
    _rotate(observation.rotation, in_body, arm)
    for i in range(3):
        relative[i] = qvel[i]
        observation.foot[leg, i] = qpos[i] + arm[i]
        for j in range(3):
            entry = 0.0
            for k in range(3):
                entry += observation.rotation[i, k] * jacobian[k, j]
            observation.jacobian[leg, i, j] = entry
            relative[i] += entry * qvel[6 + joint + j]
    _add_cross(relative, observation.angular_velocity, arm, observation.foot_velocity[leg])


@kernel
def rotation_from_quaternion(quaternion: Array, R: Array) -> None:
    """R_world_body (3, 3) of a unit quaternion wxyz (4,)."""
    w, x, y, z = quaternion[0], quaternion[1], quaternion[2], quaternion[3]
    R[0, 0], R[0, 1], R[0, 2] = 1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)
    R[1, 0], R[1, 1], R[1, 2] = 2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)
    R[2, 0], R[2, 1], R[2, 2] = 2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)


@kernel
def foot_position(geometry: Geometry, leg: int, joints: Array, position: Array) -> None:
    """Foot centre (3,) in the body frame for hip, thigh and calf angles (3,)."""
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
    """Derivative (3, 3) of `foot_position` by the joint angles, body frame, m/rad."""
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


@kernel
def _rotate(R: Array, vector: Array, rotated: Array) -> None:
    for i in range(3):
        rotated[i] = R[i, 0] * vector[0] + R[i, 1] * vector[1] + R[i, 2] * vector[2]


@kernel
def _add_cross(start: Array, a: Array, b: Array, total: Array) -> None:
    """Total = start + a x b."""
    total[0] = start[0] + a[1] * b[2] - a[2] * b[1]
    total[1] = start[1] + a[2] * b[0] - a[0] * b[2]
    total[2] = start[2] + a[0] * b[1] - a[1] * b[0]
