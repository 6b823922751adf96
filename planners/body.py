"""Collision shape of a body: a ball, or several discs or balls along its x axis."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

from wayproof.maps import collision_distance_sq


class Disc(NamedTuple):
    """A disc (in the plane) or ball (in space) of a body, as a distance field sees it."""

    offset: float  # of its centre along the body's x axis, m
    collision_distance_sq: int  # largest squared cell distance that its centre may not have


@dataclass(frozen=True)
class Body:
    """Discs or balls along the body's x axis.

    A body that is longer than wide fits through gaps that its circumscribed disc does not.

    Attributes:
        offsets: Positions of their centres along the body's x axis, from the reference point, m.
        radii: Radii, m.

    Raises:
        ValueError: If there is none, their numbers differ, or a radius is not above 0.
    """

    offsets: tuple[float, ...]
    radii: tuple[float, ...]

    def __post_init__(self) -> None:
        if not self.radii or len(self.radii) != len(self.offsets):
            got = f"{len(self.offsets)} offsets and {len(self.radii)} radii"
            raise ValueError(f"body: got {got}, expected as many of both, one or more")
        for name, values, least in (("offsets", self.offsets, -math.inf), ("radii", self.radii, 0)):
            if not all(least < value < math.inf for value in values):
                raise ValueError(f"body.{name}: got {values}, expected above {least}, finite")

    @property
    def circumscribed_radius(self) -> float:
        """Radius of the disc about the reference point that holds the body at any heading, m."""
        return max(abs(o) + r for o, r in zip(self.offsets, self.radii, strict=True))

    def discs(self, margin: float, resolution: float, flat: bool) -> tuple[Disc, ...]:
        """Return the discs with their collision distances.

        Args:
            margin: Localization margin, m.
            resolution: Cell size, m.
            flat: Whether the cells are those of a plane.
        """
        return tuple(
            Disc(offset, collision_distance_sq(radius + margin, resolution, flat))
            for offset, radius in zip(self.offsets, self.radii, strict=True)
        )
