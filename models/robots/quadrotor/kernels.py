"""Geometric tracking control on SE(3), with feed-forward to snap; and drag, the plant's.

Lee, Leok and McClamroch, "Geometric tracking control of a quadrotor UAV on SE(3)", CDC 2010 (LLM
below); feed-forward after Mellinger and Kumar, "Minimum snap trajectory generation and control for
quadrotors", ICRA 2011. World z up, body x forward and z along the thrust.
"""

from __future__ import annotations

from math import cos, floor, isfinite, pi, sin, sqrt
from typing import Any

import numpy as np

from wayproof.models._jit import kernel
from wayproof.models.arrays import Array
from wayproof.models.robots.quadrotor.parameters import GRAVITY, Airframe, Gains, Smoothing

ROTOR_X = (-1.0, -1.0, 1.0, 1.0)
ROTOR_Y = (-1.0, 1.0, 1.0, -1.0)
ROTOR_SPIN = (-1.0, 1.0, -1.0, 1.0)


@kernel
def fly(
    asked: Array,
    airframes: Any,
    gains: Any,
    smoothings: Any,
    reference: Array,
    qpos: Array,
    qvel: Array,
    wind: Array,
    integral: Array,
    lag: Array,
    timestep: float,
    command: Array,
    drag: Array,
) -> bool:
    """One tick of everything: smooth reference, control, and the plant's drag.

    Args:
        asked: (8,) the setpoint's row, of which position and heading count.
        airframes: (1,) body and rotors, packed.
        gains: (1,) of the controller, packed.
        smoothings: (1,) of the reference, packed.
        reference: (5, 4) of `smooth_setpoint`, updated.
        qpos: (7,) free joint: position, m, and quaternion wxyz.
        qvel: (6,) free joint: velocity, world frame, and angular velocity, body axes.
        wind: (3,) velocity of the air, world frame, m/s.
        integral: (3,) m/s^2, updated.
        lag: (2, 4) of `invert_lag`, updated.
        timestep: s.
        command: (4,) rotor commands, N; output.
        drag: (3,) on the body, world frame, N; output.

    Returns:
        Whether the setpoint was finite; nothing is written where it was not.
    """
    x, y, z, heading = asked[0], asked[1], asked[2], asked[6]
    if not isfinite(x + y + z + heading):
        return False
    airframe = airframes[0]
    smooth_setpoint(smoothings[0], reference, np.array((x, y, z, heading)), timestep)
    track(airframe, gains[0], reference, qpos, qvel, integral, lag, timestep, command)
    drag[:] = air_drag(airframe, rotation_matrix(qpos[3:]), qvel[:3] - wind)
    return True


@kernel
def rotation_matrix(quaternion: Array) -> Array:  # (3, 3)
    """R_world_body of a unit quaternion wxyz."""
    w, x, y, z = quaternion
    R = np.empty((3, 3))
    R[0] = 1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)
    R[1] = 2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)
    R[2] = 2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)
    return R


@kernel
def smooth_setpoint(
    smoothing: Smoothing, reference: Array, setpoint: Array, timestep: float
) -> None:
    """Move the reference on by one tick and choose its snap towards a setpoint.

    Args:
        smoothing: Bandwidth and limits.
        reference: (5, 4) position, velocity, acceleration, jerk and snap by row; x, y, z, m, and
            heading, rad, unwrapped, by column; updated.
        setpoint: (4,) x, y, z, m, and heading, rad.
        timestep: s.
    """
    _integrate(reference, timestep)
    target = setpoint.copy()
    target[3] -= 2 * pi * floor((target[3] - reference[0, 3] + pi) / (2 * pi))
    _choose_snap(reference[:, :3], target[:3], smoothing.bandwidth, smoothing.limits)
    _choose_snap(reference[:, 3:], target[3:], smoothing.bandwidth, smoothing.heading_limits)


@kernel
def _integrate(reference: Array, timestep: float) -> None:
    """Exact for a snap that is held over the tick."""
    for channel in range(4):
        for order in range(4):
            power = 1.0
            for higher in range(order + 1, 5):
                power *= timestep / (higher - order)
                reference[order, channel] += power * reference[higher, channel]


@kernel
def _choose_snap(
    reference: Array, target: Array, bandwidth: float, limits: tuple[float, float, float, float]
) -> None:
    """Four loops around one another, each with a limit on what it may ask of the next.

    Unlimited, their gains put all four poles at the bandwidth: (s + b)^4 = s^4 + 4 b s^3
    + 6 b^2 s^2 + 4 b^3 s + b^4, read from the inside out.
    """
    demand = target
    gains = (bandwidth / 4, bandwidth * 2 / 3, bandwidth * 3 / 2, bandwidth * 4)
    for order in range(4):
        demand = gains[order] * (demand - reference[order])
        norm = sqrt((demand * demand).sum())
        demand *= min(1.0, limits[order] / max(norm, 1e-9))
    reference[4] = demand


