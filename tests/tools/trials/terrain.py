"""Terrain to walk over blindly along +x from the origin: blocks drawn from a generator.

Every course starts with flat floor about the origin and ends at `COURSE_END`.
"""

from __future__ import annotations

from collections.abc import Callable
from math import cos, pi, sin
from typing import NamedTuple

import numpy as np

from wayproof.models.arrays import Vector3

FIRST = 0.7
"""Minimum distance of blocks from the origin, m."""

COURSE_END = 5.0
"""Distance along x at which the course is crossed, m."""

HALF_WIDTH = 1.5
"""Half the width of a course, m."""


class Block(NamedTuple):
    """A solid box."""

    centre: Vector3
    half_extents: Vector3
    yaw: float = 0.0
    pitch: float = 0.0

    def mjcf(self, friction: float) -> str:
        """Return the `<geom>` element."""
        cy, sy, cp, sp = *_half(self.yaw), *_half(self.pitch)
        quaternion = cy * cp, -sy * sp, cy * sp, sy * cp
        return (
            f'<geom type="box" pos="{_numbers(self.centre)}" size="{_numbers(self.half_extents)}" '
            f'quat="{_numbers(quaternion)}" friction="{friction} 0.005 0.0001"/>'
        )


def planks(rng: np.random.Generator, height: float = 0.03) -> tuple[Block, ...]:
    """Return planks 10 cm wide across the way, 0.3 to 0.8 m apart, up to 0.3 rad askew."""
    blocks, x = [], FIRST
    while x < COURSE_END - 0.5:
        half = 0.05, HALF_WIDTH, height / 2
        blocks.append(Block((x, 0.0, height / 2), half, yaw=rng.uniform(-0.3, 0.3)))
        x += rng.uniform(0.3, 0.8)
    return tuple(blocks)


def stairs(rng: np.random.Generator, rise: float = 0.08) -> tuple[Block, ...]:
    """Return four steps up, a landing, four down; treads of 0.28 to 0.36 m, alike in a flight."""
    blocks, x = [], rng.uniform(FIRST, FIRST + 0.3)
    tread, landing, steps = rng.uniform(0.28, 0.36), rng.uniform(0.6, 0.9), 4
    length = landing + 2 * steps * tread
    for step in range(steps):
        low, high = x + step * tread, x + length - step * tread
        half = (high - low) / 2, HALF_WIDTH, rise / 2
        blocks.append(Block(((low + high) / 2, 0.0, (step + 0.5) * rise), half))
    return tuple(blocks)


def rubble(rng: np.random.Generator, height: float = 0.05) -> tuple[Block, ...]:
    """Return blocks up to `height` high, 0.1 to 0.3 m long, askew, on a third of the floor."""
    blocks, area = [], 0.0
    while area < 0.33 * (COURSE_END - 0.5 - FIRST) * 2 * 0.8:
        half = rng.uniform(0.05, 0.15), rng.uniform(0.05, 0.15), rng.uniform(0.1, 0.5) * height
        x, y = rng.uniform(FIRST, COURSE_END - 0.5), rng.uniform(-0.8, 0.8)
        blocks.append(Block((x, y, half[2]), half, yaw=rng.uniform(0.0, pi)))
        area += 4 * half[0] * half[1]
    return tuple(blocks)


def ramps(rng: np.random.Generator, slope: float = 0.3) -> tuple[Block, ...]:
    """Return a ramp up, a level, and a ramp down again."""
    start, length, level = rng.uniform(FIRST, FIRST + 0.3), 1.4, rng.uniform(0.5, 0.8)
    top, run, half = length * sin(slope), length * cos(slope), 0.1
    across, deep = half * sin(slope), half * cos(slope)

    def side(x: float, up: int) -> Block:
        centre = x + up * across, 0.0, top / 2 - deep
        return Block(centre, (length / 2, HALF_WIDTH, half), pitch=-up * slope)

    end = start + 2 * run + level
    table = Block(((start + end) / 2, 0.0, top / 2), (level / 2, HALF_WIDTH, top / 2))
    return side(start + run / 2, 1), table, side(end - run / 2, -1)


TERRAINS: dict[str, Callable[[np.random.Generator], tuple[Block, ...]]] = {
    "planks": planks,
    "stairs": stairs,
    "rubble": rubble,
    "ramps": ramps,
}
"""Terrains by name."""


def _half(angle: float) -> tuple[float, float]:
    return cos(angle / 2), sin(angle / 2)


def _numbers(values: tuple[float, ...]) -> str:
    return " ".join(f"{value:.6f}" for value in values)
