"""Casting the beams of a robot's sensors against MuJoCo's geometry.

A sweep leaves here as the device reports it, quantised, because the map must see exactly the values
that the log holds.
"""

from __future__ import annotations

from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from wayproof.models.classes import UNKNOWN_CLASS, class_of_geoms
from wayproof.models.poses import Trail
from wayproof.models.random_streams import stream
from wayproof.models.rays import Pattern, TileCaster, cut_grid, cut_scattered
from wayproof.models.sensors.beams import (
    DROPPED,
    NO_RETURN,
    BeamTable,
    directions,
    moment_offsets,
    moments,
    rotate,
)
from wayproof.models.sensors.devices import (
    Device,
    Mount,
    Rangefinder,
    RangeNoise,
    SensorConfig,
)
from wayproof.models.sensors.measure import measure

__all__ = ["ENGINES", "ROBOT_GROUP", "Caster", "RangefinderCaster", "SweepCaster"]

ROBOT_GROUP = 3
"""Geom group of every robot geom, so that no beam sees the body that carries it."""


class Hits(NamedTuple):
    """What the beams of a sweep met.

    Attributes:
        distance: (n,) m, -1 for a miss; some may lie beyond range.
        geom_id: (n,) -1 for a miss.
        normals: (n, 3) of the surfaces in the world, zeros for a miss; (0, 3) if not asked for.
    """

    distance: NDArray[np.float64]
    geom_id: NDArray[np.int32]
    normals: NDArray[np.float64]


class Firing(NamedTuple):
    """The beams of one sweep.

    Attributes:
        directions: (n, 3) unit vectors, sensor frame.
        moments: (n,) which of the sweep's poses each beam leaves from.
        pattern: The same, cut into tiles.
    """

    directions: NDArray[np.float64]
    moments: NDArray[np.int32]
    pattern: Pattern


