"""`wayproof bench rays`: rays per second of each caster, on the same scenes in the same run."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from statistics import median

import mujoco
import numpy as np
from numpy.typing import NDArray

from wayproof.harness.bench.micro.ray_peers import Cast, Hits, installed_peers
from wayproof.harness.bench.raycast.caster import RayCaster
from wayproof.harness.bench.raycast.scenes import clutter, field_terrain, mesh_terrain
from wayproof.harness.bench.table import Progress
from wayproof.models import rays
from wayproof.models.rays import TileCaster, cut_grid
from wayproof.models.sensors.beams import beam_directions, rotate

ORIGIN = np.array([0.0, 0.0, 1.0])  # m, in the clearing of the clutter
TILT = np.array([0.98, 0.05, -0.03, 0.2])  # q_world_sensor, not unit: no beam along an axis
SAMPLE = 2000  # beams a sweep that `mj_ray` casts, drawn anew for each
GROUPS = np.ones(mujoco.mjNGROUP, np.uint8)
STEP = 0.1  # m, standard deviation on each axis of how far a mover goes between sweeps
SETTLING = 1  # sweeps before the timed ones
MOVERS = 20
MESH_POINTS = 72  # a side: 10,082 triangles
FIELD_POINTS = 300  # a side


@dataclass(frozen=True)
class Grid:
    """A grid of beams: every row with every column, within a range in m."""

    rows: NDArray[np.float64]
    columns: NDArray[np.float64]
    range: float


def _cos_sin(angle: NDArray[np.floating]) -> NDArray[np.float64]:
    return np.stack([np.cos(angle), np.sin(angle)], axis=1, dtype=np.float64)


LIDAR = Grid(
    rows=_cos_sin(np.linspace(-0.45, 0.45, 100)),
    columns=_cos_sin(np.arange(1000) * (2.0 * np.pi / 1000)),
    range=100.0,
)
"""100,000 beams, a round number: 100 rings over 52 degrees."""

CAMERA = Grid(
    rows=0.684 * np.linspace(1.0, -1.0, 240)[:, None],
    columns=0.932 * np.linspace(1.0, -1.0, 320)[:, None],
    range=10.0,
)
"""320 x 240 pixels over 86 x 69 degrees."""


@dataclass(frozen=True)
class Scene:
    """One scene and the beams cast in it.

    Attributes:
        name: Name of the scene.
        geoms: Primitives besides the floor, or the one mesh or height field.
        moving: Number of primitives that move between sweeps.
        mjcf: Made from (moving, seed).
        beams: The sensor's.
    """

    name: str
    geoms: int
    moving: int
    mjcf: Callable[[int, int], str]
    beams: Grid = LIDAR


def _clutter(geoms: int) -> Callable[[int, int], str]:
    return lambda moving, seed: clutter(geoms, moving, seed)


def _mesh(moving: int, seed: int) -> str:
    return mesh_terrain(MESH_POINTS, moving, seed)


def _field(moving: int, seed: int) -> str:
    return field_terrain(FIELD_POINTS, moving, seed)


SCENES = (
    *(Scene("lidar", geoms, 0, _clutter(geoms)) for geoms in (10, 60, 300, 1000)),
    *(Scene("lidar, moving", geoms, MOVERS, _clutter(geoms)) for geoms in (60, 300, 1000)),
    Scene("camera", geoms=60, moving=0, mjcf=_clutter(60), beams=CAMERA),
    Scene("camera, moving", geoms=60, moving=MOVERS, mjcf=_clutter(60), beams=CAMERA),
    Scene("mesh", 1, 0, _mesh),
    Scene("mesh, moving", 1 + MOVERS, MOVERS, _mesh),
    Scene("hfield", 1, 0, _field),
    Scene("hfield, moving", 1 + MOVERS, MOVERS, _field),
)


@dataclass(frozen=True)
class RaysRow:
    """One engine on one scene.

    Attributes:
        scene: Name of the scene; with `moving`, 20 primitives move between sweeps.
        geoms: Number of primitives besides the floor; of terrain, itself and movers above it.
        engine: `tile` casts a pattern, `tree` any rays; MuJoCo's two; peers that are installed.
        threads: Number of threads.
        rays: Number of beams in one sweep; a sample of them for `mj_ray`.
        mray_per_s: Million rays a second of wall time, by the median over sweeps.
        ratio_vs_multiray: That rate over the rate of `mj_multiRay`.
        max_error_m: Largest difference in distance from MuJoCo over all sweeps, m: from `mj_ray`
            on its sample and from `mj_multiRay` on every beam.
        id_mismatches: Number of beams over all sweeps that hit another geom, compared likewise.
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


def bench_rays(repeats: int, seed: int, progress: Progress) -> list[RaysRow]:
    """Time every engine on every scene; one flat row for each."""
    progress("compiling kernels (some seconds the first time, then cached)")
    rays.warm_up()
    rows: list[RaysRow] = []
    for number, scene in enumerate(SCENES, 1):
        progress(f"rays {number}/{len(SCENES)}: {scene.name}, {scene.geoms} geoms")
        rows += _measure(scene, repeats, seed)
    return rows


def within(hits: Hits, range: float) -> Hits:
    """Return hits beyond range, m, made misses: MuJoCo's engines report some of those."""
    beyond = hits[0] > range
    return np.where(beyond, -1.0, hits[0]), np.where(beyond, np.int32(-1), hits[1])


def disagreement(got: Hits, expected: Hits) -> tuple[float, int]:
    """Return the largest difference in distance, m, and number of beams that met another geom."""
    return float(np.abs(got[0] - expected[0]).max()), int((got[1] != expected[1]).sum())


