"""Building blocks of layouts: outer walls, crates that block no way, headings, mirroring."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from itertools import pairwise
from math import atan2, pi
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from wayproof.models.arrays import Vector3
from wayproof.models.worlds.solids import Box, Capsule, Cylinder, Solid
from wayproof.models.worlds.solvability import (
    GROUND_BAND,
    REFERENCE_RADIUS,
    TIGHTEST_RADIUS,
    cell_of,
    clear_around,
    free_cells,
    is_solvable,
    label_regions,
)
from wayproof.models.worlds.world import World

WALL_HEIGHT = 3.0
WALL_THICKNESS = 0.2
LOW_HEIGHT = 0.05
"""Height of a crate that a quadruped steps over, m."""

LOW_SHARE, TALL_SHARE = 0.25, 0.25
END_CLEARANCE = 0.95
"""Minimum distance of crates from start and goal, m."""

REACHABLE_SHARE = 0.95
"""Minimum share of the passable floor that crates leave connected with the start."""

LOW: Vector3 = (0.0, 0.0, -0.5)
"""Lower corner of the operating area of a generated world, m."""

CEILING = 3.0
"""Top of it, m."""

FLOOR_THICKNESS = 0.3
"""Thickness of a floor of slabs, m."""

Group = tuple[Solid, ...]
Given = TypeVar("Given", int, float)
Point = tuple[float, float]
Rectangle = tuple[Point, Point]

ALL_HEIGHTS = (-100.0, 100.0)
"""Height band that holds everything, m."""

COVER_SPACING = 0.15
"""Half the distance between the circles that cover a long bar, m."""

PLACEMENTS = 200
"""Number of places tried for one crate."""

FEW_PLACEMENTS = 30
"""Number of places tried for one of many things."""


def opposite_ends(
    rng: np.random.Generator, size: Point, inset: float, side_inset: float
) -> tuple[Point, Point]:
    """Draw start and goal, `inset` from either end of an area along x, `side_inset` from its sides.

    Lengths in m.
    """
    start, goal = (
        (x, round(rng.uniform(LOW[1] + side_inset, size[1] - side_inset), 3))
        for x in (inset, size[0] - inset)
    )
    return start, goal


def room(
    rng: np.random.Generator,
    size: Point,
    ends: tuple[Point, Point],
    solids: Iterable[Solid] = (),
    kind: str = "wall",
) -> World:
    """Return a walled area with start, goal and solids; `generated` gives it name and seed.

    Args:
        rng: Draws the heading at the start.
        size: Length along x and width, outside of the walls, m.
        ends: Start and goal, m.
        solids: All that stands between the walls.
        kind: Kind of the walls.
    """
    high, (start, goal) = (*size, CEILING), ends
    return World(
        name="",
        seed=0,
        low=LOW,
        high=high,
        solids=(*room_walls(LOW, high, kind), *solids),
        start=(*start, 0.0),
        start_heading=heading_towards(rng, start, goal),
        goal=(*goal, 0.0),
    )


def room_walls(low: Vector3, high: Vector3, kind: str = "wall") -> tuple[Box, ...]:
    """Return four walls just inside a rectangle, from the floor to 3 m; or a hedge, or a fence."""
    (x0, y0, _), (x1, y1, _) = low, high
    t, h = WALL_THICKNESS, WALL_HEIGHT
    return (
        Box.between((x0, y0, 0.0), (x0 + t, y1, h), kind),
        Box.between((x1 - t, y0, 0.0), (x1, y1, h), kind),
        Box.between((x0 + t, y0, 0.0), (x1 - t, y0 + t, h), kind),
        Box.between((x0 + t, y1 - t, 0.0), (x1 - t, y1, h), kind),
    )


def heading_towards(rng: np.random.Generator, start: Point, goal: Point) -> float:
    """Draw a heading within half a radian of the goal's bearing, rad."""
    bearing = atan2(goal[1] - start[1], goal[0] - start[0])
    return round(bearing + rng.uniform(-0.5, 0.5), 3)


