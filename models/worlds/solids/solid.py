"""Base class of solids, their materials, and the writing of their geoms."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wayproof.models.arrays import Vector3
from wayproof.models.classes import CLASSES

Band = tuple[float, float]

FRICTION = 0.8
"""Coefficient of sliding friction, assumed: rubber on dry concrete."""

DECIMALS = 4
"""Decimals of generated lengths in m: corners are whole millimetres, halves need one more."""


class Solid(ABC):
    """Something solid in the world, immutable.

    Attributes:
        kind: Kind of object, such as `shelf`: a name in `KINDS` or any other.
    """

    kind: str

    @property
    @abstractmethod
    def bounds(self) -> tuple[Vector3, Vector3]:
        """Lower and upper corner of its axis-aligned bounds, world frame, m."""

    @abstractmethod
    def distance(self, points: ArrayLike) -> NDArray[np.float64]:
        """Return exact distance (n,) from points (n, 3), world frame, m; 0 inside."""

    @abstractmethod
    def distance_in_plane(self, points: ArrayLike, band: Band) -> NDArray[np.float64]:
        """Return the distance (n,) from points (n, 2) to the footprint of its part in a band, m.

        Never more than the true one; more parts than those in the band may count.
        """

    @abstractmethod
    def geom(self, name: str) -> str:
        """Return its MJCF geom."""

    def asset(self, name: str) -> str:
        """Return the MJCF asset of its geom; empty without one."""
        del name
        return ""

    @property
    def low(self) -> Vector3:
        """Lower corner of its bounds, m."""
        return self.bounds[0]

    @property
    def high(self) -> Vector3:
        """Upper corner of its bounds, m."""
        return self.bounds[1]

    @property
    def bottom(self) -> float:
        """Height of its lowest point, m."""
        return self.low[2]

    @property
    def top(self) -> float:
        """Height of its highest point, m."""
        return self.high[2]


def write_geom(name: str, kind: str, shape: str) -> str:
    """Write a geom that robots and beams meet, with its class in its user data.

    Args:
        name: Name of the geom.
        kind: Gives colour and class.
        shape: The attributes that say type, size and place.
    """
    return (
        f'    <geom name="{name}" {shape} group="0" contype="1" conaffinity="1" '
        f'friction="{FRICTION} 0.005 0.0001" rgba="{colour_of(kind)}" user="{class_of(kind)}"/>'
    )


def numbers(values: Iterable[float]) -> str:
    """Write lengths to a tenth of a millimetre where that is exact, else with all digits."""
    return " ".join(map(_number, values))


def _number(value: float) -> str:
    if abs(value - round(value, DECIMALS)) < 1e-12:
        return f"{value:.{DECIMALS}f}"
    return f"{value:.12g}"


def least_and_greatest(points: ArrayLike) -> tuple[Vector3, Vector3]:
    """Return corners of the axis-aligned bounds of points (n, 3)."""
    array = np.asarray(points, np.float64)
    x0, y0, z0 = array.min(axis=0).tolist()
    x1, y1, z1 = array.max(axis=0).tolist()
    return (x0, y0, z0), (x1, y1, z1)


class Kind(NamedTuple):
    """One kind of solid.

    Attributes:
        class_name: Name in `CLASSES`; a geom of class `floor` may be stepped on.
        colour: Red, green, blue, opacity; for pictures only.
    """

    class_name: str
    colour: str


KINDS = {
    "floor": Kind("floor", "0.9 0.9 0.9 1"),
    "plank": Kind("floor", "0.80 0.68 0.45 1"),
    "ramp": Kind("floor", "0.72 0.72 0.70 1"),
    "step": Kind("floor", "0.72 0.72 0.70 1"),
    "wall": Kind("wall", "0.75 0.75 0.72 1"),
    "partition": Kind("wall", "0.70 0.72 0.75 1"),
    "lintel": Kind("wall", "0.70 0.72 0.75 1"),
    "pillar": Kind("wall", "0.70 0.72 0.75 1"),
    "shelf": Kind("shelf", "0.30 0.42 0.60 1"),
    "overhang": Kind("structure", "0.85 0.55 0.20 1"),
    "crate": Kind("crate", "0.62 0.47 0.31 1"),
    "furniture": Kind("furniture", "0.55 0.40 0.28 1"),
    "person": Kind("person", "0.80 0.30 0.45 1"),
    "vehicle": Kind("vehicle", "0.95 0.70 0.10 1"),
    "hedge": Kind("vegetation", "0.25 0.40 0.22 1"),
    "trunk": Kind("vegetation", "0.40 0.30 0.20 1"),
    "branch": Kind("vegetation", "0.36 0.45 0.22 1"),
    "pole": Kind("structure", "0.45 0.47 0.50 1"),
    "bar": Kind("structure", "0.70 0.35 0.20 1"),
    "structure": Kind("structure", "0.55 0.57 0.60 1"),
    "barrier": Kind("structure", "0.90 0.35 0.15 1"),
    "door": Kind("door", "0.50 0.33 0.22 1"),
    "ghost": Kind("unknown", "0.60 0.55 0.80 1"),
}
"""Materials by the kind of solid; any other kind is allowed and of unknown class."""

UNKNOWN = Kind("unknown", "0.6 0.6 0.6 1")


def colour_of(kind: str) -> str:
    """Return the colour of a kind, as MJCF writes it."""
    return KINDS.get(kind, UNKNOWN).colour


def class_of(kind: str) -> int:
    """Return the index of a kind's class in `CLASSES`; a class's own name is a kind too."""
    name = kind if kind in CLASSES else KINDS.get(kind, UNKNOWN).class_name
    return CLASSES.index(name)
