"""`wayproof bench map`: sweeps of 100,000 rays into the voxel map, beside OctoMap in the same run.

The room of 20 x 20 x 3 m has 60 boxes and a lidar on a curved path through it. OctoMap is called as
its documentation says, by its own binding, in its fastest mode (the extra `peers`);
without it its columns are left out.
"""

from __future__ import annotations

import itertools
import time
from collections.abc import Iterator
from importlib import import_module
from importlib.util import find_spec
from statistics import median
from typing import Any, NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from wayproof.harness.bench.table import Progress, Row
from wayproof.maps import MapConfig, VoxelMap, warm_up
from wayproof.maps.sweep import Ranges
from wayproof.models import rays
from wayproof.models.rays import TileCaster, cut_grid
from wayproof.models.sensors.beams import beam_directions, quantise, rotate

Array = NDArray[np.float64]

RESOLUTIONS = (0.05, 0.1, 0.2)  # m
RANGE = 10.0  # m, beyond which a beam only clears
NOISE = 0.01  # m, standard deviation of a measured range
RINGS, AZIMUTHS = 100, 1000
STEEPEST = np.radians(45.0)  # of the outermost rings, up and down
SWEEP_NS = 100_000_000  # from one sweep to the next
SETTLING = 1  # sweeps before the timed ones
TURN = 4  # sweeps that go to one map before the next has its turn
MIB = 2.0**20

ROOM = np.array([20.0, 20.0, 3.0])  # m
SHELF_ROWS, SHELVES_A_ROW = 5, 8
GAPS = {(1, 3), (2, 5), (3, 2), (4, 6)}  # (row, place) without a shelf: ways through
BOXES = 60
POSES = 20
STANDOFF = 0.15  # m, that the sensor keeps from boxes
CORNER = np.array([0.017, 0.023, 0.0])  # m, of the room: no wall lies between two cells
REQUESTS = 64  # of memory, until the allocator has sorted what OctoMap freed


class Sweep(NamedTuple):
    """A sweep of a sensor that stands still: origin (3,) m, unit directions (n, 3), ranges (n,) mm.

    A range of 65535 is a beam without return.
    """

    origin: Array
    directions: Array
    ranges_mm: Ranges


def bench_map(repeats: int, seed: int, progress: Progress) -> list[Row]:
    """Time the map's update by cell size; one row for each.

    A row has the edge of a cell, `cell_m`; the number of `cells` that a sweep updates, by the
    median; the least and the median wall time of a sweep, `ms_min` and `ms`; the median with decay,
    `decay_ms`; memory after the last sweep, `mib`. Of OctoMap on the same sweeps: `x_octomap`, its
    median over ours, and its memory `octomap_mib`.
    """
    warm_up()
    rays.warm_up()
    sweeps = room_sweeps(seed)
    rows = []
    for resolution in RESOLUTIONS:
        progress(f"map: cells of {resolution:g} m")
        rows.append(_measure(sweeps, resolution, repeats))
    return rows


def _measure(sweeps: list[Sweep], resolution: float, repeats: int) -> Row:
    """Give the same sweeps to every map, in turns of a few, so that load meets them alike."""
    still, fading = (
        VoxelMap(MapConfig(resolution=resolution, half_life=half_life)) for half_life in (0.0, 30.0)
    )
    tree = import_module("pyoctomap").OcTree(resolution) if find_spec("pyoctomap") else None
    times: dict[str, list[float]] = {"still": [], "fading": [], "tree": []}
    cells = []
    numbers = range(SETTLING + repeats)
    for turn in (numbers[first : first + TURN] for first in numbers[::TURN]):
        for name, one in (("still", still), ("fading", fading)):
            for number in turn:
                began = time.perf_counter()
                updated = integrate(one, sweeps[number % POSES], number)
                times[name].append(1e3 * (time.perf_counter() - began))
                cells.append(updated)
        for number in turn if tree is not None else ():
            times["tree"].append(_insert(tree, sweeps[number % POSES], resolution))
    took = median(times["still"][SETTLING:])
    row = {
        "cell_m": resolution,
        "cells": int(median(cells)),
        "ms_min": min(times["still"][SETTLING:]),
        "ms": took,
        "decay_ms": median(times["fading"][SETTLING:]),
        "mib": still.memory_bytes() / MIB,
    }
    if tree is None:
        return row
    return row | {
        "x_octomap": median(times["tree"][SETTLING:]) / took,
        "octomap_mib": tree.memoryUsage() / MIB,
    }


def integrate(voxel_map: Any, sweep: Sweep, number: int) -> int:
    """Integrate a sweep at its time; return how many cells it updated."""
    at_ns = number * SWEEP_NS
    found = voxel_map.integrate(sweep.origin, sweep.directions, sweep.ranges_mm, RANGE, at_ns)
    return int(found.cells_updated)