def mirrored(rng: np.random.Generator, world: World) -> World:
    """Mirror a world of upright boxes across x, y, both or neither, within its outline."""
    flip_x, flip_y = bool(rng.integers(2)), bool(rng.integers(2))

    def place(point: Vector3) -> Vector3:
        x, y, z = point
        x = round(world.low[0] + world.high[0] - x, 4) if flip_x else x
        y = round(world.low[1] + world.high[1] - y, 4) if flip_y else y
        return x, y, z

    def solid_in_mirror(solid: Solid) -> Solid:
        if not (isinstance(solid, Box) and solid.upright):
            raise TypeError(f"mirrored: got {solid}, expected upright boxes")
        yaw = round(pi - solid.yaw, 3) if solid.yaw and flip_x != flip_y else solid.yaw
        return replace(solid, centre=place(solid.centre), yaw=yaw)

    heading = pi - world.start_heading if flip_x else world.start_heading
    return replace(
        world,
        solids=tuple(map(solid_in_mirror, world.solids)),
        start=place(world.start),
        start_heading=round(-heading if flip_y else heading, 3),
        goal=place(world.goal),
        aisle=tuple(map(place, world.aisle)),
    )


def between(limits: tuple[float, float], difficulty: float) -> float:
    """Return the value at a difficulty, given those at 0 and at 1."""
    return limits[0] + difficulty * (limits[1] - limits[0])


def given_or(value: Given | None, otherwise: Given) -> Given:
    """Return a parameter; where it is None, a value drawn or set by the difficulty."""
    return otherwise if value is None else value


def points_apart(
    rng: np.random.Generator, low: NDArray[np.float64], high: NDArray[np.float64], least: float
) -> tuple[Point, Point]:
    """Draw two points of the plane until they are far enough apart, rounded to 1 mm.

    Args:
        rng: Draws them.
        low: (2,) least x and y, m.
        high: (2,) greatest, m; the diagonal between both is longer than `least`.
        least: Least distance, m.
    """
    while True:
        (x, y), (u, v) = np.round(rng.uniform(low, high, (2, 2)), 3).tolist()
        if np.hypot(u - x, v - y) >= least:
            return (x, y), (u, v)


def with_crates(
    rng: np.random.Generator,
    world: World,
    count: int,
    longest: float,
    radius: float | None = None,
) -> World:
    """Scatter up to `count` crates over the floor without closing any way through.

    Args:
        rng: Draws sizes and places.
        world: World to be furnished.
        count: Crates to add; one that fits nowhere is left out.
        longest: Longest side of a crate, m.
        radius: As for `with_groups`.
    """

    def crates() -> Iterator[Iterator[Group]]:
        for _ in range(count):
            size = _crate_size(rng, longest)
            yield ((_crate(rng, world, size),) for _ in range(PLACEMENTS))

    return with_groups(world, crates(), radius)


def with_groups(
    world: World, choices: Iterable[Iterable[Group]], radius: float | None = None
) -> World:
    """Add groups of solids that stand free of all else and close no way through.

    Args:
        world: World to be furnished.
        choices: For each group, itself in one place after another: the first that fits is taken,
            and none if none does.
        radius: Radius of the disc whose ways stay open, m; by default `REFERENCE_RADIUS`.

    Returns:
        The world as it was if the goal cannot be reached in it at all: no such draft is kept, and
        furnishing it takes seconds.
    """
    least = given_or(radius, TIGHTEST_RADIUS)
    if not is_solvable(world, least, GROUND_BAND, world.start, world.goal):
        return world
    radius = given_or(radius, REFERENCE_RADIUS)
    free = free_cells(world, radius, GROUND_BAND)
    start = cell_of(world, world.start)
    crowd = _Crowd(world)
    for places in choices:
        for group in places:
            if not all(map(crowd.leaves_room_for, group)):
                continue
            still_free = free.copy()
            for solid in group:
                if solid.top > GROUND_BAND[0] and solid.bottom < GROUND_BAND[1]:
                    clear_around(still_free, world, solid, radius)
            labels = label_regions(still_free)
            reachable = np.count_nonzero(labels == labels[start])
            if labels[start] and reachable >= REACHABLE_SHARE * np.count_nonzero(still_free):
                free, world = still_free, replace(world, solids=(*world.solids, *group))
                crowd = _Crowd(world)
                break
    return world


