"""Casters: sweeps of a robot's mounted sensors against MuJoCo's geometry.

A sweep leaves here as the device reports it, quantised, because the map must see exactly the values
that the log holds.
"""

from __future__ import annotations

import mujoco
import numpy as np
from numpy.typing import NDArray

from wayproof.models.arrays import Array
from wayproof.models.classes import UNKNOWN_CLASS, class_of_geoms
from wayproof.models.poses import Trail
from wayproof.models.random_streams import stream
from wayproof.models.rays import Pattern, TileCaster, cut_grid, cut_scattered
from wayproof.models.sensors.beams import (
    DROPPED,
    NO_RETURN,
    BeamTable,
    directions,
    pose_indices,
    pose_offsets,
    rotate,
)
from wayproof.models.sensors.devices import Device, Mount, RangeNoise, SensorConfig
from wayproof.models.sensors.measure import measure

ROBOT_GROUP = 3
"""Geom group of every robot geom, so that no beam sees the body that carries it."""


class SweepCaster:
    """Caster of one mounted sensor by a ray engine."""

    def __init__(
        self,
        model: mujoco.MjModel,
        mount: Mount,
        base: int,
        prefix: str,
        config: SensorConfig,
        stride: int = 1,
    ) -> None:
        """Build the tables once.

        Args:
            model: World and robot.
            mount: The device and its site.
            base: Body id of the robot's base, which carries the site.
            prefix: Prefix of every name of the robot in the model.
            config: Ray engine.
            stride: Columns of a grid from one that is cast to the next.

        Raises:
            KeyError: The model has no such site.
            ValueError: The site is not on the base, or the engine cannot cast one of the geoms.
        """
        self.mount = mount
        self.table = mount.device.beam_table().with_every(stride)
        self._model = model
        self._classes: NDArray[np.uint8] | None = None  # by geom
        self._pose_indices = pose_indices(self.table)
        self._site = model.site(prefix + mount.site).id
        self.mounting = _mounting(model, self._site, base)
        self._ages = -1e-9 * pose_offsets(self.table, round(1e9 / mount.device.rate))
        self._beams, self._pattern = _fire(self.table, self._pose_indices, 0)
        groups = np.ones(mujoco.mjNGROUP, np.uint8)
        groups[ROBOT_GROUP] = 0
        reach = _reach(mount.device, self._beams)
        # Only MuJoCo's caster tells how a beam meets a surface.
        self._normals = MujocoCaster(model, groups, reach) if mount.device.noise.grazing else None
        self._engine = ENGINES[config.engine](model, groups, reach)

    def cast(
        self, data: mujoco.MjData, trail: Trail, seed: int, sequence: int
    ) -> NDArray[np.uint16]:  # (n,) mm
        """Cast one sweep; call `mujoco.mj_kinematics` first, geom poses lag a step behind.

        Args:
            data: The simulation at the sweep's end; movers are met where they are then.
            trail: True poses of the base up to then, for a rolling shutter.
            seed: Seed of the episode.
            sequence: Number of the sweep.
        """
        return self._measure(data, trail, seed, sequence)[0]

    def cast_labelled(
        self, data: mujoco.MjData, trail: Trail, seed: int, sequence: int
    ) -> tuple[NDArray[np.uint16], NDArray[np.uint8]]:  # (n,) mm, (n,) classes
        """Cast one sweep, with the class of the geom that each returning beam met.

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
        """Return ranges (n,), mm, and the geoms (n,) that the beams met."""
        if self.table.non_repetitive:
            self._beams, self._pattern = _fire(self.table, self._pose_indices, sequence)
        origins, rotations = self._scan_poses(data, trail)
        sweep = data, self._pattern, origins, rotations
        incidence = None
        if self._normals is not None:
            distance, geom_id, normals = self._normals.cast_with_normals(*sweep)
            incidence = self._incidence(normals, rotations)
        else:
            distance, geom_id = self._engine.cast(*sweep)
        rng = _draws(self.mount, seed, sequence)
        return measure(self.mount.device, distance, incidence, self._beams, rng), geom_id

    def _incidence(self, normals: Array, rotations: Array) -> Array:  # (n,)
        """Return the cosine between each beam and the normal where it hit; 0 for a miss."""
        R = rotations[self._pose_indices] if len(rotations) > 1 else rotations[0]
        cosine: Array = (rotate(R, self._beams) * normals).sum(axis=1)
        return cosine

    def _scan_poses(self, data: mujoco.MjData, trail: Trail) -> tuple[Array, Array]:
        """Return the sensor's positions (m, 3), m, and rotations (m, 3, 3) in the world."""
        if self.table.scan_poses == 1:
            R_world_sensor = data.site_xmat[self._site].reshape(1, 3, 3)
            return data.site_xpos[self._site][None].copy(), R_world_sensor.copy()
        position_base_sensor, R_base_sensor = self.mounting
        positions, rotations = trail.before_now(self._ages)
        return positions + rotations @ position_base_sensor, rotations @ R_base_sensor


