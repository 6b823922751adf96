"""Legs: where the feet are by the joints, and torques by which they push or swing."""

from __future__ import annotations

from math import atan2, cos, hypot, sin
from typing import Any

import numpy as np

from wayproof.kernel_compiler import allocating, kernel
from wayproof.models.arrays import Array
from wayproof.models.robots.kernel_data import add_cross, rotate, rotation_from_quaternion
from wayproof.models.robots.quadruped.parameters import Actuators, Gait, Geometry, Legs


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


@allocating
def joint_torques(
    parameters: Any,
    joint_velocity: Array,
    bias: Array,
    passive: Array,
    leg_inertia: Array,
    observations: Any,
    memories: Any,
    torque: Array,
) -> None:
    """Compute the torques of one tick.

    Args:
        parameters: (1,) record of the controller's parameters.
        joint_velocity: (12,) rad/s.
        bias: (12,) torque that gravity and Coriolis forces need, Nm.
        passive: (12,) torque of springs and dampers in the joints, Nm.
        leg_inertia: (4, 3, 3) joint-space inertia of each leg, kg m^2.
        observations: (1,) this tick's `OBSERVATION` record.
        memories: (1,) `MEMORY` record.
        torque: (12,) Nm; written.
    """
    gait, legs, actuators = parameters[0].gait, parameters[0].legs, parameters[0].actuators
    observation, memory = observations[0], memories[0]
    force = np.empty(3)
    acceleration = np.empty(3)
    for leg in range(4):
        joint = 3 * leg
        J = observation.jacobian[leg]
        acceleration[:] = 0.0
        damping = legs.stance_damping
        if memory.swinging[leg] and not memory.touching[leg]:
            damping = 0.0
            _follow_swing(gait, legs, leg, observation, memory, force, acceleration)
            _solve3(J, acceleration)
        elif memory.touching[leg]:
            for i in range(3):
                force[i] = -memory.force[leg, i]
        else:
            _reach_down(legs, leg, observation, memory, force)
        for i in range(3):
            demand = bias[joint + i] - passive[joint + i] - damping * joint_velocity[joint + i]
            for j in range(3):
                demand += J[j, i] * force[j] + leg_inertia[leg, i, j] * acceleration[j]
            torque[joint + i] = limit_torque(actuators, i, demand, joint_velocity[joint + i])


@kernel
def _follow_swing(
    gait: Gait,
    legs: Legs,
    leg: int,
    observation: Any,
    memory: Any,
    force: Array,
    acceleration: Array,
) -> None:
    """Cartesian spring and damper about the swing curve, whose acceleration is fed forward."""
    share = (memory.leg_phase[leg] - gait.duty) / (1.0 - gait.duty)
    duration = (1.0 - gait.duty) * gait.period
    for i in range(3):
        start, end = memory.lift_off[leg, i], memory.foothold[leg, i]
        if i < 2:
            place, speed, bend = glide(share, start, end)
        else:
            top = max(start, end) + gait.swing_height
            place, speed, bend = arch(share, start, top, end - legs.press)
        acceleration[i] = bend / duration**2
        force[i] = legs.swing_stiffness * (place - observation.foot[leg, i])
        force[i] += legs.swing_damping * (speed / duration - observation.foot_velocity[leg, i])


@kernel
def glide(s: float, start: float, end: float) -> tuple[float, float, float]:
    """Return place and its two derivatives on the cubic at rest at both ends of s in [0, 1]."""
    way = end - start
    return start + way * s * s * (3.0 - 2.0 * s), way * 6.0 * s * (1.0 - s), way * (6.0 - 12.0 * s)


@kernel
def arch(s: float, start: float, top: float, end: float) -> tuple[float, float, float]:
    """Rise to `top` at s = 1/2 and fall to `end`, each in minimum jerk (Flash, Hogan 1985)."""
    low, rise = (start, top - start) if s < 0.5 else (top, end - top)
    r = 2.0 * s if s < 0.5 else 2.0 * s - 1.0
    place = r * r * r * (10.0 + r * (6.0 * r - 15.0))
    speed = 60.0 * r * r * (1.0 - r) * (1.0 - r)
    bend = 240.0 * r * (1.0 - r) * (1.0 - 2.0 * r)
    return low + rise * place, rise * speed, rise * bend


@kernel
def _reach_down(legs: Legs, leg: int, observation: Any, memory: Any, force: Array) -> None:
    """Lower a foot that should stand but has not met the ground, straight below its foothold."""
    velocity = observation.foot_velocity[leg]
    for i in range(2):
        force[i] = legs.swing_stiffness * (memory.foothold[leg, i] - observation.foot[leg, i])
        force[i] -= legs.swing_damping * velocity[i]
    force[2] = 2.0 * legs.swing_damping * (-legs.reach_speed - velocity[2])


@kernel
def limit_torque(actuators: Actuators, joint: int, demand: float, velocity: float) -> float:
    """Clip to the motor's envelope: less torque the faster it already turns that way."""
    limit = actuators.torque[joint]
    top_speed = actuators.speed[joint]
    along = velocity if demand > 0.0 else -velocity
    share = (top_speed - along) / ((1.0 - actuators.full_torque_share) * top_speed)
    limit *= min(max(share, 0.0), 1.0)
    return min(max(demand, -limit), limit)


@kernel
def _solve3(A: Array, x: Array) -> None:
    """Replace x by A^-1 x (Cramer's rule); by zero where the leg is near singular."""
    c0 = A[1, 1] * A[2, 2] - A[1, 2] * A[2, 1]
    c1 = A[1, 2] * A[2, 0] - A[1, 0] * A[2, 2]
    c2 = A[1, 0] * A[2, 1] - A[1, 1] * A[2, 0]
    determinant = A[0, 0] * c0 + A[0, 1] * c1 + A[0, 2] * c2
    scale = 1.0 / determinant if abs(determinant) > 1e-3 else 0.0
    a, b, c = scale * x[0], scale * x[1], scale * x[2]
    x[0] = (
        c0 * a
        + (A[0, 2] * A[2, 1] - A[0, 1] * A[2, 2]) * b
        + (A[0, 1] * A[1, 2] - A[0, 2] * A[1, 1]) * c
    )
    x[1] = (
        c1 * a
        + (A[0, 0] * A[2, 2] - A[0, 2] * A[2, 0]) * b
        + (A[0, 2] * A[1, 0] - A[0, 0] * A[1, 2]) * c
    )
    x[2] = (
        c2 * a
        + (A[0, 1] * A[2, 0] - A[0, 0] * A[2, 1]) * b
        + (A[0, 0] * A[1, 1] - A[0, 1] * A[1, 0]) * c
    )
