"""Where a swinging foot is to land: under the hip, half a stance ahead (Raibert 1986, ch. 2)."""

from __future__ import annotations

from math import cos, sin
from typing import Any

from models._jit import kernel
from models.robots.quadruped.parameters import Gait, Geometry


@kernel
def place_feet(gaits: Any, geometries: Any, observations: Any, memories: Any) -> None:
    """Set the `MEMORY` record's `foothold` of every swinging leg, world frame, m. Arrays (1,).

    The hip's place at touch-down plus half the way of the coming stance at the commanded velocity
    (the symmetric gait), plus a share of the velocity error, which brakes what is too fast.
    """
    gait, geometry, observation, memory = gaits[0], geometries[0], observations[0], memories[0]
    for leg in range(4):
        if memory.swinging[leg]:
            _place_foot(gait, geometry, leg, observation, memory)


@kernel
def _place_foot(gait: Gait, geometry: Geometry, leg: int, observation: Any, memory: Any) -> None:
    half_stance = 0.5 * gait.duty * gait.period
    remaining = (1.0 - memory.leg_phase[leg]) * gait.period
    yaw = observation.angles[2]
    c, s = cos(yaw), sin(yaw)
    vx = c * memory.command[0] - s * memory.command[1]
    vy = s * memory.command[0] + c * memory.command[1]
    # The yaw in mid-stance, taking half of the remaining turn from the measured rate.
    turn = 0.5 * remaining * (observation.angular_velocity[2] + memory.command[2])
    yaw_stance = yaw + turn + half_stance * memory.command[2]
    hip_x = geometry.hip_x if leg < 2 else -geometry.hip_x
    hip_y = geometry.hip_y + geometry.thigh_y
    hip_y = hip_y if leg % 2 == 0 else -hip_y
    ux, uy = observation.com_velocity[0], observation.com_velocity[1]
    dx = ux * remaining + cos(yaw_stance) * hip_x - sin(yaw_stance) * hip_y
    dy = uy * remaining + sin(yaw_stance) * hip_x + cos(yaw_stance) * hip_y
    dx += half_stance * vx + gait.raibert_gain * (ux - vx)
    dy += half_stance * vy + gait.raibert_gain * (uy - vy)
    memory.foothold[leg, 0] = observation.position[0] + dx
    memory.foothold[leg, 1] = observation.position[1] + dy
    slope = sin(memory.ground_roll) * (c * dy - s * dx) - sin(memory.ground_pitch) * (
        c * dx + s * dy
    )
    memory.foothold[leg, 2] = memory.ground_height + geometry.foot_radius + slope
