"""A building site: scaffolds of thin tubes, holes in the floor, planks, a ramp and stairs."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from math import pi

import numpy as np

from wayproof.models.arrays import Vector3
from wayproof.models.world_parameters import WorldParameters
from wayproof.models.worlds.generator import generated
from wayproof.models.worlds.layout import (
    FEW_PLACEMENTS,
    LOW,
    Group,
    Point,
    Rectangle,
    between,
    opposite_ends,
    room,
    slabs_around,
    with_groups,
)
from wayproof.models.worlds.solids import Box, Capsule, Cylinder, TriangleMesh
from wayproof.models.worlds.world import World

SIZE = (17.0, 12.0)
END_DISTANCE = 1.4
"""Distance of start and goal from the outside of the fence, m."""

TUBE_RADIUS = 0.03
"""Radius of a scaffold's tube, m: 48.3 mm tubes with their couplers."""

DECK_HEIGHT = 1.9
"""Height of a scaffold's deck, m: a drone of the lower band and a quadruped pass below."""

PIECE_COUNTS = (4, 18)
"""Number of pieces at difficulty 0 and 1; those that would close a way are left out."""

STEP_HEIGHT = 0.03
"""Rise of a stair and thickness of a plank, m: a quadruped steps over it."""


@generated
def construction(rng: np.random.Generator, difficulty: float, parameters: WorldParameters) -> World:
    """Draw a site of 17 x 12 m, start and goal at its two ends.

    Difficulty adds pieces. Holes have barriers about them up to a difficulty of 0.5; beyond, more
    and more of them lie open, visible only as missing floor.
    """
    ends = opposite_ends(rng, SIZE, inset=END_DISTANCE, side_inset=END_DISTANCE)
    holes = _holes(rng, ends)
    unguarded = 2.0 * difficulty - 1.0
    guards = [bar for hole in holes if rng.uniform() >= unguarded for bar in _barrier(hole)]
    fence = room(rng, SIZE, ends, guards, "barrier")
    site = replace(fence, floor=slabs_around(SIZE, holes))
    count = round(between(PIECE_COUNTS, difficulty))

    def pieces() -> Iterator[Iterator[Group]]:
        for number in range(count):
            make = MAKERS[number % len(MAKERS)]
            yield (make(rng, *_anywhere(rng, holes)) for _ in range(FEW_PLACEMENTS))

    return with_groups(site, pieces(), parameters.passage_radius)


def _holes(rng: np.random.Generator, ends: tuple[Point, Point]) -> list[Rectangle]:
    """Draw holes, one to three, well apart from one another, the fence and both ends."""
    holes: list[Rectangle] = []
    count = int(rng.integers(1, 4))
    for _ in range(5 * FEW_PLACEMENTS):
        size = rng.uniform(0.8, 1.8, 2)
        low = rng.uniform(np.add(LOW[:2], 2.2), np.subtract(SIZE, 2.2) - size)
        corners = np.round([low, low + size], 2)
        apart = [_gap(corners, np.array(hole)) for hole in holes]
        apart += [_gap(corners, np.array([end, end])) for end in ends]
        if min(apart) >= 2.0:
            (x0, y0), (x1, y1) = corners.tolist()
            holes.append(((x0, y0), (x1, y1)))
        if len(holes) == count:
            break
    return holes


def _gap(a: np.ndarray, b: np.ndarray) -> float:
    """Return the distance between two rectangles (2, 2), m."""
    return float(np.hypot(*np.maximum(np.maximum(a[0] - b[1], b[0] - a[1]), 0.0)))


def _barrier(hole: Rectangle) -> Group:
    """Return posts at the corners of a hole and two rails on each side."""
    (x0, y0), (x1, y1) = hole
    corners = [(round(x, 3), round(y, 3)) for x, y in ((x0, y0), (x1, y0), (x1, y1), (x0, y1))]
    posts = [Cylinder((*at, 0.0), (*at, 1.0), TUBE_RADIUS, "barrier") for at in corners]
    rails = [
        Capsule((*tail, height), (*head, height), 0.02, "barrier")
        for tail, head in zip(corners, corners[1:] + corners[:1], strict=True)
        for height in (0.25, 0.9)
    ]
    return (*posts, *rails)


