"""Control law of the quadrotor: reference, drag, geometric tracking on SE(3), rotor thrusts.

Lee, Leok and McClamroch, "Geometric tracking control of a quadrotor UAV on SE(3)", CDC 2010 (LLM
below); feed-forward to snap after Mellinger and Kumar, "Minimum snap trajectory generation and
control for quadrotors", ICRA 2011. World z up, body x forward and z along the thrust.
"""

from __future__ import annotations

from math import cos, floor, pi, sin, sqrt

import numpy as np

from wayproof.kernel_compiler import allocating, kernel
from wayproof.models.arrays import Array
from wayproof.models.robots.kernel_data import cross, dot
from wayproof.models.robots.quadrotor.parameters import GRAVITY, Airframe, Gains, Smoothing


@allocating
def desired_force(
    airframe: Airframe,
    gains: Gains,
    reference: Array,
    position: Array,
    velocity: Array,
    R_world_body: Array,
    integral: Array,
    timestep: float,
) -> Array:  # (3,)
    """Compute thrust over mass for position tracking, world frame, m/s^2: LLM equation 12.

    An integral (updated here) and the drag expected at the reference velocity are added.
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


@allocating
def desired_attitude(force: Array, heading: float) -> Array:  # (3, 3)
    """Return R_world_desired: z along the force, x nearest to the heading (LLM section IV)."""
    R = np.empty((3, 3))
    z = force / sqrt(force[0] ** 2 + force[1] ** 2 + force[2] ** 2)
    y_x, y_y, y_z = -z[2] * sin(heading), z[2] * cos(heading), z[0] * sin(heading)
    y_z -= z[1] * cos(heading)
    norm = sqrt(y_x**2 + y_y**2 + y_z**2)
    R[:, 2] = z
    R[0, 1], R[1, 1], R[2, 1] = y_x / norm, y_y / norm, y_z / norm
    cross(R[:, 1], R[:, 2], R[:, 0])
    return R


@allocating
def desired_rates(
    reference: Array, R_world_desired: Array, lift: float
) -> tuple[Array, Array]:  # (3,), (3,)
    """Compute angular velocity and acceleration of the desired attitude, in its own axes.

    The derivatives of `lift * z = acceleration + gravity` are jerk and snap; their parts across z
    turn z (Mellinger and Kumar, section III). About z, the heading's rate is kept by
    `y . (cos heading, sin heading, 0) = 0` and its derivative.

    Args:
        reference: (5, 4) reference by `smooth_setpoint`.
        R_world_desired: (3, 3).
        lift: Norm of thrust over mass, m/s^2.
    """
    x, y, z = R_world_desired[:, 0], R_world_desired[:, 1], R_world_desired[:, 2]
    jerk, snap = reference[3, :3], reference[4, :3]
    rate, acceleration = np.empty(3), np.empty(3)
    c, s = cos(reference[0, 3]), sin(reference[0, 3])
    x_along, y_across = x[0] * c + x[1] * s, y[1] * c - y[0] * s
    rate[0], rate[1] = -dot(jerk, y) / lift, dot(jerk, x) / lift
    rate[2] = (reference[1, 3] * y_across + rate[0] * (z[0] * c + z[1] * s)) / x_along
    stretch = 2.0 * dot(jerk, z) / lift
    acceleration[0] = -dot(snap, y) / lift - stretch * rate[0] + rate[1] * rate[2]
    acceleration[1] = dot(snap, x) / lift - stretch * rate[1] - rate[0] * rate[2]
    acceleration[2] = reference[2, 3] * y_across / x_along
    return rate, acceleration


@allocating
def attitude_error(R_world_desired: Array, R_world_body: Array) -> Array:  # (3,)
    """Return half the vee of R_d^T R - R^T R_d, in body axes: LLM equation 10."""
    error = np.empty(3)
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        error[i] = 0.5 * (
            dot(R_world_desired[:, k], R_world_body[:, j])
            - dot(R_world_desired[:, j], R_world_body[:, k])
        )
    return error


@kernel
def tilt_error(R_world_desired: Array, R_world_body: Array) -> tuple[float, float]:
    """Return the part of the attitude error that tilts, about the body's x and y axes.

    The shortest rotation between the two z axes (Brescianini and D'Andrea, "Tilt-prioritized
    quadrocopter attitude control", IEEE TCST 2020), sine of its angle. `attitude_error` is this
    where the headings agree; where they differ by an angle, it is turned by half of that.
    """
    z = R_world_desired[:, 2]
    return dot(z, R_world_body[:, 1]), -dot(z, R_world_body[:, 0])


@allocating
def desired_torque(
    airframe: Airframe,
    gains: Gains,
    R_world_desired: Array,
    R_world_body: Array,
    rates: tuple[Array, Array],
    angular_velocity: Array,
    thrust: float,
) -> Array:  # (3,)
    """Compute the body torque, Nm: LLM equation 16, with gains multiplied by the inertia.

    Roll and pitch are limited together, to the `tilt_room` beside the thrust.

    Args:
        airframe: Body.
        gains: Gains of attitude and rate.
        R_world_desired: (3, 3).
        R_world_body: (3, 3).
        rates: Angular velocity and acceleration by `desired_rates`.
        angular_velocity: (3,) body axes, rad/s.
        thrust: Collective demanded meanwhile, N.
    """
    rate, acceleration = np.empty(3), np.empty(3)  # the same in body axes
    momentum = np.empty(3)
    for i in range(3):
        rate[i] = acceleration[i] = 0.0
        momentum[i] = airframe.inertia[i] * angular_velocity[i]
        for j in range(3):
            turn = dot(R_world_body[:, i], R_world_desired[:, j])
            rate[i] += turn * rates[0][j]
            acceleration[i] += turn * rates[1][j]
    error = attitude_error(R_world_desired, R_world_body)
    if gains.tilt_first:
        error[0], error[1] = tilt_error(R_world_desired, R_world_body)
    gyroscopic, transport = np.empty(3), np.empty(3)
    cross(angular_velocity, momentum, gyroscopic)
    cross(angular_velocity, rate, transport)
    torque = np.empty(3)
    for i in range(3):
        angular = acceleration[i] - transport[i] - gains.attitude[i] * error[i]
        angular -= gains.rate[i] * (angular_velocity[i] - rate[i])
        torque[i] = airframe.inertia[i] * angular + gyroscopic[i]
    spread = 0.25 * (abs(torque[0]) / airframe.arm_y + abs(torque[1]) / airframe.arm_x)
    torque[:2] *= min(1.0, tilt_room(airframe, gains, thrust) / max(spread, 1e-9))
    return torque


@kernel
def tilt_room(airframe: Airframe, gains: Gains, thrust: float) -> float:
    """Return the thrust, N, that roll and pitch together may add to or take from a rotor's share.

    A torque that takes more than lies between that share and idle forces the collective up. The
    craft then accelerates sideways by more than its tilt was chosen for, so position feedback is
    too strong; it climbs, and a climb takes lift from the demand, which leaves less room. It
    tipped over so, with more torque more often.

    Args:
        airframe: Body.
        gains: `tilt_share`, `tilt_floor` and `idle`.
        thrust: Collective demanded, N.
    """
    room = 0.25 * thrust - gains.idle * airframe.thrust_max
    room = max(room, gains.tilt_floor * airframe.thrust_max)
    return min(room, gains.tilt_share * airframe.thrust_max)


@allocating
def air_drag(airframe: Airframe, R_world_body: Array, airspeed: Array) -> Array:  # (3,)
    """Compute drag, N, at a velocity (3,) through the air, m/s, both in the world frame.

    That of the rotors is -R D R^T v (Kai et al. 2017; Faessler et al. 2018), that of the hull
    -c |v| v.
    """
    drag = np.empty(3)
    speed = sqrt(dot(airspeed, airspeed))
    for i in range(3):
        drag[i] = -airframe.body_drag * speed * airspeed[i]
    for axis in range(3):
        along = airframe.drag[axis] * dot(R_world_body[:, axis], airspeed)
        for i in range(3):
            drag[i] -= along * R_world_body[i, axis]
    return drag


ROTOR_X = (-1.0, -1.0, 1.0, 1.0)
"""Sign of each rotor's place along x: behind, behind, ahead, ahead."""

ROTOR_Y = (-1.0, 1.0, 1.0, -1.0)
"""Sign of each rotor's place along y: right, left, left, right."""

ROTOR_SPIN = (-1.0, 1.0, -1.0, 1.0)
"""Sign of each rotor's reaction torque about z."""


@allocating
def allocate(airframe: Airframe, gains: Gains, thrust: float, torque: Array) -> Array:  # (4,)
    """Return rotor thrusts, N, within their limits: yaw yields first, roll and pitch last.

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


@allocating
def invert_lag(
    airframe: Airframe, gains: Gains, rotors: Array, lag: Array, timestep: float
) -> Array:  # (4,)
    """Return the command whose lagged thrust is the demand: demand + lag * its derivative.

    Args:
        airframe: Rotor limits and lag.
        gains: Share of the lag that is inverted, and its filter.
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


@allocating
def smooth_setpoint(
    smoothing: Smoothing, reference: Array, setpoint: Array, timestep: float
) -> None:
    """Advance the reference by one tick and choose its snap toward a setpoint.

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
    """Integrate over a tick, exactly for a constant snap."""
    for channel in range(4):
        for order in range(4):
            power = 1.0
            for higher in range(order + 1, 5):
                power *= timestep / (higher - order)
                reference[order, channel] += power * reference[higher, channel]


@allocating
def _choose_snap(
    reference: Array, target: Array, bandwidth: float, limits: tuple[float, float, float, float]
) -> None:
    """Set the snap by four nested loops, each with a limit on its demand of the next.

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
