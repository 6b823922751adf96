"""Aerodynamic drag of rotors and hull."""

from __future__ import annotations

from math import sqrt

import numpy as np

from wayproof.models._jit import allocating
from wayproof.models.arrays import Array
from wayproof.models.robots.linear_algebra import dot
from wayproof.models.robots.quadrotor.parameters import Airframe


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
