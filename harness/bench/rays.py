"""`wayproof bench rays`: rays per second beside `mj_multiRay`, on the same scenes in one run."""

from __future__ import annotations

import time
from collections.abc import Callable
from statistics import median
from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from wayproof.harness.bench.table import Progress, Row
from wayproof.models import rays
from wayproof.models.rays import TileCaster, cut_grid
from wayproof.models.sensors.beams import beam_directions, rotate
from wayproof.models.sensors.devices.kinds import cos_sin
from wayproof.models.worlds import HeightField, Solid, TriangleMesh

Array = NDArray[np.float64]
Hits = tuple[Array, NDArray[np.int32]]

ORIGIN = np.array([0.0, 0.0, 1.0])  # m, in the clearing of the clutter
TILT = np.array([0.98, 0.05, -0.03, 0.2])  # q_world_sensor, not unit: no beam along an axis
GROUPS = np.ones(mujoco.mjNGROUP, np.uint8)
SETTLING = 1  # sweeps before the timed ones
STEP = 0.1  # m, standard deviation on each axis of how far a mover goes between sweeps
MOVERS = 20

KINDS = ("sphere", "capsule", "ellipsoid", "cylinder", "box")
SIDE = 40.0  # m, of the square that geoms are strewn over and that terrain covers
CLEARING = 2.0  # m, about the origin: no geom as it is placed reaches the sensor
RELIEF = 1.5  # m, between the highest and the lowest point of terrain; the highest is at 0
MESH_POINTS, FIELD_POINTS = 72, 300  # a side: 10,082 triangles, and a height field


class Beams(NamedTuple):
    """A grid of beams: every row with every column, within a range in m."""

    rows: Array
    columns: Array
    range: float


LIDAR = Beams(
    cos_sin(np.linspace(-0.45, 0.45, 100)), cos_sin(np.arange(1000) * (2.0 * np.pi / 1000)), 100.0
)
"""100 rings over 52 degrees: 100,000 beams."""

CAMERA = Beams(
    0.684 * np.linspace(1.0, -1.0, 240)[:, None], 0.932 * np.linspace(1.0, -1.0, 320)[:, None], 10.0
)
"""320 x 240 pixels over 86 x 69 degrees."""


class Scene(NamedTuple):
    """A scene: its name, MJCF from a seed, and the beams that are cast in it."""

    name: str
    mjcf: Callable[[int], str]
    beams: Beams = LIDAR


def clutter(count: int, moving: int, seed: int) -> str:
    """Return MJCF of a floor and mixed primitives up to 2 m above it.

    Args:
        count: Geoms besides the floor; the five shapes take turns.
        moving: Number of them, the first ones, that are mocap bodies.
        seed: Seed of places, sizes and attitudes.
    """
    rng = np.random.default_rng(seed)
    geoms = [_geom(rng, KINDS[i % len(KINDS)], i < moving) for i in range(count)]
    plane = '<geom type="plane" size="0 0 1"/>'
    return f"<mujoco><worldbody>{plane}{''.join(geoms)}</worldbody></mujoco>"


def mesh_terrain(points: int, seed: int) -> str:
    """Return MJCF of rolling ground as a mesh of 2 (points - 1)^2 triangles."""
    corner = np.arange(points * points).reshape(points, points)
    a, b, c, d = (
        side.ravel()
        for side in (corner[:-1, :-1], corner[1:, :-1], corner[1:, 1:], corner[:-1, 1:])
    )
    faces = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    nodes = _ground(points, seed).nodes.reshape(-1, 3)
    return _mjcf(TriangleMesh.from_arrays(nodes, faces, "floor"))


def field_terrain(points: int, seed: int) -> str:
    """Return MJCF of rolling ground as a height field of points x points."""
    return _mjcf(_ground(points, seed))


SCENES = (
    Scene("lidar, 10 geoms", lambda seed: clutter(10, 0, seed)),
    Scene("lidar, 60", lambda seed: clutter(60, 0, seed)),
    Scene("lidar, 300", lambda seed: clutter(300, 0, seed)),
    Scene("lidar, 1000", lambda seed: clutter(1000, 0, seed)),
    Scene("lidar, 1000, 20 move", lambda seed: clutter(1000, MOVERS, seed)),
    Scene("camera, 60", lambda seed: clutter(60, 0, seed), CAMERA),
    Scene("mesh", lambda seed: mesh_terrain(MESH_POINTS, seed)),
    Scene("height field", lambda seed: field_terrain(FIELD_POINTS, seed)),
)


