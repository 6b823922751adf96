"""How many rays a second each caster does, on the same scenes in the same run."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from statistics import median
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from models import rays
from models.beams import DepthCamera, Lidar, SweepSensor, beam_directions, rotate
from models.rays import TileCaster, cut_grid
from models.rays.clutter import clutter
from models.sensors import MujocoCaster

Hits = tuple[NDArray[np.float64], NDArray[np.int32]]
"""Distances (n,) in m and geom ids (n,); -1 and -1 for a miss."""

Beams = NDArray[np.int64]
"""Which beams of the pattern to cast, (n,)."""

LIDAR = Lidar("lidar", "", 100, 1000, -0.45, 0.45, range=100.0, rate=10.0, source="a round number")
CAMERA = DepthCamera("camera", "", 240, 320, 1.5, 1.2, range=10.0, rate=10.0, source="QVGA")

ORIGIN = np.array([0.0, 0.0, 1.0])  # m, in the clearing of the clutter
TILT = np.array([0.98, 0.05, -0.03, 0.2])  # q_world_sensor, not unit: no beam along an axis
SAMPLE = 2000  # beams a sweep that `mj_ray` casts, drawn anew for each
GROUPS = np.ones(mujoco.mjNGROUP, np.uint8)
STEP = 0.1  # m, standard deviation on each axis of how far a mover goes between sweeps
SETTLING = 2  # sweeps before the timed ones


@dataclass(frozen=True)
class Scene:
    """One scene and the sensor in it.

    Attributes:
        name: What the rows call it.
        geoms: Primitives besides the floor.
        moving: How many of them move between sweeps.
        sensor: Pattern of beams, and range in m.
    """

    name: str
    geoms: int
    moving: int
    sensor: SweepSensor


SCENES = (
    *(Scene("lidar", geoms, 0, LIDAR) for geoms in (10, 60, 300, 1000)),
    *(Scene("moving", geoms, 20, LIDAR) for geoms in (60, 300)),
    Scene("camera", 60, 0, CAMERA),
)


@dataclass(frozen=True)
class Row:
    """One engine on one scene.

    Attributes:
        scene: `lidar`, `moving` (the lidar, and 20 of the geoms move) or `camera`.
        geoms: Primitives besides the floor.
        engine: `tile`, `mj_multiRay` or `mj_ray`.
        threads: That it ran on.
        rays: Beams that it cast in one sweep; of `mj_ray` only a sample.
        mray_per_s: Million rays a second of processor time, the median over sweeps.
        ratio_vs_multiray: That rate over the one of `mj_multiRay`.
        max_error_m: Largest difference in distance over all sweeps, m: from `mj_ray` on its
            sample and, of `tile`, from `mj_multiRay` on every beam.
        id_mismatches: Beams over all sweeps, likewise, that met another geom.
    """

    scene: str
    geoms: int
    engine: str
    threads: int
    rays: int
    mray_per_s: float
    ratio_vs_multiray: float
    max_error_m: float
    id_mismatches: int


def bench_rays(sweeps: int, seed: int, progress: Callable[[str], None]) -> list[dict[str, Any]]:
    """Time every engine on every scene; three flat rows (see `Row`) a scene."""
    progress("compiling kernels (a minute the first time, then cached)")
    rays.warm_up()
    rows: list[Row] = []
    for number, scene in enumerate(SCENES, 1):
        progress(f"rays {number}/{len(SCENES)}: {scene.name}, {scene.geoms} geoms")
        rows += _measure(scene, sweeps, seed)
    return [asdict(row) for row in rows]


def within(hits: Hits, range: float) -> Hits:
    """Hits beyond range, m, made misses: MuJoCo's engines report some of those."""
    beyond = hits[0] > range
    return np.where(beyond, -1.0, hits[0]), np.where(beyond, np.int32(-1), hits[1])


def disagreement(got: Hits, expected: Hits) -> tuple[float, int]:
    """Largest difference in distance, m, and number of beams that met another geom."""
    return float(np.abs(got[0] - expected[0]).max()), int((got[1] != expected[1]).sum())