class SweepCaster:
    """Casts one mounted sensor's sweeps against MuJoCo's geometry."""

    def __init__(
        self,
        model: mujoco.MjModel,
        mount: Mount,
        base: int,
        prefix: str,
        config: SensorConfig,
        threads: int = 1,
    ) -> None:
        """Build the tables once.

        Args:
            model: World and robot.
            mount: The device and the site that it sits at.
            base: Body id of the robot's base, which carries the site.
            prefix: Before every name of the robot in the model.
            config: How to cast.
            threads: That a sweep is cast on.

        Raises:
            KeyError: The model has no such site.
            ValueError: The site is not on the base, or the engine cannot cast one of the geoms.
        """
        self.mount = mount
        self.table = mount.device.beam_table()
        self._model = model
        self._classes: NDArray[np.uint8] | None = None  # by geom
        self._moments = moments(self.table)
        self._site = model.site(prefix + mount.site).id
        self.mounting = _mounting(model, self._site, base)
        self._ages = -1e-9 * moment_offsets(self.table, round(1e9 / mount.device.rate))
        self._firing = _fire(self.table, self._moments, 0)
        groups = np.ones(mujoco.mjNGROUP, np.uint8)
        groups[ROBOT_GROUP] = 0
        reach = _reach(mount.device, self._firing.directions)
        self._engine = ENGINES[config.engine](model, groups, reach, threads)

    def cast(
        self, data: mujoco.MjData, trail: Trail, seed: int, sequence: int
    ) -> NDArray[np.uint16]:  # (n,) mm
        """Cast one sweep; call `mujoco.mj_kinematics` first, geom poses lag a step behind.

        Args:
            data: The simulation at the sweep's end; whatever moves is met where it is then.
            trail: True poses of the base up to then, for a shutter that rolls.
            seed: The episode's.
            sequence: Number of the sweep.
        """
        return self._measure(data, trail, seed, sequence)[0]

    def cast_labelled(
        self, data: mujoco.MjData, trail: Trail, seed: int, sequence: int
    ) -> tuple[NDArray[np.uint16], NDArray[np.uint8]]:  # (n,) mm, (n,) classes
        """Cast one sweep, and tell the class of what each beam with a return met.

        Raises:
            ValueError: A geom's class is not one of `models.classes.CLASSES`.
        """
        ranges_mm, geom_id = self._measure(data, trail, seed, sequence)
        if self._classes is None:
            self._classes = class_of_geoms(self._model)
        returned = (ranges_mm != DROPPED) & (ranges_mm != NO_RETURN)
        return ranges_mm, np.where(returned, self._classes[geom_id], np.uint8(UNKNOWN_CLASS))

    def _measure(
        self, data: mujoco.MjData, trail: Trail, seed: int, sequence: int
    ) -> tuple[NDArray[np.uint16], NDArray[np.int32]]:
        """Ranges (n,), mm, and the geoms (n,) that the beams met."""
        if self.table.order == "pairs":
            self._firing = _fire(self.table, self._moments, sequence)
        origins, rotations = self._poses(data, trail)
        fades = self.mount.device.noise.grazing > 0.0  # only then normals are worth their time
        hits = self._engine.cast(data, self._firing, origins, rotations, normals=fades)
        rng = _draws(self.mount, seed, sequence)
        incidence = _incidence(hits, self._firing, rotations) if fades else None
        beams = self._firing.directions
        return measure(self.mount.device, hits.distance, incidence, beams, rng), hits.geom_id

    def _poses(
        self, data: mujoco.MjData, trail: Trail
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Where the sensor was at each moment: (m, 3) in m and (m, 3, 3), world."""
        if self.table.moments == 1:
            R_world_sensor = data.site_xmat[self._site].reshape(1, 3, 3)
            return data.site_xpos[self._site][None].copy(), R_world_sensor.copy()
        position_base_sensor, R_base_sensor = self.mounting
        positions, rotations = trail.before_now(self._ages)
        return positions + rotations @ position_base_sensor, rotations @ R_base_sensor


class TileEngine:
    """Sweeps by Wayproof's own caster."""

    def __init__(
        self, model: mujoco.MjModel, groups: NDArray[np.uint8], range: float, threads: int
    ) -> None:
        """Build the tables of geoms; see `TileCaster`."""
        self._caster = TileCaster(model, groups, range, threads)

    def cast(
        self,
        data: mujoco.MjData,
        firing: Firing,
        origins: NDArray[np.float64],
        rotations: NDArray[np.float64],
        normals: bool = False,
    ) -> Hits:
        """Cast a sweep from the poses of its moments."""
        if normals:
            return Hits(*self._caster.cast_with_normals(data, firing.pattern, origins, rotations))
        return Hits(*self._caster.cast(data, firing.pattern, origins, rotations), np.empty((0, 3)))


class MujocoEngine:
    """Sweeps by MuJoCo's own `mj_multiRay`, one call for each moment; on one thread."""

    def __init__(
        self, model: mujoco.MjModel, groups: NDArray[np.uint8], range: float, threads: int
    ) -> None:
        """Keep the geom groups (6,) and the range in m."""
        del threads  # MuJoCo's call knows none
        self._model = model
        self._groups = groups
        self._range = range

    def cast(
        self,
        data: mujoco.MjData,
        firing: Firing,
        origins: NDArray[np.float64],
        rotations: NDArray[np.float64],
        normals: bool = False,
    ) -> Hits:
        """Cast a sweep from the poses of its moments."""
        count = len(firing.moments)
        told = count if normals else 0
        hits = Hits(np.empty(count), np.empty(count, np.int32), np.empty((told, 3)))
        for moment, (origin, R_world_sensor) in enumerate(zip(origins, rotations, strict=True)):
            beams = np.flatnonzero(firing.moments == moment) if len(origins) > 1 else slice(None)
            rays = rotate(R_world_sensor, firing.directions[beams])
            part = self._cast_from(data, origin, rays, normals)
            hits.distance[beams], hits.geom_id[beams] = part.distance, part.geom_id
            if normals:
                hits.normals[beams] = part.normals
        return hits

    def _cast_from(
        self,
        data: mujoco.MjData,
        origin: NDArray[np.float64],
        rays: NDArray[np.float64],
        normals: bool,
    ) -> Hits:
        count = len(rays)
        distance, geom_id = np.empty(count), np.empty(count, np.int32)
        facing = np.empty(3 * count if normals else 0)
        mujoco.mj_multiRay(
            self._model, data, origin, rays.ravel(), self._groups, 1, -1,
            geom_id, distance, facing if normals else None, count, self._range,
        )  # fmt: skip
        return Hits(distance, geom_id, facing.reshape(-1, 3))


ENGINES: dict[str, type[TileEngine] | type[MujocoEngine]] = {
    "tile": TileEngine,
    "mujoco": MujocoEngine,
}
"""Ray engines by name."""


def _draws(mount: Mount, seed: int, sequence: int) -> np.random.Generator | None:
    """The random numbers of one sweep; none for an ideal device, which draws none."""
    if mount.device.noise == RangeNoise():
        return None
    return stream(seed, f"sensor/{mount.name}", sequence)


class RangefinderCaster:
    """Reads one `<rangefinder>` of the model as a sweep of one beam."""

    def __init__(self, model: mujoco.MjModel, mount: Mount, base: int, prefix: str) -> None:
        """Look the sensor up.

        Raises:
            KeyError: The model has no such sensor.
            ValueError: It does not sit on the base.
        """
        self.mount = mount
        self.table = mount.device.beam_table()
        self._directions = directions(self.table, 0)  # (1, 3)
        self._model = model
        mjcf_sensor = model.sensor(prefix + mount.name)
        self._address = int(mjcf_sensor.adr[0])
        self.mounting = _mounting(model, int(mjcf_sensor.objid[0]), base)

    def cast(
        self, data: mujoco.MjData, trail: Trail, seed: int, sequence: int
    ) -> NDArray[np.uint16]:  # (1,) mm
        """Read the beam at the poses that `mujoco.mj_kinematics` has just computed."""
        del trail  # one beam, one instant
        mujoco.mj_sensorPos(self._model, data)
        distance = data.sensordata[self._address : self._address + 1]
        rng = _draws(self.mount, seed, sequence)
        return measure(self.mount.device, distance, None, self._directions, rng)

    def cast_labelled(
        self, data: mujoco.MjData, trail: Trail, seed: int, sequence: int
    ) -> tuple[NDArray[np.uint16], NDArray[np.uint8]]:  # (1,) mm, (1,)
        """Read the beam; MuJoCo does not tell what it met."""
        ranges_mm = self.cast(data, trail, seed, sequence)
        return ranges_mm, np.full(1, UNKNOWN_CLASS, np.uint8)


Caster = SweepCaster | RangefinderCaster


def make_caster(
    model: mujoco.MjModel,
    mount: Mount,
    base: int,
    prefix: str,
    config: SensorConfig,
    threads: int = 1,
) -> Caster:
    """The caster of a mounted device.

    Raises:
        KeyError: The model lacks the site or the sensor.
        ValueError: The device is not on the base, or the engine cannot cast the model.
    """
    if isinstance(mount.device, Rangefinder):
        return RangefinderCaster(model, mount, base, prefix)
    return SweepCaster(model, mount, base, prefix, config, threads)


def _fire(table: BeamTable, moment: NDArray[np.int32], sequence: int) -> Firing:
    beams = directions(table, sequence)
    if table.order == "grid":
        pattern = cut_grid(beams, len(table.rows), len(table.columns), moment)
    else:
        pattern = cut_scattered(beams, moment)
    return Firing(beams, moment, pattern)


def _incidence(
    hits: Hits, firing: Firing, rotations: NDArray[np.float64]
) -> NDArray[np.float64]:  # (n,)
    """Cosine of the angle between each beam and the normal where it hit; 0 for a miss."""
    R = rotations[firing.moments] if len(rotations) > 1 else rotations[0]
    cosine: NDArray[np.float64] = (rotate(R, firing.directions) * hits.normals).sum(axis=1)
    return cosine


def _reach(device: Device, beams: NDArray[np.float64]) -> float:
    """How far a beam can measure, m; the limit of a depth lies farther out along slanted ones."""
    return float(device.range / beams[:, 0].min()) if device.measures == "depth" else device.range


def _mounting(
    model: mujoco.MjModel, site: int, base: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Position (3,) and rotation (3, 3) of a site in the frame of the body that carries it."""
    if model.site_bodyid[site] != base:
        name = model.site(site).name
        raise ValueError(f"sensor site '{name}' is on another body than the base")
    R_base_site = np.empty(9)
    mujoco.mju_quat2Mat(R_base_site, model.site_quat[site])
    return model.site_pos[site].copy(), R_base_site.reshape(3, 3)
