"""What worlds are laid out with: outer walls, crates that seal nothing, a heading, a mirror."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import atan2, pi

import numpy as np

from models.worlds.solids import Box, Solid, Vector3
from models.worlds.solvability import (
    GROUND_BAND,
    REFERENCE_RADIUS,
    cell_of,
    clear_around,
    free_cells,
    label_regions,
)
from models.worlds.world import World

WALL_HEIGHT = 3.0
WALL_THICKNESS = 0.2
LOW_HEIGHT = 0.05
"""A crate of this height is stepped over by a quadruped, m."""

LOW_SHARE, TALL_SHARE = 0.25, 0.25
END_CLEARANCE = 0.95
"""No crate comes nearer to start or goal, m."""

REACHABLE_SHARE = 0.95
"""Crates leave at least this share of the passable floor in one piece with the start."""

ALL_HEIGHTS = (-100.0, 100.0)
"""A band that holds everything, m."""

PLACEMENTS = 200
"""Places tried for one crate."""


def room_walls(low: Vector3, high: Vector3) -> tuple[Box, ...]:
    """Four walls just inside a rectangle, from the floor to 3 m."""
    (x0, y0, _), (x1, y1, _) = low, high
    t, h = WALL_THICKNESS, WALL_HEIGHT
    return (
        Box.between((x0, y0, 0.0), (x0 + t, y1, h), "wall"),
        Box.between((x1 - t, y0, 0.0), (x1, y1, h), "wall"),
        Box.between((x0 + t, y0, 0.0), (x1 - t, y0 + t, h), "wall"),
        Box.between((x0 + t, y1 - t, 0.0), (x1 - t, y1, h), "wall"),
    )


def heading_towards(
    rng: np.random.Generator, start: Sequence[float], goal: Sequence[float]
) -> float:
    """The bearing of the goal, up to half a radian off, rad."""
    bearing = atan2(goal[1] - start[1], goal[0] - start[0])
    return round(bearing + rng.uniform(-0.5, 0.5), 3)


def mirrored(world: World, flip_x: bool, flip_y: bool) -> World:
    """A world of upright boxes seen in a mirror across x, y, both or neither, in its outline."""

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
    )


def with_crates(rng: np.random.Generator, world: World, count: int, longest: float) -> World:
    """Scatter up to `count` crates over the floor without closing any way through.

    Args:
        rng: Draws sizes and places.
        world: To be furnished.
        count: Crates to add; one that fits nowhere is left out.
        longest: Longest side of a crate, m.
    """
    free = free_cells(world, REFERENCE_RADIUS, GROUND_BAND)
    start = cell_of(world, world.start)
    for _ in range(count):
        size = _crate_size(rng, longest)
        for _ in range(PLACEMENTS):
            crate = _crate(rng, world, size)
            if not _fits(world, crate):
                continue
            still_free = free.copy()
            if crate.top > GROUND_BAND[0]:
                clear_around(still_free, world, crate, REFERENCE_RADIUS)
            labels = label_regions(still_free)
            reachable = np.count_nonzero(labels == labels[start])
            if labels[start] and reachable >= REACHABLE_SHARE * np.count_nonzero(still_free):
                free, world = still_free, replace(world, solids=(*world.solids, crate))
                break
    return world


def _crate_size(rng: np.random.Generator, longest: float) -> Vector3:
    """Length, width, height, m: a quarter of them low, a quarter tall."""
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


def _fits(world: World, crate: Box) -> bool:
    """Whether a crate stands free of every solid and of start and goal."""
    if (
        crate.distance_in_plane([world.start[:2], world.goal[:2]], ALL_HEIGHTS).min()
        < END_CLEARANCE
    ):
        return False
    size = float(np.hypot(*crate.half_extents[:2]))
    centre = [crate.centre[:2]]
    return all(
        solid.bottom >= crate.top or solid.distance_in_plane(centre, ALL_HEIGHTS)[0] > size
        for solid in world.solids
    )