def _measure(scene: Scene, sweeps: int, seed: int) -> list[Row]:
    """Sweep after sweep: all engines in turn on the same poses, so that load meets them alike."""
    rng = np.random.default_rng(seed)
    posed = _Posed(scene, seed)
    everything = np.arange(len(posed.directions))
    tile, multi, single = (
        _Engine(cast, scene.sensor.range) for cast in (posed.tile, posed.multi_ray, posed.one_ray)
    )
    for _ in range(SETTLING + sweeps):
        posed.move(rng)
        sample = np.sort(rng.choice(everything, SAMPLE, replace=False))
        tile_hits, multi_hits = tile.cast(everything), multi.cast(everything)
        oracle = single.cast(sample)
        tile.compare(tile_hits, multi_hits)
        tile.compare((tile_hits[0][sample], tile_hits[1][sample]), oracle)
        multi.compare((multi_hits[0][sample], multi_hits[1][sample]), oracle)
    engines = {"tile": tile, "mj_multiRay": multi, "mj_ray": single}
    return [
        Row(
            scene.name, scene.geoms, name, 1, engine.rays, engine.rate(),
            engine.rate() / multi.rate(), engine.max_error, engine.id_mismatches,
        )
        for name, engine in engines.items()
    ]  # fmt: skip


class _Engine:
    """One way to cast, and what is known of it so far; a cast turns its beams to the world too."""

    def __init__(self, cast: Callable[[Beams], Hits], range: float) -> None:
        self._cast = cast
        self._range = range
        self._seconds: list[float] = []
        self.rays = 0
        self.max_error = 0.0
        self.id_mismatches = 0

    def cast(self, beams: Beams) -> Hits:
        """Cast these beams and note the time; processor time, as other programs run too."""
        self.rays = len(beams)
        started = time.process_time()
        hits = self._cast(beams)
        self._seconds.append(time.process_time() - started)
        return within(hits, self._range)

    def compare(self, got: Hits, expected: Hits) -> None:
        """Note how far the hits are from what another engine says."""
        error, mismatches = disagreement(got, expected)
        self.max_error = max(self.max_error, error)
        self.id_mismatches += mismatches

    def rate(self) -> float:
        """Million rays a second, by the median of the sweeps after the first ones."""
        return self.rays / median(self._seconds[SETTLING:]) / 1e6


class _Posed:
    """A scene as it is now, and the engines on it."""

    def __init__(self, scene: Scene, seed: int) -> None:
        tables = scene.sensor.beam_tables()
        self.directions = beam_directions(*tables)  # (n, 3), sensor frame
        self._model = mujoco.MjModel.from_xml_string(clutter(scene.geoms, scene.moving, seed))
        self._data = mujoco.MjData(self._model)
        R = np.empty(9)
        mujoco.mju_quat2Mat(R, TILT / np.linalg.norm(TILT))
        self._R_world_sensor = R.reshape(3, 3)
        self._pattern = cut_grid(self.directions, *(len(table) for table in tables))
        self._tile = TileCaster(self._model, GROUPS, scene.sensor.range)
        self._multi_ray = MujocoCaster(self._model, self.directions, GROUPS, scene.sensor.range)

    def move(self, rng: np.random.Generator) -> None:
        """Take the movers one step of a random walk on; no engine's work, so not timed."""
        self._data.mocap_pos[:] += rng.normal(0.0, STEP, self._data.mocap_pos.shape)
        mujoco.mj_kinematics(self._model, self._data)

    def tile(self, _: Beams) -> Hits:
        return self._tile.cast(self._data, self._pattern, ORIGIN, self._R_world_sensor)

    def multi_ray(self, _: Beams) -> Hits:
        return self._multi_ray.cast(self._data, ORIGIN, self._R_world_sensor)

    def one_ray(self, beams: Beams) -> Hits:
        directions = rotate(self._R_world_sensor, self.directions[beams])
        distance, ids = np.empty(len(beams)), np.empty(len(beams), np.int32)
        geom = np.empty(1, np.int32)
        for beam, direction in enumerate(directions):
            distance[beam] = mujoco.mj_ray(
                self._model, self._data, ORIGIN, direction, GROUPS, 1, -1, geom
            )
            ids[beam] = geom[0]
        return distance, ids
