"""Boxes in any attitude."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import cos, sin

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wayproof.models.arrays import Vector3
from wayproof.models.worlds.solids.solid import Band, Solid, numbers, write_geom
from wayproof.models.worlds.solids.triangles import BOX_FACES, distance_to_triangles


@dataclass(frozen=True)
class Box(Solid):
    """A solid box.

    Attributes:
        centre: World frame, m.
        half_extents: Half the length, width and height, along the box's own axes, m.
        yaw: Turn of the box's axes about z, rad.
        kind: Kind of thing, such as `wall`.
        pitch: Turn about the y axis that yaw leaves, rad.
        roll: Turn about the x axis that yaw and pitch leave, rad.
    """

    centre: Vector3
    half_extents: Vector3
    yaw: float
    kind: str
    pitch: float = 0.0
    roll: float = 0.0

    def __post_init__(self) -> None:
        """Refuse flat boxes.

        Raises:
            ValueError: A half extent is not positive.
        """
        if min(self.half_extents) <= 0.0:
            raise ValueError(f"half_extents: got {self.half_extents}, expected positive lengths")

    @classmethod
    def between(cls, low: Vector3, high: Vector3, kind: str) -> Box:
        """Build an axis-aligned box from opposite corners (world, m), rounded to millimetres."""
        corners = [(round(a, 3), round(b, 3)) for a, b in zip(low, high, strict=True)]
        x, y, z = (round((a + b) / 2, 4) for a, b in corners)
        half_x, half_y, half_z = (round((b - a) / 2, 4) for a, b in corners)
        return cls((x, y, z), (half_x, half_y, half_z), 0.0, kind)

    @property
    def upright(self) -> bool:
        """Whether it is turned about the vertical only."""
        return not (self.pitch or self.roll)

    @cached_property
    def R_world_box(self) -> NDArray[np.float64]:  # (3, 3)
        """Rotation from the box's axes to the world's."""
        cy, sy = cos(self.yaw), sin(self.yaw)
        cp, sp = cos(self.pitch), sin(self.pitch)
        cr, sr = cos(self.roll), sin(self.roll)
        about_z = np.array([[cy, -sy, 0.0], [sy, cy, 0.0], [0.0, 0.0, 1.0]])
        about_y = np.array([[cp, 0.0, sp], [0.0, 1.0, 0.0], [-sp, 0.0, cp]])
        about_x = np.array([[1.0, 0.0, 0.0], [0.0, cr, -sr], [0.0, sr, cr]])
        return np.asarray(about_z @ about_y @ about_x)

    @cached_property
    def bounds(self) -> tuple[Vector3, Vector3]:
        """Lower and upper corner of the axis-aligned bounds, m."""
        x, y, z = self.centre
        a, b, c = (np.abs(self.R_world_box) @ self.half_extents).tolist()
        return (x - a, y - b, z - c), (x + a, y + b, z + c)

    @property
    def corners(self) -> NDArray[np.float64]:  # (8, 3)
        """Corners (8, 3), world frame, m, in the order that `BOX_FACES` counts them."""
        signs = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
        return np.asarray(signs * self.half_extents @ self.R_world_box.T + self.centre)

    def distance(self, points: ArrayLike) -> NDArray[np.float64]:
        """Return exact distance (n,) from points (n, 3), world frame, m; 0 inside."""
        own_axes = (np.asarray(points, np.float64) - self.centre) @ self.R_world_box
        outside = np.abs(own_axes) - self.half_extents
        return np.asarray(np.sqrt(np.square(np.maximum(outside, 0.0)).sum(axis=1)))

    def distance_in_plane(self, points: ArrayLike, band: Band) -> NDArray[np.float64]:
        """Return exact distance (n,) from points (n, 2) to the whole footprint, m; see `Solid`."""
        del band
        if not self.upright:
            return distance_to_triangles(points, self.corners[BOX_FACES][:, :, :2])
        offset = np.asarray(points, np.float64) - self.centre[:2]
        c, s = cos(self.yaw), sin(self.yaw)
        along = np.abs(c * offset[:, 0] + s * offset[:, 1]) - self.half_extents[0]
        across = np.abs(c * offset[:, 1] - s * offset[:, 0]) - self.half_extents[1]
        return np.asarray(np.hypot(np.maximum(along, 0.0), np.maximum(across, 0.0)))

    def geom(self, name: str) -> str:
        """Return its MJCF geom."""
        place = f'type="box" pos="{numbers(self.centre)}" size="{numbers(self.half_extents)}"'
        if self.yaw or not self.upright:
            place += f' quat="{self._quaternion()}"'
        return write_geom(name, self.kind, place)

    def _quaternion(self) -> str:
        cy, sy = cos(self.yaw / 2), sin(self.yaw / 2)
        if self.upright:
            return f"{cy:.9f} 0 0 {sy:.9f}"
        cp, sp = cos(self.pitch / 2), sin(self.pitch / 2)
        cr, sr = cos(self.roll / 2), sin(self.roll / 2)
        w, x = cy * cp * cr + sy * sp * sr, cy * cp * sr - sy * sp * cr
        y, z = cy * sp * cr + sy * cp * sr, sy * cp * cr - cy * sp * sr
        return f"{w:.12f} {x:.12f} {y:.12f} {z:.12f}"
