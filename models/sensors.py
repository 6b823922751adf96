"""Casting the beams of a robot's sensors against MuJoCo's geometry.

A sweep leaves here quantised, because the map must see exactly the values that the log holds.
"""

from __future__ import annotations

import mujoco
import numpy as np
from numpy.typing import NDArray

from models.beams import (
    DepthCamera,
    Lidar,
    Rangefinder,
    SweepSensor,
    beam_directions,
    quantise,
    rotate,
)

__all__ = [
    "ROBOT_GROUP",
    "DepthCamera",
    "Lidar",
    "Rangefinder",
    "RangefinderCaster",
    "SweepCaster",
    "SweepSensor",
]

ROBOT_GROUP = 3
"""Geom group of every robot geom, so that no beam sees the body that carries it."""


class SweepCaster:
    """Casts one sensor's beams against MuJoCo's geometry from where its site is now."""

    def __init__(self, model: mujoco.MjModel, sensor: SweepSensor, site_prefix: str = "") -> None:
        """Build the beam table once.

        Raises:
            KeyError: The model has no such site.
        """
        self.sensor = sensor
        self.directions = beam_directions(*sensor.beam_tables())  # (n, 3), sensor frame
        self._model = model
        self._site = model.site(site_prefix + sensor.site).id
        self._geom_ids = np.empty(len(self.directions), np.int32)
        self._distance = np.empty(len(self.directions))
        groups = np.ones(mujoco.mjNGROUP, np.uint8)
        groups[ROBOT_GROUP] = 0
        self._groups = groups

    def cast(self, data: mujoco.MjData) -> NDArray[np.uint16]:  # (n,)
        """Cast one sweep; call `mujoco.mj_kinematics` first, geom poses lag a step behind."""
        R_world_sensor = data.site_xmat[self._site].reshape(3, 3)
        rays = rotate(R_world_sensor, self.directions)
        mujoco.mj_multiRay(
            self._model,
            data,
            data.site_xpos[self._site],
            rays.ravel(),
            self._groups,
            1,
            -1,
            self._geom_ids,
            self._distance,
            None,
            len(rays),
            self.sensor.range,
        )
        return quantise(self._distance, self.sensor.range)

    def mounting(self, base: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Position (3,) and rotation (3, 3) of the sensor in the frame of body `base`."""
        return _mounting(self._model, self._site, base)


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