class RangefinderCaster:
    """Caster of one `<rangefinder>` of the model, as a sweep of one beam."""

    def __init__(
        self,
        model: mujoco.MjModel,
        mount: Mount,
        base: int,
        prefix: str,
        config: SensorConfig,
        stride: int = 1,
    ) -> None:
        """Look the sensor up; `config` and `stride` do not concern it.

        Raises:
            KeyError: The model has no such sensor.
            ValueError: It does not sit on the base.
        """
        del config, stride
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
        """Read the beam; MuJoCo does not report which geom it met, so the class is unknown."""
        ranges_mm = self.cast(data, trail, seed, sequence)
        return ranges_mm, np.full(1, UNKNOWN_CLASS, np.uint8)


Caster = SweepCaster | RangefinderCaster


def make_caster(
    model: mujoco.MjModel,
    mount: Mount,
    base: int,
    prefix: str,
    config: SensorConfig,
    stride: int = 1,
) -> Caster:
    """Return the caster of a mounted device, or of every `stride`-th column of its grid.

    Raises:
        KeyError: The model lacks the site or the sensor.
        ValueError: The device is not on the base, or the engine cannot cast the model.
    """
    caster = RangefinderCaster if mount.device.by_mujoco else SweepCaster
    return caster(model, mount, base, prefix, config, stride)


def _draws(mount: Mount, seed: int, sequence: int) -> np.random.Generator | None:
    """Return the random numbers of one sweep; none for an ideal device, which draws none."""
    if mount.device.noise == RangeNoise():
        return None
    return stream(seed, f"sensor/{mount.name}", sequence)


def _fire(table: BeamTable, indices: NDArray[np.int32], sequence: int) -> tuple[Array, Pattern]:
    """Return the beams (n, 3) of a sweep, sensor frame, and the same cut into tiles."""
    beams = directions(table, sequence)
    if table.non_repetitive:
        return beams, cut_scattered(beams, indices)
    return beams, cut_grid(beams, len(table.rows), len(table.columns), indices)


def _reach(device: Device, beams: Array) -> float:
    """Return the longest distance along a beam, m; a depth's limit is farther on slanted ones."""
    return float(device.range / beams[:, 0].min()) if device.measures == "depth" else device.range


def _mounting(model: mujoco.MjModel, site: int, base: int) -> tuple[Array, Array]:
    """Return position (3,) and rotation (3, 3) of a site in the frame of its body."""
    if model.site_bodyid[site] != base:
        name = model.site(site).name
        raise ValueError(f"site '{name}' of a sensor: got another body, expected the base")
    R_base_site = np.empty(9)
    mujoco.mju_quat2Mat(R_base_site, model.site_quat[site])
    return model.site_pos[site].copy(), R_base_site.reshape(3, 3)


class MujocoCaster:
    """Caster of sweeps by `mj_multiRay`, one call for each scan pose; see `TileCaster`."""

    def __init__(self, model: mujoco.MjModel, group_mask: NDArray[np.uint8], range: float) -> None:
        """Keep the geom groups (6,) and the range in m, beyond which some hits may lie."""
        self._model = model
        self._groups = group_mask
        self._range = range

    def cast(
        self, data: mujoco.MjData, pattern: Pattern, origins: Array, R_world_sensor: Array
    ) -> tuple[Array, NDArray[np.int32]]:
        """Cast a sweep from its scan poses, origins (m, 3) in m and rotations (m, 3, 3), world."""
        return self._cast(data, pattern, origins, R_world_sensor, normals=False)[:2]

    def cast_with_normals(
        self, data: mujoco.MjData, pattern: Pattern, origins: Array, R_world_sensor: Array
    ) -> tuple[Array, NDArray[np.int32], Array]:
        """Cast a sweep as `cast` does, with the normals (n, 3) of what the beams meet."""
        return self._cast(data, pattern, origins, R_world_sensor, normals=True)

    def _cast(
        self, data: mujoco.MjData, pattern: Pattern, origins: Array, rotations: Array, normals: bool
    ) -> tuple[Array, NDArray[np.int32], Array]:
        count = len(pattern.places)
        distance, geom_id = np.empty(count), np.empty(count, np.int32)
        facing = np.empty((count, 3))
        for pose, (origin, R) in enumerate(zip(origins, rotations, strict=True)):
            rolling = len(origins) > 1
            beams = np.flatnonzero(pattern.pose_indices == pose) if rolling else slice(None)
            rays, places = rotate(R, pattern.beams.T[beams]), pattern.places[beams]
            own_distance, own_id = np.empty(len(rays)), np.empty(len(rays), np.int32)
            own_facing = np.empty(3 * len(rays)) if normals else None
            mujoco.mj_multiRay(
                self._model, data, origin, rays.ravel(), self._groups, 1, -1,
                own_id, own_distance, own_facing, len(rays), self._range,
            )  # fmt: skip
            distance[places], geom_id[places] = own_distance, own_id
            if own_facing is not None:
                facing[places] = own_facing.reshape(-1, 3)
        return distance, geom_id, facing


ENGINES: dict[str, type[TileCaster] | type[MujocoCaster]] = {
    "tile": TileCaster,
    "mujoco": MujocoCaster,
}
"""Ray engines by the name that `SensorConfig.engine` takes."""
