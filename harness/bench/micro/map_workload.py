"""Sweeps for `bench map`: through a furnished room, and along an endless hall."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass, replace
from importlib.util import find_spec

import mujoco
import numpy as np
from numpy.typing import NDArray

from wayproof.maps.sweep import Ranges
from wayproof.models.rays import TileCaster, cut_grid
from wayproof.models.sensors.beams import beam_directions, quantise, rotate

RANGE = 10.0  # m
NOISE = 0.01  # m, standard deviation of a measured range
RINGS, AZIMUTHS = 100, 1000
RAYS = RINGS * AZIMUTHS
STEEPEST = np.radians(45.0)  # of the outermost rings, up and down
FLOOR = 0  # its geom, the first in every scene

SWEEP_NS = 100_000_000  # from one sweep to the next

ROOM = np.array([20.0, 20.0, 3.0])  # m
SHELF_ROWS, SHELVES_A_ROW = 5, 8
GAPS = {(1, 3), (2, 5), (3, 2), (4, 6)}  # (row, place) without a shelf: ways through
BOXES = 60
ROOM_POSES = 20
STANDOFF = 0.15  # m, that the sensor keeps from boxes
CORNER = np.array([0.017, 0.023, 0.0])  # m, of the room: no wall lies between two cells

HALL_PERIOD = 4.0  # m, after which the hall looks the same
HALL_HALF_WIDTH = 3.0  # m
HALL_SPACING = 0.5  # m, from one sweep to the next

Boxes = NDArray[np.float64]
"""(n, 6) least and greatest corner of boxes, m, world."""


def octomap_installed() -> bool:
    """Return whether the peer is installed."""
    return find_spec("pyoctomap") is not None


@dataclass(frozen=True, eq=False)
class Sweep:
    """One sweep of a sensor that stands still meanwhile.

    Attributes:
        origin: (3,) m, world.
        directions: (n, 3) unit vectors, world.
        ranges_mm: (n,) measured: with noise, 65535 without a return.
        distances: (n,) true distances, m; -1 without a return.
        geoms: (n,) what was hit, 0 the floor; -1 without a return.
    """

    origin: NDArray[np.float64]
    directions: NDArray[np.float64]
    ranges_mm: Ranges
    distances: NDArray[np.float64]
    geoms: NDArray[np.int32]

    def points(self) -> NDArray[np.float64]:
        """Return the true points (k, 3) where beams hit surfaces, world, m, without misses."""
        hit = self.geoms >= 0
        return self.origin + self.directions[hit] * self.distances[hit, None]

    def moved(self, offset: NDArray[np.float64]) -> Sweep:
        """Return the sweep moved by (3,) m, in a world that looks the same from there."""
        return replace(self, origin=self.origin + offset)


def room_sweeps(seed: int) -> list[Sweep]:
    """Return 20 sweeps along a curved path through a room of 20 x 20 x 3 m with 60 boxes."""
    rng = np.random.default_rng(seed)
    boxes = _furniture(rng)
    caster = _Caster(_room(boxes), rng)
    return [caster.sweep(*pose).moved(CORNER) for pose in _room_poses(boxes)]


def hall_sweeps(seed: int) -> Iterator[Sweep]:
    """Yield sweeps without end along x, half a metre apart, in a hall of pillars and crates.

    The hall repeats every 4 m, and so do its sweeps: any two stretches are the same work.
    """
    rng = np.random.default_rng(seed)
    caster = _Caster(_hall(), rng)
    phases = round(HALL_PERIOD / HALL_SPACING)
    period = [
        caster.sweep(np.array([HALL_SPACING * phase, 0.3, 1.0]), _turned(0.3, 0.05, -0.03))
        for phase in range(phases)
    ]
    for number in itertools.count():
        repeats, phase = divmod(number, phases)
        yield period[phase].moved(np.array([HALL_PERIOD * repeats, 0.0, 0.0]))


class _Caster:
    """One lidar of 1000 x 100 beams over the full turn and 90 degrees of elevation."""

    def __init__(self, mjcf: str, rng: np.random.Generator) -> None:
        elevation = np.linspace(-STEEPEST, STEEPEST, RINGS)
        azimuth = np.linspace(-np.pi, np.pi, AZIMUTHS, endpoint=False)
        self._beams = beam_directions(_cos_sin(elevation), _cos_sin(azimuth))
        self._pattern = cut_grid(self._beams, RINGS, AZIMUTHS)
        model = mujoco.MjModel.from_xml_string(mjcf)
        self._data = mujoco.MjData(model)
        mujoco.mj_kinematics(model, self._data)
        self._caster = TileCaster(model, np.ones(mujoco.mjNGROUP, np.uint8), RANGE)
        self._rng = rng

    def sweep(self, origin: NDArray[np.float64], R_world_sensor: NDArray[np.float64]) -> Sweep:
        distances, geoms = self._caster.cast(self._data, self._pattern, origin, R_world_sensor)
        noisy = np.maximum(distances + self._rng.normal(0.0, NOISE, len(distances)), 0.0)
        ranges_mm = quantise(np.where(geoms < 0, -1.0, noisy), RANGE)
        return Sweep(
            origin,
            directions=rotate(R_world_sensor, self._beams),
            ranges_mm=ranges_mm,
            distances=distances,
            geoms=geoms,
        )


def _cos_sin(angle: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.stack([np.cos(angle), np.sin(angle)], axis=1)


def _furniture(rng: np.random.Generator) -> Boxes:
    """Return five rows of shelves with gaps, and crates, posts and hanging boxes in between."""
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


def _room_poses(boxes: Boxes) -> Iterator[tuple[NDArray[np.float64], NDArray[np.float64]]]:
    """Yield origin (3,) and R_world_sensor (3, 3) along the path, pushed out of boxes sideways."""
    for s in np.linspace(0.0, 1.0, ROOM_POSES):
        x = 2.0 + 15.5 * s + 0.7 * np.sin(7.0 * s)
        y = 9.8 + 6.2 * np.sin(1.8 * np.pi * s)
        position = np.array([x, y, 0.55 + 0.5 * np.sin(5.0 * s) ** 2])
        while _is_near(position, boxes):
            position[1] += 0.07
        yaw = 1.3 * np.pi * s + 0.01
        yield position, _turned(yaw, 0.06 * np.sin(9.0 * s), 0.05 * np.cos(7.0 * s))


def _is_near(position: NDArray[np.float64], boxes: Boxes) -> bool:
    within = (position > boxes[:, :3] - STANDOFF) & (position < boxes[:, 3:] + STANDOFF)
    return bool(within.all(axis=1).any())


def _turned(yaw: float, pitch: float, roll: float) -> NDArray[np.float64]:
    """Return R_world_sensor = Rz(yaw) Ry(pitch) Rx(roll), rad: (3, 3)."""
    quaternion, R = np.empty(4), np.empty(9)
    mujoco.mju_euler2Quat(quaternion, [yaw, pitch, roll], "zyx")
    mujoco.mju_quat2Mat(R, quaternion)
    return R.reshape(3, 3)


def _room(boxes: Boxes) -> str:
    walls = [
        _plane((0.0, 0.0, 0.0), "1 0 0"),
        _plane((ROOM[0], 0.0, 0.0), "-1 0 0"),
        _plane((0.0, 0.0, 0.0), "0 1 0"),
        _plane((0.0, ROOM[1], 0.0), "0 -1 0"),
    ]
    return _scene(walls, boxes)


def _hall() -> str:
    """Build the hall, so long that its ends are out of range from every phase."""
    walls = [
        _plane((0.0, -HALL_HALF_WIDTH, 0.0), "0 1 0"),
        _plane((0.0, HALL_HALF_WIDTH, 0.0), "0 -1 0"),
    ]
    boxes = []
    for x in np.arange(-5, 6) * HALL_PERIOD:
        boxes.append((x, 1.8, 0.0, x + 0.4, 2.2, 3.0))
        boxes.append((x + 1.3, -2.8, 0.0, x + 2.5, -1.6, 1.1))
    return _scene(walls, np.array(boxes))


def _scene(walls: list[str], boxes: Boxes) -> str:
    shell = [_plane((0.0, 0.0, 0.0), "0 0 1"), *walls, _plane((0.0, 0.0, ROOM[2]), "0 0 -1")]
    solid = [
        f'<geom type="box" pos="{_numbers((low + high) / 2)}" size="{_numbers((high - low) / 2)}"/>'
        for low, high in boxes.reshape(-1, 2, 3)
    ]
    return f"<mujoco><worldbody>{''.join(shell + solid)}</worldbody></mujoco>"


def _plane(point: tuple[float, float, float], normal: str) -> str:
    return f'<geom type="plane" size="0 0 1" pos="{_numbers(point)}" zaxis="{normal}"/>'


def _numbers(values: NDArray[np.float64] | tuple[float, ...]) -> str:
    return " ".join(f"{value:.9g}" for value in values)
