"""Places along the aisle of a world, for missions that inspect it."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wayproof.models.arrays import Vector3
from wayproof.models.worlds.solvability import (
    AIR_BANDS,
    GROUND_BAND,
    RESOLUTION,
    cell_of,
    free_cells,
    label_regions,
    passage_radius,
)
from wayproof.models.worlds.world import World

INSET = 1.2
"""Distance of the outer places from the ends of the aisle, m."""

MAX_SHIFT = 2.0
"""Greatest distance of a place from that in the aisle, where something stands there, m."""

Place = tuple[float, float]


def inspected(ends: tuple[Place, Place]) -> tuple[Vector3, ...]:
    """Return both ends of a centre line, `INSET` inside it, and its middle; on the floor, m."""
    (x0, y0), (x1, y1) = ends
    share = INSET / float(np.hypot(x1 - x0, y1 - y0))
    shares = (share, 0.5, 1.0 - share)
    return tuple((x0 + s * (x1 - x0), y0 + s * (y1 - y0), 0.0) for s in shares)


def widest_gap(rows: list[tuple[float, float]]) -> tuple[float, float] | None:
    """Return the widest gap between neighbouring rows (low, high), the first of several."""
    gaps = [(near[1], far[0]) for near, far in pairwise(rows)]
    return max(gaps, key=lambda gap: gap[1] - gap[0], default=None)


def aisle_places(world: World, start: ArrayLike) -> tuple[Place, ...]:
    """Return the places along a world's aisle at which a body can stand, the nearer end first.

    Each is the nearest place to that of the world which a body can reach from the world's start,
    and at which one can hover as well.

    Args:
        world: Truth.
        start: (>= 2,) where the inspection begins, m.

    Raises:
        ValueError: The world has no aisle, or something stands in it.
    """
    if not world.aisle:
        raise ValueError(f"aisle: world '{world.name}' has none")
    standing = _standing(world)
    places = [_nearest(world, standing, place) for place in world.aisle]
    x, y = np.ravel(np.asarray(start, np.float64))[:2]
    far = [float(np.hypot(place[0] - x, place[1] - y)) for place in (places[0], places[-1])]
    return tuple(places if far[0] <= far[1] else reversed(places))


def _standing(world: World) -> NDArray[np.bool_]:  # (nx, ny)
    """Return the cells that a body on the ground reaches, and in which one can hover."""
    radius = world.passage_radius or passage_radius(world.difficulty)
    labels = label_regions(free_cells(world, radius, GROUND_BAND))
    reached = labels == labels[cell_of(world, world.start)]
    return np.asarray(reached & (labels > 0) & free_cells(world, radius, AIR_BANDS[0]))


def _nearest(world: World, standing: NDArray[np.bool_], place: Vector3) -> Place:
    """Return a place itself where one can stand, else the centre of the nearest such cell."""
    if standing[cell_of(world, place)]:
        return round(place[0], 3), round(place[1], 3)
    cells = np.argwhere(standing)  # (n, 2)
    centres = np.asarray(world.low[:2]) + (cells + 0.5) * RESOLUTION
    distances = np.square(centres - np.asarray(place[:2])).sum(axis=1)
    if not len(cells) or distances.min() > MAX_SHIFT**2:
        raise ValueError(
            f"aisle: no place within {MAX_SHIFT:g} m of ({place[0]:.2f}, {place[1]:.2f}) in world "
            f"'{world.name}' of seed {world.seed} can be reached"
        )
    x, y = centres[int(np.argmin(distances))].tolist()
    return round(x, 3), round(y, 3)