def bench_rays(repeats: int, seed: int, progress: Progress) -> list[Row]:
    """Time whole sweeps of beams in every scene; one row for each.

    A row has the scene and its number of `rays`; the least and the median wall time of a sweep,
    `ms_min` and `ms`; `mray_per_s` by the median; `x_multiray`, the median time of `mj_multiRay` on
    the same sweeps over ours; `max_error_m` and `other_ids`, the largest difference in distance
    from it and the number of beams that met another geom, over all sweeps.
    """
    rays.warm_up()
    rows = []
    for number, scene in enumerate(SCENES, 1):
        progress(f"rays {number}/{len(SCENES)}: {scene.name}")
        rows.append(_measure(scene, repeats, seed))
    return rows


def _measure(scene: Scene, sweeps: int, seed: int) -> Row:
    rng, beams = np.random.default_rng(seed), scene.beams
    model = mujoco.MjModel.from_xml_string(scene.mjcf(seed))
    data = mujoco.MjData(model)
    R = np.empty(9)
    mujoco.mju_quat2Mat(R, TILT / np.linalg.norm(TILT))
    R_world_sensor = R.reshape(3, 3)
    directions = beam_directions(beams.rows, beams.columns)  # (n, 3), sensor frame
    pattern = cut_grid(directions, len(beams.rows), len(beams.columns))
    in_world = rotate(R_world_sensor, directions)
    caster = TileCaster(model, GROUPS, beams.range)
    ours, theirs, worst, other_ids = [], [], 0.0, 0
    for _ in range(SETTLING + sweeps):
        data.mocap_pos[:] += rng.normal(0.0, STEP, data.mocap_pos.shape)
        mujoco.mj_kinematics(model, data)
        began = time.perf_counter()
        got = caster.cast(data, pattern, ORIGIN, R_world_sensor)
        between = time.perf_counter()
        expected = _multi_ray(model, data, in_world, beams.range)
        ours.append(between - began)
        theirs.append(time.perf_counter() - between)
        error, mismatches = disagreement(got, within(expected, beams.range))
        worst, other_ids = max(worst, error), other_ids + mismatches
    took, peer = median(ours[SETTLING:]), median(theirs[SETTLING:])
    return {
        "scene": scene.name,
        "rays": len(directions),
        "ms_min": 1e3 * min(ours[SETTLING:]),
        "ms": 1e3 * took,
        "mray_per_s": len(directions) / took / 1e6,
        "x_multiray": peer / took,
        "max_error_m": worst,
        "other_ids": other_ids,
    }


def within(hits: Hits, range: float) -> Hits:
    """Return hits beyond range, m, made misses: MuJoCo reports some of those."""
    beyond = hits[0] > range
    return np.where(beyond, -1.0, hits[0]), np.where(beyond, np.int32(-1), hits[1])


def disagreement(got: Hits, expected: Hits) -> tuple[float, int]:
    """Return the largest difference in distance, m, and number of beams that met another geom."""
    return float(np.abs(got[0] - expected[0]).max()), int((got[1] != expected[1]).sum())


def _multi_ray(model: mujoco.MjModel, data: mujoco.MjData, directions: Array, range: float) -> Hits:
    count = len(directions)
    distance, ids = np.empty(count), np.empty(count, np.int32)
    mujoco.mj_multiRay(
        model, data, ORIGIN, directions.ravel(), GROUPS, 1, -1, ids, distance, None, count, range
    )
    return distance, ids


def _mjcf(solid: Solid) -> str:
    asset, geom = solid.asset("ground"), solid.geom("ground")
    return f"<mujoco><asset>{asset}</asset><worldbody>{geom}</worldbody></mujoco>"


def _ground(points: int, seed: int) -> HeightField:
    """Return rolling ground of points x points, from -RELIEF to 0."""
    rng = np.random.default_rng(seed)
    x, y = np.meshgrid(*(2 * [np.linspace(-SIDE / 2, SIDE / 2, points)]), indexing="ij")
    heights = np.zeros((points, points))
    for length in np.geomspace(12.0, 2.0, 12):  # m, of waves
        heading, phase = rng.uniform(0.0, 2.0 * np.pi, 2)
        along = x * np.cos(heading) + y * np.sin(heading)
        heights += length * np.sin(2.0 * np.pi * along / length + phase)
    heights -= heights.max()
    spacing = SIDE / (points - 1)
    heights *= RELIEF / -heights.min()
    corner = (-SIDE / 2, -SIDE / 2, 0.0)
    return HeightField.from_array(corner, (spacing, spacing), heights, "floor")


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
