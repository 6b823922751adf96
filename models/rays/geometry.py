"""Ray-visible geoms of a model as plain tables."""

from __future__ import annotations

import mujoco
import numpy as np
from numpy.typing import NDArray

from wayproof.models.rays.records import Geoms
from wayproof.models.rays.soup import SHAPES, gather

PRIMITIVES = tuple(
    int(kind)
    for kind in (
        mujoco.mjtGeom.mjGEOM_PLANE,
        mujoco.mjtGeom.mjGEOM_SPHERE,
        mujoco.mjtGeom.mjGEOM_CAPSULE,
        mujoco.mjtGeom.mjGEOM_ELLIPSOID,
        mujoco.mjtGeom.mjGEOM_CYLINDER,
        mujoco.mjtGeom.mjGEOM_BOX,
    )
)

ENDLESS = 1e10
"""Half side of an infinite plane, m, for bounds: farther than any beam, and no 0 * infinity."""


class Geometry:
    """The ray-visible geoms of one model, posed where they are now.

    Flexes and skins are no geoms: neither `mujoco.mj_ray` nor this meets them.

    Attributes:
        geoms: Tables.
        soup: Triangles of meshes and height fields; None without any.
    """

    def __init__(self, model: mujoco.MjModel, group_mask: NDArray[np.uint8]) -> None:
        """Build the tables and pose what never moves.

        Args:
            model: Its static geoms and its heights must stay as they are.
            group_mask: (6,) non-zero for each geom group that beams meet.

        Raises:
            ValueError: A geom is neither a primitive nor a mesh nor a height field; or the mask's
                shape.
        """
        ids = visible(model, group_mask)
        _refuse_others(model, ids)
        # By a joint or with a mocap body: MuJoCo counts neither as welded to the world.
        moving = model.body_weldid[model.geom_bodyid[ids]] != 0
        self._moving_rows = np.flatnonzero(moving)
        self._moving_ids = ids[moving]
        axes, sides = _bodies(model.geom_type[ids], model.geom_size[ids])
        radii, roots = model.geom_rbound[ids], np.full(len(ids), -1, np.int32)
        of_triangles = np.flatnonzero(np.isin(model.geom_type[ids], SHAPES))
        self.soup, roots[of_triangles], sides[of_triangles] = gather(model, ids[of_triangles])
        radii[of_triangles] = np.linalg.norm(sides[of_triangles], axis=1)
        self.geoms = Geoms(
            ids=ids,
            kinds=model.geom_type[ids].astype(np.int32),
            sizes=model.geom_size[ids],
            axes=axes,
            sides=sides,
            radii=radii,
            roots=roots,
            positions=np.empty((len(ids), 3)),
            rotations=np.empty((len(ids), 9)),
        )
        self._spheres = np.flatnonzero(self.geoms.kinds == mujoco.mjtGeom.mjGEOM_SPHERE)
        at_rest = mujoco.MjData(model)
        mujoco.mj_kinematics(model, at_rest)
        self._take(at_rest, np.arange(len(ids)), ids)

    def refresh(self, data: mujoco.MjData) -> None:
        """Update the poses of all that can move."""
        if len(self._moving_rows):
            self._take(data, self._moving_rows, self._moving_ids)

    def _take(self, data: mujoco.MjData, rows: NDArray[np.intp], ids: NDArray[np.int32]) -> None:
        self.geoms.positions[rows] = data.geom_xpos[ids]
        self.geoms.rotations[rows] = data.geom_xmat[ids]
        self.geoms.rotations[self._spheres] = np.eye(3).ravel()


def visible(model: mujoco.MjModel, group_mask: NDArray[np.uint8]) -> NDArray[np.int32]:
    """Return the ids of the geoms that `mj_ray` would consider.

    Groups outside 0..5 count as the nearest of these, as in MuJoCo, which the tests hold.
    """
    if np.shape(group_mask) != (mujoco.mjNGROUP,):
        raise ValueError(
            f"group_mask: got shape {np.shape(group_mask)}, expected ({mujoco.mjNGROUP},)"
        )
    group = np.clip(model.geom_group, 0, mujoco.mjNGROUP - 1)
    return np.flatnonzero(opaque(model) & (group_mask[group] != 0)).astype(np.int32)


def opaque(model: mujoco.MjModel) -> NDArray[np.bool_]:
    """Return geoms (g,) that rays meet at all; a material's alpha replaces the geom's own."""
    alpha = model.geom_rgba[:, 3].copy()
    has_material = model.geom_matid >= 0
    alpha[has_material] = model.mat_rgba[model.geom_matid[has_material], 3]
    return np.asarray(alpha != 0.0)


def _refuse_others(model: mujoco.MjModel, ids: NDArray[np.int32]) -> None:
    for geom in ids:
        if int(model.geom_type[geom]) not in PRIMITIVES + SHAPES:
            name = model.geom(geom).name or f"number {geom}"
            raise ValueError(
                f"geom '{name}': got shape {shape_name(model, geom)}, expected a primitive, a mesh "
                "or a height field; ray engine 'mujoco' casts it"
            )


def shape_name(model: mujoco.MjModel, geom: int) -> str:
    """Return MuJoCo's name of a geom's shape, such as `mesh`."""
    kind = mujoco.mjtGeom(int(model.geom_type[geom]))
    return str(kind.name.removeprefix("mjGEOM_").lower())


def _bodies(
    kinds: NDArray[np.int32], sizes: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return half axes of the ellipsoid and half sides of the box that sum to each geom, (g, 3)."""
    axes, sides = np.zeros_like(sizes), np.zeros_like(sizes)
    for g, (kind, size) in enumerate(zip(kinds, sizes, strict=True)):
        if kind == mujoco.mjtGeom.mjGEOM_SPHERE:
            axes[g] = size[0]
        elif kind == mujoco.mjtGeom.mjGEOM_CAPSULE:
            axes[g], sides[g, 2] = size[0], size[1]
        elif kind == mujoco.mjtGeom.mjGEOM_ELLIPSOID:
            axes[g] = size
        elif kind == mujoco.mjtGeom.mjGEOM_CYLINDER:
            axes[g, :2], sides[g, 2] = size[0], size[1]
        elif kind == mujoco.mjtGeom.mjGEOM_BOX:
            sides[g] = size
        elif kind == mujoco.mjtGeom.mjGEOM_PLANE:
            sides[g, :2] = np.where(size[:2] > 0.0, size[:2], ENDLESS)
    return axes, sides
