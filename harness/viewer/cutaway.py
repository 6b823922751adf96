"""Cutaway views: geometry above the robot is cut off, so that walls do not hide it."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

Boxes = NDArray[np.float64]

UPRIGHT = 0.999
"""Minimum cosine between the axis of a geom and the vertical for it to be cut."""

CUT = (mujoco.mjtGeom.mjGEOM_BOX, mujoco.mjtGeom.mjGEOM_CYLINDER)
"""Types of geoms with a flat top, whose third size is half their height."""


def cut_scene(scene: Any, height: float, kept: frozenset[int]) -> None:
    """Cut upright geoms of a scene at a height, m, and hide those above it, in place.

    Args:
        scene: An `mujoco.MjvScene`, whose geoms are changed; the model is not.
        height: Above the floor, m.
        kept: Ids of geoms that stay whole, such as the robot's.
    """
    for geom in scene.geoms[: scene.ngeom]:
        if geom.type not in CUT or geom.objid in kept or abs(geom.mat[2, 2]) < UPRIGHT:
            continue
        low, high = geom.pos[2] - geom.size[2], geom.pos[2] + geom.size[2]
        if low >= height:
            geom.rgba[3] = 0.0
        elif high > height:
            geom.pos[2], geom.size[2] = 0.5 * (low + height), 0.5 * (height - low)


def cut_boxes(middles: Boxes, halves: Boxes, height: float) -> tuple[Boxes, Boxes]:
    """Return the parts of boxes below a height.

    Args:
        middles: (n, 3) m.
        halves: (n, 3) half extents, m.
        height: m.

    Returns:
        Middles and half extents of the parts below it.
    """
    low = middles[:, 2] - halves[:, 2]
    high = np.minimum(middles[:, 2] + halves[:, 2], height)
    left = low < height
    middles, halves = middles.copy(), halves.copy()
    middles[:, 2], halves[:, 2] = 0.5 * (low + high), 0.5 * (high - low)
    return middles[left], halves[left]