def _crate_size(rng: np.random.Generator, longest: float) -> Vector3:
    """Draw length, width, height, m: a quarter of them low, a quarter tall."""
    length, width = rng.uniform(0.3, longest, 2)
    kind = rng.uniform()
    height = rng.uniform(0.3, 0.8)
    if kind < LOW_SHARE:
        height = LOW_HEIGHT
    elif kind > 1.0 - TALL_SHARE:
        height = rng.uniform(0.9, 1.6)
    return float(length), float(width), float(height)


def _crate(rng: np.random.Generator, world: World, size: Vector3) -> Box:
    x = rng.uniform(world.low[0], world.high[0])
    y = rng.uniform(world.low[1], world.high[1])
    upright = Box.between((0.0, 0.0, 0.0), size, "crate")
    centre = (round(x, 3), round(y, 3), upright.centre[2])
    return replace(upright, centre=centre, yaw=round(rng.uniform(0.0, pi), 3))


class _Crowd:
    """The solids that are there already, with their bounds as arrays."""

    def __init__(self, world: World) -> None:
        self._solids = world.solids
        self._ends = [world.start[:2], world.goal[:2]]
        self._low = np.array([solid.low for solid in world.solids])  # (n, 3)
        self._high = np.array([solid.high for solid in world.solids])

    def leaves_room_for(self, solid: Solid) -> bool:
        """Return whether a solid stands clear of every other and of start and goal."""
        if solid.distance_in_plane(self._ends, ALL_HEIGHTS).min() < END_CLEARANCE:
            return False
        points, size = _cover(solid)
        low, high = self._low[:, None, :2] - points, points - self._high[:, None, :2]
        gap = np.linalg.norm(np.maximum(np.maximum(low, high), 0.0), axis=2).min(axis=1)
        level = (self._low[:, 2] < solid.top) & (self._high[:, 2] > solid.bottom)
        near = np.flatnonzero(level & (gap <= size))  # by their bounds; now by themselves
        return all(
            self._solids[other].distance_in_plane(points, ALL_HEIGHTS).min() > size
            for other in near
        )


def _cover(solid: Solid) -> tuple[NDArray[np.float64], float]:
    """Return centres (k, 2) and the radius of circles that together cover a footprint, m."""
    if isinstance(solid, Cylinder | Capsule):
        axis = np.array([solid.tail[:2], solid.head[:2]])
        count = int(np.linalg.norm(axis[1] - axis[0]) / (2 * COVER_SPACING)) + 1
        shares = (np.arange(count)[:, None] + 0.5) / count
        return axis[0] + shares * (axis[1] - axis[0]), solid.radius + COVER_SPACING
    if isinstance(solid, Box) and solid.upright:
        return np.array([solid.centre[:2]]), float(np.hypot(*solid.half_extents[:2]))
    low, high = np.array(solid.low[:2]), np.array(solid.high[:2])
    return (low + high)[None] / 2, float(np.hypot(*(high - low))) / 2


def slabs_around(size: Point, holes: Sequence[Rectangle]) -> tuple[Box, ...]:
    """Return a floor 0.3 m thick with rectangular holes that do not overlap.

    Args:
        size: Length along x and width of the floor, whose surface is at 0, m.
        holes: Lower and upper corner of each, m, to millimetres.
    """
    cuts = sorted({LOW[0], size[0], *(x for (x0, _), (x1, _) in holes for x in (x0, x1))})
    slabs = []
    for x0, x1 in pairwise(cuts):
        missing = sorted((a[1], b[1]) for a, b in holes if a[0] <= x0 and x1 <= b[0])
        edges = [LOW[1], *(y for hole in missing for y in hole), size[1]]
        for y0, y1 in zip(edges[::2], edges[1::2], strict=True):
            slabs.append(Box.between((x0, y0, -FLOOR_THICKNESS), (x1, y1, 0.0), "floor"))
    return tuple(slabs)
