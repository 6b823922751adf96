"""A floor of offices: rooms off a hallway, open doors, tables and chairs on thin legs."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise
from math import cos, pi, sin

import numpy as np

from wayproof.models.world_parameters import WorldParameters
from wayproof.models.worlds.aisle import inspected
from wayproof.models.worlds.generator import generated
from wayproof.models.worlds.layout import (
    FEW_PLACEMENTS,
    LOW,
    WALL_HEIGHT,
    WALL_THICKNESS,
    Group,
    Point,
    between,
    room,
    with_groups,
)
from wayproof.models.worlds.solids import Box, Cylinder
from wayproof.models.worlds.world import World

SIZE = (16.0, 12.4)
ROOMS = 3
"""Number of rooms on either side of the hallway."""

HALLWAY = (2.4, 2.0)
DOOR_WIDTHS = (1.9, 1.6)
"""Width of doors at difficulty 0 and 1, m."""

DOOR_HEIGHT = 2.2
THICKNESS = 0.12
FURNITURE_COUNTS = (4, 20)
"""Number of pieces at difficulty 0 and 1; those that would close a way are left out."""

END_DISTANCE = 1.3
"""Distance of start and goal from the walls of their room, m."""

TABLE_LEG_RADIUS = 0.025
"""Radius of a table's leg, m."""


@generated
def office(rng: np.random.Generator, difficulty: float, parameters: WorldParameters) -> World:
    """Draw six rooms of 16 x 12.4 m in all, start and goal in rooms at the two ends.

    Difficulty narrows hallway and doors and adds furniture; legs and table boards are what a 2D
    grid at one height does not see.
    """
    hallway, door = between(HALLWAY, difficulty), between(DOOR_WIDTHS, difficulty)
    middle = SIZE[1] / 2 + rng.uniform(-0.3, 0.3)
    sides = (middle - hallway / 2, middle + hallway / 2)  # of the hallway, in y
    walls: list[Box] = []
    ends: list[Point] = []
    for south in (True, False):
        cuts = _cuts(rng)
        walls += _partitions(rng, cuts, sides, south, door)
        number = ROOMS - 1 if ends else int(rng.integers(2))  # the goal is far away
        ends.append(_end(rng, cuts[number : number + 2], sides, south))
    if rng.integers(2):
        ends.reverse()
    line = ((WALL_THICKNESS, middle), (SIZE[0] - WALL_THICKNESS, middle))
    floor = replace(room(rng, SIZE, (ends[0], ends[1]), walls), aisle=inspected(line))
    count = round(between(FURNITURE_COUNTS, difficulty))

    def furniture() -> Iterator[Iterator[Group]]:
        for _ in range(count):
            make = (_table, _chair, _cabinet)[int(rng.integers(3))]
            yield (make(rng) for _ in range(FEW_PLACEMENTS))

    return with_groups(floor, furniture(), parameters.passage_radius)


def _cuts(rng: np.random.Generator) -> list[float]:
    """Return the limits of the rooms of one side, in x, m."""
    even = np.linspace(LOW[0] + WALL_THICKNESS, SIZE[0] - WALL_THICKNESS, ROOMS + 1)
    even[1:-1] += rng.uniform(-0.6, 0.6, ROOMS - 1)
    return [round(float(x), 3) for x in even]


def _partitions(
    rng: np.random.Generator, cuts: list[float], sides: Point, south: bool, door: float
) -> list[Box]:
    """Return the hallway's wall on one side with a door for each room, and the walls between.

    Args:
        rng: Draws everything.
        cuts: Limits of the rooms, in x, m.
        sides: Sides of the hallway, in y, m.
        south: Side of the hallway.
        door: Width of a door, m.
    """
    near = sides[0] - THICKNESS if south else sides[1]
    y = (near, near + THICKNESS)
    outer = LOW[1] + WALL_THICKNESS if south else SIZE[1] - WALL_THICKNESS
    walls, begin = [], cuts[0]
    for left, right in pairwise(cuts):
        opening = rng.uniform(left + 0.3, right - 0.3 - door)
        walls.append(_wall((begin, opening), y))
        begin = opening + door
        walls.append(_wall((opening, begin), y, DOOR_HEIGHT, "lintel"))
        walls.append(_leaf(rng, opening, y, south, door))
    walls.append(_wall((begin, cuts[-1]), y))
    inner = y[0] if south else y[1]
    span = (min(outer, inner), max(outer, inner))
    walls += [_wall((cut - THICKNESS / 2, cut + THICKNESS / 2), span) for cut in cuts[1:-1]]
    return walls