def _insert(tree: Any, sweep: Sweep, resolution: float) -> float:
    """Insert a sweep into OctoMap; return the time, ms. Making points of ranges is not timed."""
    beyond = sweep.ranges_mm > round(1000 * RANGE)
    lengths = np.where(beyond, 2.0 * RANGE, sweep.ranges_mm / 1000.0)
    points = sweep.origin + sweep.directions * lengths[:, None]
    began = time.perf_counter()
    x, y, z = np.floor(points / resolution).astype(np.int64).T
    _, first = np.unique((x << 40) + (y << 20) + z, return_index=True)  # one point a cell
    tree.insertPointCloud(points[first], sweep.origin, RANGE, True, False)
    took = 1e3 * (time.perf_counter() - began)
    _ = [np.empty(20_000) for _ in range(REQUESTS)]  # else 15 ms in the sweep of the next map
    return took


def room_sweeps(seed: int) -> list[Sweep]:
    """Return 20 sweeps along a curved path through a room of 20 x 20 x 3 m with 60 boxes."""
    rng = np.random.default_rng(seed)
    boxes = _furniture(rng)
    angles = np.linspace(-STEEPEST, STEEPEST, RINGS), np.linspace(-np.pi, np.pi, AZIMUTHS + 1)[:-1]
    beams = beam_directions(*(np.stack([np.cos(one), np.sin(one)], axis=1) for one in angles))
    pattern = cut_grid(beams, RINGS, AZIMUTHS)
    model = mujoco.MjModel.from_xml_string(_room(boxes))
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    caster = TileCaster(model, np.ones(mujoco.mjNGROUP, np.uint8), RANGE)
    sweeps = []
    for origin, R_world_sensor in _poses(boxes):
        distances, geoms = caster.cast(data, pattern, origin, R_world_sensor)
        noisy = np.maximum(distances + rng.normal(0.0, NOISE, len(distances)), 0.0)
        ranges_mm = quantise(np.where(geoms < 0, -1.0, noisy), RANGE)
        sweeps.append(Sweep(origin + CORNER, rotate(R_world_sensor, beams), ranges_mm))
    return sweeps


def _furniture(rng: np.random.Generator) -> Array:
    """Return corners (n, 6) of five rows of shelves with gaps, and of boxes in between, m."""
    boxes = []
    for row, place in itertools.product(range(SHELF_ROWS), range(SHELVES_A_ROW)):
        if (row, place) in GAPS:
            continue
        x, y = 1.6 + 2.15 * place, 2.2 + 3.6 * row
        boxes.append((x, y, 0.0, x + 1.7, y + 0.9, rng.uniform(0.8, 2.6)))
    while len(boxes) < BOXES:
        x, y = rng.uniform(0.6, 19.0, 2)
        width, depth = rng.uniform(0.05, 0.7, 2)
        bottom = 0.0 if rng.random() < 0.7 else rng.uniform(0.3, 2.0)
        top = min(bottom + rng.uniform(0.1, 1.6), float(ROOM[2]))
        boxes.append((x, y, bottom, x + width, y + depth, top))
    return np.array(boxes)


def _poses(boxes: Array) -> Iterator[tuple[Array, Array]]:
    """Yield origin (3,) and R_world_sensor (3, 3) along the path, pushed out of boxes sideways."""
    for s in np.linspace(0.0, 1.0, POSES):
        x = 2.0 + 15.5 * s + 0.7 * np.sin(7.0 * s)
        y = 9.8 + 6.2 * np.sin(1.8 * np.pi * s)
        position = np.array([x, y, 0.55 + 0.5 * np.sin(5.0 * s) ** 2])
        while _is_near(position, boxes):
            position[1] += 0.07
        yaw = 1.3 * np.pi * s + 0.01
        yield position, _turned(yaw, 0.06 * np.sin(9.0 * s), 0.05 * np.cos(7.0 * s))


def _is_near(position: Array, boxes: Array) -> bool:
    within = (position > boxes[:, :3] - STANDOFF) & (position < boxes[:, 3:] + STANDOFF)
    return bool(within.all(axis=1).any())


def _turned(yaw: float, pitch: float, roll: float) -> Array:
    """Return R_world_sensor = Rz(yaw) Ry(pitch) Rx(roll), rad: (3, 3)."""
    quaternion, R = np.empty(4), np.empty(9)
    mujoco.mju_euler2Quat(quaternion, [yaw, pitch, roll], "zyx")
    mujoco.mju_quat2Mat(R, quaternion)
    return R.reshape(3, 3)


def _room(boxes: Array) -> str:
    planes = [
        ((0.0, 0.0, 0.0), "0 0 1"), ((0.0, 0.0, 0.0), "1 0 0"), ((ROOM[0], 0.0, 0.0), "-1 0 0"),
        ((0.0, 0.0, 0.0), "0 1 0"), ((0.0, ROOM[1], 0.0), "0 -1 0"),
        ((0.0, 0.0, ROOM[2]), "0 0 -1"),
    ]  # fmt: skip
    shell = [
        f'<geom type="plane" size="0 0 1" pos="{_numbers(point)}" zaxis="{normal}"/>'
        for point, normal in planes
    ]
    solid = [
        f'<geom type="box" pos="{_numbers((low + high) / 2)}" size="{_numbers((high - low) / 2)}"/>'
        for low, high in boxes.reshape(-1, 2, 3)
    ]
    return f"<mujoco><worldbody>{''.join(shell + solid)}</worldbody></mujoco>"


def _numbers(values: Array | tuple[float, ...]) -> str:
    return " ".join(f"{value:.9g}" for value in values)
