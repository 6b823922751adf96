"""Occlusion: geoms between a camera and its target."""

from __future__ import annotations

import math

import mujoco
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

ASIDE = 0.5
"""Offset of the side rays from the middle of the picture, m."""


def geoms_in_front(
    model: mujoco.MjModel, data: mujoco.MjData, camera: mujoco.MjvCamera, reach: float
) -> list[int]:
    """Return the geoms on three rays from a free camera to its target, and left and right of it.

    Args:
        model: The model; geoms found lose their material and become invisible, in place.
        data: State of the model.
        camera: Camera at `distance`, m, from `lookat`, by `azimuth` and `elevation`, degrees.
        reach: Distance from the target within which geoms belong to it, m.
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
            model.geom_matid[found[-1]] = -1  # otherwise its colour would apply
            model.geom_rgba[found[-1], 3] = 0.0
    return found