def _measure(scene: Scene, sweeps: int, seed: int) -> list[RaysRow]:
    """Cast each sweep with all engines in turn, so that load of the machine meets them alike."""
    rng = np.random.default_rng(seed)
    posed = _Posed(scene, seed)
    engines = posed.engines()
    multi_ray, one_ray = (_engine(engines, name) for name in ("mj_multiRay", "mj_ray"))
    for _ in range(SETTLING + sweeps):
        posed.move(rng)
        posed.sample = np.sort(rng.choice(len(posed.directions), SAMPLE, replace=False))
        for engine in engines:
            engine.cast(scene.beams.range)
        for engine in engines:
            if engine is one_ray:
                continue
            engine.compare(engine.hits, multi_ray.hits)
            engine.compare(_hits_of(engine.hits, posed.sample), one_ray.hits)
    return [
        RaysRow(
            scene=scene.name,
            geoms=scene.geoms,
            engine=engine.name,
            threads=engine.threads,
            rays=len(engine.hits[0]),
            mray_per_s=engine.rate(),
            ratio_vs_multiray=engine.rate() / multi_ray.rate(),
            max_error_m=engine.max_error,
            id_mismatches=engine.id_mismatches,
        )
        for engine in engines
    ]


@dataclass
class _Engine:
    """Engine that casts, with its measurements so far."""

    name: str
    threads: int
    _cast: Cast
    hits: Hits = field(default_factory=lambda: (np.empty(0), np.empty(0, np.int32)))
    max_error: float = 0.0
    id_mismatches: int = 0
    _seconds: list[float] = field(default_factory=list)

    def cast(self, range: float) -> None:
        """Cast a sweep and note the time."""
        started = time.perf_counter()
        hits = self._cast()
        self._seconds.append(time.perf_counter() - started)
        self.hits = within(hits, range)

    def compare(self, got: Hits, expected: Hits) -> None:
        """Record the differences of the hits from another engine's."""
        error, mismatches = disagreement(got, expected)
        self.max_error = max(self.max_error, error)
        self.id_mismatches += mismatches

    def rate(self) -> float:
        """Return the millions of rays a second, by the median sweep after the first ones."""
        return len(self.hits[0]) / median(self._seconds[SETTLING:]) / 1e6


def _engine(engines: list[_Engine], name: str) -> _Engine:
    return next(engine for engine in engines if engine.name == name)


def _hits_of(hits: Hits, beams: NDArray[np.int64]) -> Hits:
    return hits[0][beams], hits[1][beams]


class _Posed:
    """A scene as it is now, and the engines on it."""

    def __init__(self, scene: Scene, seed: int) -> None:
        beams = scene.beams
        directions = beam_directions(beams.rows, beams.columns)  # (n, 3), sensor frame
        self._range = beams.range
        self._moving = scene.moving > 0
        self._model = mujoco.MjModel.from_xml_string(scene.mjcf(scene.moving, seed))
        self._data = mujoco.MjData(self._model)
        mujoco.mj_kinematics(self._model, self._data)
        R = np.empty(9)
        mujoco.mju_quat2Mat(R, TILT / np.linalg.norm(TILT))
        self._R_world_sensor = R.reshape(3, 3)
        self._pattern = cut_grid(directions, len(beams.rows), len(beams.columns))
        self._trees = RayCaster(self._model, GROUPS, beams.range)
        # Transformed to the world frame before, so that the others are timed at casting alone.
        self.directions = rotate(self._R_world_sensor, directions)
        self._origins = np.tile(ORIGIN, (len(directions), 1))
        self.sample: NDArray[np.int64] = np.empty(0, np.int64)

    def engines(self) -> list[_Engine]:
        """Return every engine that can cast this scene, which peers build anew for each pose."""
        ours = [_Engine("tile", threads, self._tile(threads)) for threads in (1, 2)]
        peers = [] if self._moving else self._peers()
        return [
            *ours,
            _Engine("tree", 1, self._tree),
            _Engine("mj_multiRay", 1, self._multi_ray),
            _Engine("mj_ray", 1, self._one_ray),
            *peers,
        ]

    def move(self, rng: np.random.Generator) -> None:
        """Take the movers one step of a random walk on; no engine's work, so not timed."""
        self._data.mocap_pos[:] += rng.normal(0.0, STEP, self._data.mocap_pos.shape)
        mujoco.mj_kinematics(self._model, self._data)

    def _peers(self) -> list[_Engine]:
        places = [("open3d", 1), ("open3d", 2), ("embree", 1)]
        makers = installed_peers()
        return [
            _Engine(
                name,
                threads,
                makers[name](
                    self._model, self._data, ORIGIN, self.directions, self._range, threads
                ),
            )
            for name, threads in places
            if name in makers
        ]

    def _tile(self, threads: int) -> Cast:
        caster = TileCaster(self._model, GROUPS, self._range, threads)
        return lambda: caster.cast(self._data, self._pattern, ORIGIN, self._R_world_sensor)

    def _tree(self) -> Hits:
        return self._trees.cast(self._data, self._origins, self.directions)

    def _multi_ray(self) -> Hits:
        count = len(self.directions)
        distance, ids = np.empty(count), np.empty(count, np.int32)
        mujoco.mj_multiRay(
            self._model, self._data, ORIGIN, self.directions.ravel(), GROUPS, 1, -1,
            ids, distance, None, count, self._range,
        )  # fmt: skip
        return distance, ids

    def _one_ray(self) -> Hits:
        distance, ids = np.empty(len(self.sample)), np.empty(len(self.sample), np.int32)
        geom = np.empty(1, np.int32)
        for place, beam in enumerate(self.sample):
            distance[place] = mujoco.mj_ray(
                self._model, self._data, ORIGIN, self.directions[beam], GROUPS, 1, -1, geom
            )
            ids[place] = geom[0]
        return distance, ids