def _anywhere(rng: np.random.Generator, holes: list[Rectangle]) -> Point:
    """Draw a place not within a metre of a hole."""
    while True:
        place = rng.uniform(LOW[:2], SIZE)
        if all(_gap(np.array([place, place]), np.array(hole)) > 1.0 for hole in holes):
            return round(float(place[0]), 3), round(float(place[1]), 3)


def _scaffold(rng: np.random.Generator, x: float, y: float) -> Group:
    """Put up two bays of tubes under a deck; one end braced, the others open to a low body."""
    along_x = bool(rng.integers(2))
    length, width = 2.2, 1.2

    def at(along: float, across: float, z: float) -> Vector3:
        a, b = (along, across) if along_x else (across, along)
        return round(x + a, 3), round(y + b, 3), z

    posts = [
        Cylinder(at(i, j, 0.0), at(i, j, 2.9), TUBE_RADIUS, "pole")
        for i in (-length, 0.0, length)
        for j in (-width / 2, width / 2)
    ]
    ledgers = [
        Capsule(at(-length, j, z), at(length, j, z), TUBE_RADIUS, "bar")
        for j in (-width / 2, width / 2)
        for z in (DECK_HEIGHT - 0.1, 2.8)
    ]
    brace = Capsule(
        at(-length, -width / 2, 0.1), at(0.0, -width / 2, DECK_HEIGHT - 0.1), 0.02, "bar"
    )
    low, high = sorted(
        (at(-length, -width / 2, DECK_HEIGHT), at(length, width / 2, DECK_HEIGHT + 0.05))
    )
    return (*posts, *ledgers, brace, Box.between(low, high, "structure"))


def _ramp(rng: np.random.Generator, x: float, y: float) -> Group:
    """Return a wedge 0.3 m high that leans on a platform."""
    width, length, height = 1.0, 1.5, 0.3
    profile = [(x, 0.0), (x + length, 0.0), (x + length, height)]
    vertices = [
        (round(a, 3), round(b, 3), z) for b in (y - width / 2, y + width / 2) for a, z in profile
    ]
    faces = ((0, 1, 2), (3, 5, 4), (0, 4, 1), (0, 3, 4), (1, 5, 2), (1, 4, 5), (0, 2, 5), (0, 5, 3))
    platform = Box.between(
        (x + length, y - width / 2, 0.0), (x + length + width, y + width / 2, height), "structure"
    )
    return TriangleMesh(tuple(vertices), faces, "ramp"), platform


def _stairs(rng: np.random.Generator, x: float, y: float) -> Group:
    """Return five steps, each as high as a quadruped steps over."""
    return tuple(
        Box.between((x + 0.3 * i, y - 0.5, z), (x + 1.5, y + 0.5, z + STEP_HEIGHT), "step")
        for i, z in ((i, i * STEP_HEIGHT) for i in range(5))
    )


def _plank(rng: np.random.Generator, x: float, y: float) -> Group:
    """Return a plank on the floor, to be walked over."""
    half = (round(rng.uniform(0.6, 1.2), 3), 0.1, 0.0125)
    return (Box((x, y, 0.0125), half, round(rng.uniform(0.0, pi), 3), "plank"),)


def _stack(rng: np.random.Generator, x: float, y: float) -> Group:
    """Return a stack of building material."""
    half = np.round(rng.uniform((0.3, 0.3, 0.2), (0.6, 0.4, 0.6)), 3).tolist()
    return (Box((x, y, half[2]), (half[0], half[1], half[2]), 0.0, "crate"),)


def _bars(rng: np.random.Generator, x: float, y: float) -> Group:
    """Return a trestle: a thin bar that lies at chest height across two legs."""
    length = round(rng.uniform(0.6, 1.0), 3)
    height = round(rng.uniform(0.3, 0.9), 3)
    left, right = round(x - length, 3), round(x + length, 3)
    legs = [
        Capsule((end, round(y + side, 3), 0.02), (end, y, height), 0.02, "bar")
        for end in (left, right)
        for side in (-0.25, 0.25)
    ]
    top = Capsule((left, y, height), (right, y, height), 0.02, "bar")
    return (*legs, top)


MAKERS: tuple[Callable[[np.random.Generator, float, float], Group], ...] = (
    _scaffold,
    _plank,
    _stack,
    _bars,
    _ramp,
    _stairs,
)
