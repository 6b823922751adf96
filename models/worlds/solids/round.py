"""Cylinders, capsules and spheres: round solids by their axis."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from functools import cached_property
from math import sqrt

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