@kernel
def demanded_force(
    airframe: Airframe,
    gains: Gains,
    reference: Array,
    position: Array,
    velocity: Array,
    R_world_body: Array,
    integral: Array,
    timestep: float,
) -> Array:  # (3,)
    """Thrust over mass that position tracking asks for, world frame, m/s^2: LLM equation 12.

    Beyond it an integral (updated here) and the drag expected at the reference velocity.
    """
    demand = np.empty(3)
    for i in range(3):
        error = reference[0, i] - position[i]
        error = min(max(error, -gains.position_limit), gains.position_limit)
        total = integral[i] + timestep * gains.integral * error
        integral[i] = min(max(total, -gains.integral_limit), gains.integral_limit)
        demand[i] = reference[2, i] + gains.position[i] * error + integral[i]
        demand[i] += gains.velocity[i] * (reference[1, i] - velocity[i])
    demand -= air_drag(airframe, R_world_body, reference[1, :3]) / airframe.mass
    demand[2] = max(demand[2] + GRAVITY, gains.least_lift * GRAVITY)
    return demand


@kernel
def demanded_attitude(force: Array, heading: float) -> Array:  # (3, 3)
    """R_world_desired: z along the force, x as near as can be to the heading (LLM section IV)."""
    R = np.empty((3, 3))
    z = force / sqrt(force[0] ** 2 + force[1] ** 2 + force[2] ** 2)
    y_x, y_y, y_z = -z[2] * sin(heading), z[2] * cos(heading), z[0] * sin(heading)
    y_z -= z[1] * cos(heading)
    norm = sqrt(y_x**2 + y_y**2 + y_z**2)
    R[:, 2] = z
    R[0, 1], R[1, 1], R[2, 1] = y_x / norm, y_y / norm, y_z / norm
    R[:, 0] = _cross(R[:, 1], R[:, 2])
    return R


@kernel
def demanded_rates(
    reference: Array, R_world_desired: Array, lift: float
) -> tuple[Array, Array]:  # (3,), (3,)
    """Angular velocity and acceleration of the demanded attitude, in its own axes.

    The derivatives of `lift * z = acceleration + gravity` are jerk and snap; what they ask for
    across z turns z (Mellinger and Kumar, section III). About z, the heading's rate is kept by
    `y . (cos heading, sin heading, 0) = 0` and its derivative.

    Args:
        reference: (5, 4) of `smooth_setpoint`.
        R_world_desired: (3, 3).
        lift: Norm of thrust over mass, m/s^2.
    """
    x, y, z = R_world_desired[:, 0], R_world_desired[:, 1], R_world_desired[:, 2]
    jerk, snap = reference[3, :3], reference[4, :3]
    rate, acceleration = np.empty(3), np.empty(3)
    c, s = cos(reference[0, 3]), sin(reference[0, 3])
    x_along, y_across = x[0] * c + x[1] * s, y[1] * c - y[0] * s
    rate[0], rate[1] = -_dot(jerk, y) / lift, _dot(jerk, x) / lift
    rate[2] = (reference[1, 3] * y_across + rate[0] * (z[0] * c + z[1] * s)) / x_along
    stretch = 2.0 * _dot(jerk, z) / lift
    acceleration[0] = -_dot(snap, y) / lift - stretch * rate[0] + rate[1] * rate[2]
    acceleration[1] = _dot(snap, x) / lift - stretch * rate[1] - rate[0] * rate[2]
    acceleration[2] = reference[2, 3] * y_across / x_along
    return rate, acceleration


@kernel
def attitude_error(R_world_desired: Array, R_world_body: Array) -> Array:  # (3,)
    """Half the vee of R_d^T R - R^T R_d, in body axes: LLM equation 10."""
    error = np.empty(3)
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        error[i] = 0.5 * (
            _dot(R_world_desired[:, k], R_world_body[:, j])
            - _dot(R_world_desired[:, j], R_world_body[:, k])
        )
    return error


@kernel
def demanded_torque(
    airframe: Airframe,
    gains: Gains,
    R_world_desired: Array,
    R_world_body: Array,
    rates: tuple[Array, Array],
    angular_velocity: Array,
) -> Array:  # (3,)
    """Body torque, Nm: LLM equation 16, with gains multiplied by the inertia.

    Roll and pitch are limited together: one rotor at its least thrust would otherwise force the
    collective up, the climb would take lift from the demanded force, and less lift asks for
    faster turns.

    Args:
        airframe: Body.
        gains: Of attitude and rate.
        R_world_desired: (3, 3).
        R_world_body: (3, 3).
        rates: Of `demanded_rates`, in the demanded axes.
        angular_velocity: (3,) body axes, rad/s.
    """
    rate, acceleration = np.empty(3), np.empty(3)  # the same in body axes
    momentum = np.empty(3)
    for i in range(3):
        rate[i] = acceleration[i] = 0.0
        momentum[i] = airframe.inertia[i] * angular_velocity[i]
        for j in range(3):
            turn = _dot(R_world_body[:, i], R_world_desired[:, j])
            rate[i] += turn * rates[0][j]
            acceleration[i] += turn * rates[1][j]
    error = attitude_error(R_world_desired, R_world_body)
    gyroscopic = _cross(angular_velocity, momentum)
    transport = _cross(angular_velocity, rate)
    torque = np.empty(3)
    for i in range(3):
        angular = acceleration[i] - transport[i] - gains.attitude[i] * error[i]
        angular -= gains.rate[i] * (angular_velocity[i] - rate[i])
        torque[i] = airframe.inertia[i] * angular + gyroscopic[i]
    spread = 0.25 * (abs(torque[0]) / airframe.arm_y + abs(torque[1]) / airframe.arm_x)
    torque[:2] *= min(1.0, gains.tilt_share * airframe.thrust_max / max(spread, 1e-9))
    return torque


