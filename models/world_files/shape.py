"""The shape of a world: one digest for all copies and spellings of it."""

from __future__ import annotations

import functools
import hashlib

import mujoco
import numpy as np
from numpy.typing import NDArray

KEPT = 64
"""Number of scenes whose digests a process keeps."""

PLACES = 3
"""Decimals to which lengths and directions are compared: millimetres."""


@functools.lru_cache(KEPT)
def shape_digest(scene: str) -> str:
    """Return a digest of what stands still in a scene, to the millimetre.

    It depends neither on names, order, colours, comments and number formats of the text, nor on
    start and goal. Robots move, and are left out.

    Args:
        scene: Text of an MJCF that names no other file.
    """
    model = mujoco.MjModel.from_xml_string(scene)
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    still = np.flatnonzero(model.body_weldid[model.geom_bodyid] == 0)
    model.geom_size[model.geom_type == mujoco.mjtGeom.mjGEOM_PLANE] = (
        0.0  # which is how it is drawn
    )
    parts = [
        b"%d" % model.geom_type[n]
        + _rounded(np.concatenate([data.geom_xpos[n], data.geom_xmat[n], model.geom_size[n]]))
        + _asset(model, int(model.geom_type[n]), int(model.geom_dataid[n]))
        for n in still
    ]
    return hashlib.sha256(b"".join(sorted(parts))).hexdigest()[:16]


def _asset(model: mujoco.MjModel, kind: int, number: int) -> bytes:
    """Return the vertices of a mesh or the heights of a field; nothing of another geom."""
    if kind == mujoco.mjtGeom.mjGEOM_MESH:
        first, count = model.mesh_vertadr[number], model.mesh_vertnum[number]
        return _rounded(model.mesh_vert[first : first + count].ravel())
    if kind == mujoco.mjtGeom.mjGEOM_HFIELD:
        rows, columns = model.hfield_nrow[number], model.hfield_ncol[number]
        first = model.hfield_adr[number]
        size = _rounded(model.hfield_size[number])
        return size + _rounded(model.hfield_data[first : first + rows * columns])
    return b""


def _rounded(values: NDArray[np.floating]) -> bytes:
    return (np.round(np.asarray(values, np.float64), PLACES) + 0.0).tobytes()  # -0 becomes 0
