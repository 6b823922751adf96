"""Displacement of a sensor from the mounting that the stack is given."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wayproof.models.poses import Trail, rotation_matrices

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Displacement:
    """True pose of a sensor relative to its stated mounting.

    Attributes:
        position: (3,) shift, in the stated sensor frame, m.
        quaternion: (4,) turn about the stated sensor's origin, w x y z.
    """

    position: Array
    quaternion: Array

    @property
    def R(self) -> Array:  # (3, 3)
        """The turn as a matrix."""
        R: Array = rotation_matrices(self.quaternion[None])[0]
        return R

    def move_site(self, position: Array, matrix: Array) -> None:
        """Move the world pose of the sensor's site, (3,) and (9,), in place."""
        R_world_sensor = matrix.reshape(3, 3).copy()
        position += R_world_sensor @ self.position
        matrix[:] = (R_world_sensor @ self.R).ravel()

    def move_trail(self, trail: Trail, position: Array, R: Array) -> Trail:
        """Return poses of a base whose stated sensor is where the displaced one truly was.

        With D the displacement, T_world_base T_base_sensor D = (T_world_base D') T_base_sensor,
        where D' = T_base_sensor D T_base_sensor^-1.

        Args:
            trail: True poses of the base.
            position: (3,) of the stated mounting, base frame, m.
            R: (3, 3) of the stated mounting, R_base_sensor.
        """
        turn = np.concatenate([self.quaternion[:1], R @ self.quaternion[1:]])
        R_turn = rotation_matrices(turn[None])[0]
        shift = position + R @ self.position - R_turn @ position
        positions = trail.positions + rotation_matrices(trail.quaternions) @ shift
        return Trail(positions, _product(trail.quaternions, turn), trail.period)


def _product(quaternions: Array, second: Array) -> Array:  # (k, 4)
    """Return Hamilton products of each (k, 4) with one (4,)."""
    w, x, y, z = quaternions.T
    a, b, c, d = second
    return np.stack(
        [
            w * a - x * b - y * c - z * d,
            w * b + x * a + y * d - z * c,
            w * c - x * d + y * a + z * b,
            w * d + x * c - y * b + z * a,
        ],
        axis=1,
    )