@kernel
def allocate(airframe: Airframe, gains: Gains, thrust: float, torque: Array) -> Array:  # (4,)
    """Rotor thrusts within their limits; yaw is given up first, then thrust, roll and pitch last.

    Roll and pitch decide whether the craft stays upright and where it goes, so their torques are
    met whenever the rotors' range allows; the collective is shifted to make room for them.
    """
    low, high = gains.idle * airframe.thrust_max, airframe.thrust_max
    rotors = np.empty(4)
    for i in range(4):
        roll = ROTOR_Y[i] * torque[0] / airframe.arm_y
        rotors[i] = 0.25 * (roll - ROTOR_X[i] * torque[1] / airframe.arm_x)
    rotors *= min(1.0, (high - low) / max(rotors.max() - rotors.min(), 1e-9))
    base = min(max(0.25 * thrust, low - rotors.min()), high - rotors.max())
    rotors += base
    room = min(rotors.min() - low, high - rotors.max(), gains.yaw_share * high)
    yaw = min(max(0.25 * torque[2] / airframe.yaw_ratio, -room), room)
    for i in range(4):
        rotors[i] = min(max(rotors[i] + ROTOR_SPIN[i] * yaw, 0.0), high)
    return rotors


@kernel
def invert_lag(
    airframe: Airframe, gains: Gains, rotors: Array, lag: Array, timestep: float
) -> Array:  # (4,)
    """Command that makes lagging rotors give what is demanded: demand + lag * its derivative.

    Args:
        airframe: Rotor limits and lag.
        gains: How much is inverted and how smoothly.
        rotors: (4,) demanded thrust, N.
        lag: (2, 4) demand of the last tick, N, and its filtered derivative, N/s; updated.
        timestep: s.
    """
    command = np.empty(4)
    for i in range(4):
        slope = (rotors[i] - lag[0, i]) / timestep
        lag[1, i] += timestep / gains.lag_filter * (slope - lag[1, i])
        lag[0, i] = rotors[i]
        lead = rotors[i] + gains.lag_lead * airframe.rotor_lag * lag[1, i]
        command[i] = min(max(lead, 0.0), airframe.thrust_max)
    return command


@kernel
def track(
    airframe: Airframe,
    gains: Gains,
    reference: Array,
    qpos: Array,
    qvel: Array,
    integral: Array,
    lag: Array,
    timestep: float,
    command: Array,
) -> None:
    """One tick of control.

    Args:
        airframe: Body and rotors.
        gains: Of the controller.
        reference: (5, 4) of `smooth_setpoint`.
        qpos: (7,) free joint: position, m, and quaternion wxyz.
        qvel: (6,) free joint: velocity, world frame, and angular velocity, body axes.
        integral: (3,) m/s^2, updated.
        lag: (2, 4) of `invert_lag`, updated.
        timestep: s.
        command: (4,) rotor commands, N; output.
    """
    R_world_body = rotation_matrix(qpos[3:])
    force = demanded_force(
        airframe, gains, reference, qpos[:3], qvel[:3], R_world_body, integral, timestep
    )
    R_world_desired = demanded_attitude(force, reference[0, 3])
    rates = demanded_rates(reference, R_world_desired, sqrt(_dot(force, force)))
    torque = demanded_torque(airframe, gains, R_world_desired, R_world_body, rates, qvel[3:])
    thrust = airframe.mass * _dot(force, R_world_body[:, 2])
    rotors = allocate(airframe, gains, thrust, torque)
    command[:] = invert_lag(airframe, gains, rotors, lag, timestep)


@kernel
def air_drag(airframe: Airframe, R_world_body: Array, airspeed: Array) -> Array:  # (3,)
    """Drag in the world frame, N, at a velocity (3,) through the air, world frame.

    Of the rotors -R D R^T v (Kai et al. 2017; Faessler et al. 2018), of the body -c |v| v.
    """
    drag = np.empty(3)
    speed = sqrt(_dot(airspeed, airspeed))
    for i in range(3):
        drag[i] = -airframe.body_drag * speed * airspeed[i]
    for axis in range(3):
        along = airframe.drag[axis] * _dot(R_world_body[:, axis], airspeed)
        for i in range(3):
            drag[i] -= along * R_world_body[i, axis]
    return drag


@kernel
def _dot(a: Array, b: Array) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]  # type: ignore[no-any-return]


@kernel
def _cross(a: Array, b: Array) -> Array:
    c = np.empty(3)
    c[0] = a[1] * b[2] - a[2] * b[1]
    c[1] = a[2] * b[0] - a[0] * b[2]
    c[2] = a[0] * b[1] - a[1] * b[0]
    return c
