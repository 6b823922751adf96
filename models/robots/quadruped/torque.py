"""Joint torques: stance feet push as planned, swing feet follow a curve."""

from __future__ import annotations

from typing import Any

import numpy as np

from wayproof.models._jit import allocating, kernel
from wayproof.models.arrays import Array
from wayproof.models.robots.quadruped.parameters import Actuators, Gait, Legs


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
