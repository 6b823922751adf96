"""What stands between a camera and what it looks at."""

from __future__ import annotations

import math

import mujoco
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

ASIDE = 0.5
"""Beside the middle of the picture nothing shall hide the robot either, m."""


def geoms_in_front(
    model: mujoco.MjModel, data: mujoco.MjData, camera: mujoco.MjvCamera, reach: float
) -> list[int]:
    """Geoms on three rays from a free camera to its target, and a little to its left and right.

    Args:
        model: What is found loses its material and is made invisible, so that it stops no ray.
        data: Where everything is.
        camera: It looks at `lookat` from `distance`, m, by `azimuth` and `elevation`, degrees.
        reach: What is nearer to the target is not in front of it but part of it, m.
    """
    azimuth, elevation = math.radians(camera.azimuth), math.radians(camera.elevation)
    level = math.cos(elevation)
    ahead = np.array([level * math.cos(azimuth), level * math.sin(azimuth), math.sin(elevation)])
    aside = np.array([-math.sin(azimuth), math.cos(azimuth), 0.0])
    found: list[int] = []
    hit = np.zeros(1, np.int32)
    far = camera.distance - reach
    for step in (-ASIDE, 0.0, ASIDE):
        eye = camera.lookat - camera.distance * ahead + step * aside
        while 0.0 <= mujoco.mj_ray(model, data, eye, ahead, None, 1, -1, hit) < far:
            found.append(int(hit[0]))
            model.geom_matid[found[-1]] = -1  # or the material's colour would count
            model.geom_rgba[found[-1], 3] = 0.0
    return found
