"""Boxes in any attitude, and cylinders, capsules and spheres."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from functools import cached_property
from math import cos, sin, sqrt

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wayproof.models.arrays import Vector3
from wayproof.models.worlds.solids.solid import (
    Band,
    Solid,
    least_and_greatest,
    numbers,
    write_geom,
)
from wayproof.models.worlds.solids.surfaces import BOX_FACES, distance_to_triangles


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


@dataclass(frozen=True)
class _AboutAxis(Solid):
    """Common base of cylinders and capsules.

    Attributes:
        tail: One end of the axis, world frame, m.
        head: The other end, m.
        radius: m.
        kind: Kind of thing, such as `pillar`.
    """

    tail: Vector3
    head: Vector3
    radius: float
    kind: str

    def __post_init__(self) -> None:
        """Refuse a solid without length or width.

        Raises:
            ValueError: The radius is not positive, or both ends of the axis are one.
        """
        _check_radius(self.radius)
        if self.tail == self.head:
            raise ValueError(f"head: got {self.head}, the same as tail, expected another end")

    def _split(self, points: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return distances of points (n, 3) beyond the axis's ends and away from its line, m."""
        axis = np.subtract(self.head, self.tail)
        length = float(np.linalg.norm(axis))
        offset = np.asarray(points, np.float64) - self.tail
        along = offset @ (axis / length)  # (n,)
        beyond = np.maximum(np.maximum(-along, along - length), 0.0)
        across = np.linalg.norm(np.cross(offset, axis / length), axis=1)
        return beyond, across

    def distance_in_plane(self, points: ArrayLike, band: Band) -> NDArray[np.float64]:
        """Return the distance (n,) from points (n, 2) to the stadium about the part in the band, m.

        See `Solid`; exact for a capsule within the band and for an upright cylinder.
        """
        tail, head = (np.asarray(end) for end in self._cut(band))
        axis = head[:2] - tail[:2]
        offset = np.asarray(points, np.float64) - tail[:2]
        share = np.clip(offset @ axis / max(float(axis @ axis), 1e-300), 0.0, 1.0)
        gap = np.linalg.norm(offset - share[:, None] * axis, axis=1) - self.radius
        return np.asarray(np.maximum(gap, 0.0))

    def _cut(self, band: Band) -> tuple[Vector3, Vector3]:
        """Return the part of the axis within a radius of the band; some part if none is."""
        rise = self.head[2] - self.tail[2]
        if rise == 0.0:
            return self.tail, self.head
        limits = [(z - self.tail[2]) / rise for z in (band[0] - self.radius, band[1] + self.radius)]
        first, last = np.clip(sorted(limits), 0.0, 1.0).tolist()
        x0, y0, z0 = (np.add(self.tail, first * np.subtract(self.head, self.tail))).tolist()
        x1, y1, z1 = (np.add(self.tail, last * np.subtract(self.head, self.tail))).tolist()
        return (x0, y0, z0), (x1, y1, z1)

    @cached_property
    def bounds(self) -> tuple[Vector3, Vector3]:
        """Lower and upper corner of the axis-aligned bounds, m."""
        ends, rim = np.array([self.tail, self.head]), self._rim()
        return least_and_greatest(ends - rim)[0], least_and_greatest(ends + rim)[1]

    @abstractmethod
    def _rim(self) -> NDArray[np.float64]:  # (3,)
        """Return how far an end reaches from its middle along each world axis, m."""

    def geom(self, name: str) -> str:
        """Return its MJCF geom."""
        ends = f"{numbers(self.tail)} {numbers(self.head)}"
        place = f'fromto="{ends}" size="{numbers([self.radius])}"'
        return write_geom(name, self.kind, f'type="{type(self).__name__.lower()}" {place}')


@dataclass(frozen=True)
class Cylinder(_AboutAxis):
    """A cylinder with flat ends, its axis from `tail` to `head`."""

    def distance(self, points: ArrayLike) -> NDArray[np.float64]:
        """Return exact distance (n,) from points (n, 3), world frame, m; 0 inside."""
        beyond, across = self._split(points)
        return np.asarray(np.hypot(beyond, np.maximum(across - self.radius, 0.0)))

    def _rim(self) -> NDArray[np.float64]:  # (3,)
        axis = np.subtract(self.head, self.tail)
        cosine = axis / np.linalg.norm(axis)
        return np.asarray(self.radius * np.sqrt(np.maximum(1.0 - cosine**2, 0.0)))


@dataclass(frozen=True)
class Capsule(_AboutAxis):
    """All points within `radius` of the line from `tail` to `head`."""

    def distance(self, points: ArrayLike) -> NDArray[np.float64]:
        """Return exact distance (n,) from points (n, 3), world frame, m; 0 inside."""
        return np.asarray(np.maximum(np.hypot(*self._split(points)) - self.radius, 0.0))

    def _rim(self) -> NDArray[np.float64]:  # (3,)
        return np.full(3, self.radius)


@dataclass(frozen=True)
class Sphere(Solid):
    """A ball.

    Attributes:
        centre: World frame, m.
        radius: m.
        kind: Kind of thing, such as `pillar`.
    """

    centre: Vector3
    radius: float
    kind: str

    def __post_init__(self) -> None:
        """Refuse a solid without length or width."""
        _check_radius(self.radius)

    @cached_property
    def bounds(self) -> tuple[Vector3, Vector3]:
        """Lower and upper corner of the axis-aligned bounds, m."""
        (x, y, z), r = self.centre, self.radius
        return (x - r, y - r, z - r), (x + r, y + r, z + r)

    def distance(self, points: ArrayLike) -> NDArray[np.float64]:
        """Return exact distance (n,) from points (n, 3), world frame, m; 0 inside."""
        gap = np.linalg.norm(np.asarray(points, np.float64) - self.centre, axis=1) - self.radius
        return np.asarray(np.maximum(gap, 0.0))

    def distance_in_plane(self, points: ArrayLike, band: Band) -> NDArray[np.float64]:
        """Return exact distance (n,) from points (n, 2) to the part in the band, m; see `Solid`."""
        height = min(max(self.centre[2], band[0]), band[1]) - self.centre[2]
        radius = sqrt(max(self.radius**2 - height**2, 0.0))
        gap = np.linalg.norm(np.asarray(points, np.float64) - self.centre[:2], axis=1) - radius
        return np.asarray(np.maximum(gap, 0.0))

    def geom(self, name: str) -> str:
        """Return its MJCF geom."""
        place = f'type="sphere" pos="{numbers(self.centre)}" size="{numbers([self.radius])}"'
        return write_geom(name, self.kind, place)


def _check_radius(radius: float) -> None:
    if not radius > 0.0:
        raise ValueError(f"radius: got {radius}, expected a positive length")
