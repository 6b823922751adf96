"""Outlines of a scene's geometry from above, for pictures."""

from __future__ import annotations

import mujoco
import numpy as np
from numpy.typing import NDArray

TALLEST_FLOOR = 0.05
"""Height below which a geom counts as floor, m."""


def outlines(
    model: mujoco.MjModel, data: mujoco.MjData, shown: NDArray[np.bool_]
) -> list[NDArray[np.float64]]:
    """Return the outlines (4, 2) of geoms but planes: boxes exactly, others by their bounds.

    Args:
        model: World and robot.
        data: Poses of the geoms.
        shown: (geoms,) the ones to outline.
    """
    found = []
    for geom in np.flatnonzero(shown):
        if model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_PLANE:
            continue
        centre, half = model.geom_aabb[geom, :3], model.geom_aabb[geom, 3:]
        R = data.geom_xmat[geom].reshape(3, 3)
        if data.geom_xpos[geom][2] + np.abs(R[2]) @ half < TALLEST_FLOOR:
            continue
        corners = centre + half * [[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]
        found.append((data.geom_xpos[geom] + corners @ R.T)[:, :2])
    return found
