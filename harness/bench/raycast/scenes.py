"""Scenes to measure ray casters on: strewn primitives, and terrain as a mesh or a height field."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

KINDS = ("sphere", "capsule", "ellipsoid", "cylinder", "box")
SIDE = 40.0  # m, of the square that geoms are strewn over and that terrain covers
CLEARING = 2.0  # m, about the origin: no geom as it is placed reaches a sensor that stands there
RELIEF = 1.5  # m, between the highest and the lowest point of terrain; the highest is at 0
BASE = 0.5  # m, of a height field's base below its lowest point
WAVES = 12  # that a terrain is the sum of
LONGEST, SHORTEST = 12.0, 2.0  # m, of these waves


def clutter(count: int, moving: int = 0, seed: int = 0) -> str:
    """Return MJCF of a floor and `count` mixed primitives up to 2 m above it.

    Args:
        count: Geoms besides the floor; the five shapes take turns.
        moving: Number of them, the first ones, that are mocap bodies.
        seed: Seed of places, sizes and attitudes.

    Raises:
        ValueError: More geoms move than there are.
    """
    if not 0 <= moving <= count:
        raise ValueError(f"moving: got {moving}, expected 0 to {count}")
    floor = '<geom type="plane" size="0 0 1"/>'
    return _mjcf("", floor + _strewn(count, moving, seed))


def mesh_terrain(points: int, moving: int = 0, seed: int = 0) -> str:
    """Return MJCF of rolling ground as a mesh of 2 (points - 1)^2 triangles, and movers above.

    Args:
        points: Vertices along each side of the square.
        moving: Mocap bodies besides, as `clutter` strews them.
        seed: Seed of the ground and of the movers.
    """
    x, y = np.meshgrid(*(2 * [np.linspace(-SIDE / 2, SIDE / 2, points)]), indexing="ij")
    vertices = np.stack([x, y, _heights(points, seed)], axis=-1).reshape(-1, 3)
    corner = np.arange(points * points).reshape(points, points)
    a, b, c, d = (
        side.ravel()
        for side in (corner[:-1, :-1], corner[1:, :-1], corner[1:, 1:], corner[:-1, 1:])
    )
    faces = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    # Open ground encloses no volume; MuJoCo then requires the inertia of a shell.
    asset = (
        f'<mesh name="ground" inertia="shell" vertex="{_numbers(*vertices.ravel())}" '
        f'face="{" ".join(map(str, faces.ravel()))}"/>'
    )
    ground = '<geom type="mesh" mesh="ground"/>'
    return _mjcf(asset, ground + _strewn(moving, moving, seed))


def field_terrain(points: int, moving: int = 0, seed: int = 0) -> str:
    """Return MJCF of rolling ground as a height field of points x points, and movers above.

    Args:
        points: Samples along each side of the square.
        moving: Mocap bodies besides, as `clutter` strews them.
        seed: Seed of the ground and of the movers.
    """
    heights = _heights(points, seed).T[::-1]  # MJCF lists rows from the far side in y
    asset = (
        f'<hfield name="ground" nrow="{points}" ncol="{points}" '
        f'size="{SIDE / 2} {SIDE / 2} {RELIEF} {BASE}" elevation="{_numbers(*heights.ravel())}"/>'
    )
    ground = f'<geom type="hfield" hfield="ground" pos="0 0 {-RELIEF}"/>'
    return _mjcf(asset, ground + _strewn(moving, moving, seed))


def _mjcf(assets: str, geoms: str) -> str:
    return f"<mujoco><asset>{assets}</asset><worldbody>{geoms}</worldbody></mujoco>"


def _heights(points: int, seed: int) -> NDArray[np.float64]:
    """Return heights of rolling ground (points, points), x by y, m: from -RELIEF to 0."""
    rng = np.random.default_rng(seed)
    x, y = np.meshgrid(*(2 * [np.linspace(-SIDE / 2, SIDE / 2, points)]), indexing="ij")
    heights = np.zeros((points, points))
    for length in np.geomspace(LONGEST, SHORTEST, WAVES):
        heading, phase = rng.uniform(0.0, 2.0 * np.pi, 2)
        along = x * np.cos(heading) + y * np.sin(heading)
        heights += length * np.sin(2.0 * np.pi * along / length + phase)
    heights -= heights.max()
    ground: NDArray[np.float64] = heights * (RELIEF / -heights.min())
    return ground


def _strewn(count: int, moving: int, seed: int) -> str:
    rng = np.random.default_rng(seed)
    return "".join(_geom(rng, KINDS[i % len(KINDS)], i < moving) for i in range(count))


def _geom(rng: np.random.Generator, kind: str, moves: bool) -> str:
    place = rng.uniform(-SIDE / 2, SIDE / 2, 2)
    while np.hypot(*place) < CLEARING:
        place = rng.uniform(-SIDE / 2, SIDE / 2, 2)
    quaternion = _numbers(*rng.normal(size=4))  # MuJoCo scales it to unit length
    pose = f'pos="{_numbers(*place, rng.uniform(0.0, 2.0))}" quat="{quaternion}"'
    shape = f'type="{kind}" size="{_numbers(*rng.uniform(0.1, 0.6, 3))}"'
    if moves:
        return f'<body mocap="true" {pose}><geom {shape}/></body>'
    # In the world body itself: MuJoCo's own caster is more than twice as fast on one body with
    # a tree of geoms as on a body for each.
    return f"<geom {shape} {pose}/>"


def _numbers(*values: float) -> str:
    return " ".join(f"{value:.9g}" for value in values)