def _wall(x: Point, y: Point, bottom: float = 0.0, kind: str = "partition") -> Box:
    return Box.between((x[0], y[0], bottom), (x[1], y[1], WALL_HEIGHT), kind)


def _leaf(rng: np.random.Generator, hinge: float, y: Point, south: bool, door: float) -> Box:
    """Return the leaf of a door, opened into its room until it nearly meets the wall again."""
    width = door / 2  # of one of two leaves; the other has been taken out
    opened = rng.uniform(0.85, 0.95) * pi
    yaw = -opened if south else opened
    x0, y0 = hinge, y[0] - 0.03 if south else y[1] + 0.03
    centre = (round(x0 + width / 2 * cos(yaw), 3), round(y0 + width / 2 * sin(yaw), 3), 1.05)
    return Box(centre, (round(width / 2, 3), 0.02, 1.05), round(yaw, 3), "door")


def _end(rng: np.random.Generator, room: list[float], sides: Point, south: bool) -> Point:
    y = (LOW[1] + WALL_THICKNESS, sides[0]) if south else (sides[1], SIZE[1] - WALL_THICKNESS)
    x0, x1 = room[0] + END_DISTANCE, room[1] - END_DISTANCE
    place = rng.uniform((x0, y[0] + END_DISTANCE), (x1, y[1] - END_DISTANCE))
    return round(float(place[0]), 3), round(float(place[1]), 3)


def _table(rng: np.random.Generator) -> Group:
    """Return a board on four legs."""
    length, width = rng.uniform(1.0, 1.6), rng.uniform(0.6, 0.8)
    return _on_legs(rng, (length, width), height=0.73, thickness=0.03)


def _chair(rng: np.random.Generator) -> Group:
    """Return a seat on four legs."""
    return _on_legs(rng, (0.45, 0.45), height=0.45, thickness=0.05)


def _on_legs(rng: np.random.Generator, size: Point, height: float, thickness: float) -> Group:
    x, y = rng.uniform(LOW[:2], SIZE)
    yaw = round(rng.uniform(0.0, pi), 3)
    c, s = cos(yaw), sin(yaw)
    half_x, half_y = round(size[0] / 2, 3), round(size[1] / 2, 3)
    x, y = round(float(x), 3), round(float(y), 3)
    bottom = height - thickness
    board = Box((x, y, height - thickness / 2), (half_x, half_y, thickness / 2), yaw, "furniture")
    legs = []
    for a, b in ((-1, -1), (-1, 1), (1, -1), (1, 1)):
        along, across = a * (half_x - 2 * TABLE_LEG_RADIUS), b * (half_y - 2 * TABLE_LEG_RADIUS)
        place = (round(x + c * along - s * across, 3), round(y + s * along + c * across, 3))
        legs.append(Cylinder((*place, 0.0), (*place, bottom), TABLE_LEG_RADIUS, "furniture"))
    return (board, *legs)


def _cabinet(rng: np.random.Generator) -> Group:
    x, y = np.round(rng.uniform(LOW[:2], SIZE), 3).tolist()
    half_z = round(rng.uniform(0.4, 1.0), 3)
    half = (round(rng.uniform(0.3, 0.6), 3), 0.2, half_z)
    return (Box((x, y, half_z), half, 0.0 if rng.integers(2) else round(pi / 2, 9), "furniture"),)
