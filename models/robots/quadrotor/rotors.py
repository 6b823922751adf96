"""Rotor thrusts: allocation within limits, and inversion of the motors' lag."""

from __future__ import annotations

import numpy as np

from wayproof.models._jit import allocating
from wayproof.models.arrays import Array
from wayproof.models.robots.quadrotor.parameters import Airframe, Gains

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
