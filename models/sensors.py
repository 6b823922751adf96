"""Casting the beams of a robot's sensors against MuJoCo's geometry.

A sweep leaves here quantised, because the map must see exactly the values that the log holds.
"""

from __future__ import annotations

from typing import Literal

import mujoco
import numpy as np
from numpy.typing import NDArray

from models.beams import (
    DepthCamera,
    Lidar,
    Rangefinder,
    SensorConfig,
    SweepSensor,
    beam_directions,
    quantise,
    rotate,
)
from models.rays import TileCaster, cut_grid

__all__ = [
    "ROBOT_GROUP",
    "DepthCamera",
    "Lidar",
    "MujocoCaster",
    "Rangefinder",
    "RangefinderCaster",
    "SensorConfig",
    "SweepCaster",
    "SweepSensor",
]

ROBOT_GROUP = 3
"""Geom group of every robot geom, so that no beam sees the body that carries it."""


class SweepCaster:
    """Casts one sensor's beams against MuJoCo's geometry from where its site is now."""

    def __init__(
        self,
        model: mujoco.MjModel,
        sensor: SweepSensor,
        site_prefix: str = "",
        engine: Literal["tile", "mujoco"] = "tile",
    ) -> None:
        """Build the beam table once.

        Raises:
            KeyError: The model has no such site.
            ValueError: Engine `tile` meets a geom that only MuJoCo's engine can cast.
        """
        self.sensor = sensor
        tables = sensor.beam_tables()
        self.directions = beam_directions(*tables)  # (n, 3), sensor frame
        self._site = model.site(site_prefix + sensor.site).id
        self._model = model
        groups = np.ones(mujoco.mjNGROUP, np.uint8)
        groups[ROBOT_GROUP] = 0
        self._tile: TileCaster | None = None
        if engine == "tile":
            self._tile = TileCaster(model, groups, sensor.range)
            self._pattern = cut_grid(self.directions, *(len(table) for table in tables))
        else:
            self._mujoco = MujocoCaster(model, self.directions, groups, sensor.range)

    def cast(self, data: mujoco.MjData) -> NDArray[np.uint16]:  # (n,)
        """Cast one sweep; call `mujoco.mj_kinematics` first, geom poses lag a step behind."""
        R_world_sensor = data.site_xmat[self._site].reshape(3, 3)
        origin = data.site_xpos[self._site]
        if self._tile is not None:
            distance, _ = self._tile.cast(data, self._pattern, origin, R_world_sensor)
        else:
            distance, _ = self._mujoco.cast(data, origin, R_world_sensor)
        return quantise(distance, self.sensor.range)

    def mounting(self, base: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Position (3,) and rotation (3, 3) of the sensor in the frame of body `base`."""
        return _mounting(self._model, self._site, base)


class MujocoCaster:
    """Casts beams by MuJoCo's own `mj_multiRay`, against every shape that MuJoCo knows."""

    def __init__(
        self,
        model: mujoco.MjModel,
        directions: NDArray[np.float64],
        group_mask: NDArray[np.uint8],
        range: float,
    ) -> None:
        """Keep the beams (n, 3) in the sensor frame, the geom groups (6,) and the range in m."""
        self._model = model
        self._directions = directions
        self._groups = group_mask
        self._range = range

    def cast(
        self, data: mujoco.MjData, origin: NDArray[np.float64], R_world_sensor: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
        """Distances (n,) in m, some of them beyond range, and geom ids (n,); -1 for a miss."""
        rays = rotate(R_world_sensor, self._directions)
        distance, geom_id = np.empty(len(rays)), np.empty(len(rays), np.int32)
        mujoco.mj_multiRay(
            self._model,
            data,
            origin,
            rays.ravel(),
            self._groups,
            1,
            -1,
            geom_id,
            distance,
            None,
            len(rays),
            self._range,
        )
        return distance, geom_id


class RangefinderCaster:
    """Reads one `<rangefinder>` of the model as a sweep of one beam."""

    def __init__(self, model: mujoco.MjModel, sensor: Rangefinder, prefix: str = "") -> None:
        """Look the sensor up.

        Raises:
            KeyError: The model has no such sensor.
        """
        self.sensor = sensor
        self.directions = beam_directions(*sensor.beam_tables())  # (1, 3)
        self._model = model
        mjcf_sensor = model.sensor(prefix + sensor.name)
        self._site = int(mjcf_sensor.objid[0])
        self._address = int(mjcf_sensor.adr[0])

    def cast(self, data: mujoco.MjData) -> NDArray[np.uint16]:  # (1,)
        """Read the beam at the poses that `mujoco.mj_kinematics` has just computed."""
        mujoco.mj_sensorPos(self._model, data)
        return quantise(data.sensordata[self._address : self._address + 1], self.sensor.range)

    def mounting(self, base: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Position (3,) and rotation (3, 3) of the sensor in the frame of body `base`."""
        return _mounting(self._model, self._site, base)


Caster = SweepCaster | RangefinderCaster


def _mounting(
    model: mujoco.MjModel, site: int, base: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Pose of a site that is fixed to the base, T_base_site."""
    if model.site_bodyid[site] != base:
        name = model.site(site).name
        raise ValueError(f"sensor site '{name}' is on another body than the base")
    R_base_site = np.empty(9)
    mujoco.mju_quat2Mat(R_base_site, model.site_quat[site])
    return model.site_pos[site].copy(), R_base_site.reshape(3, 3)
