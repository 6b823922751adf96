"""Caster of single rays, of any origins and directions, against every shape but SDFs."""

from __future__ import annotations

import mujoco
import numpy as np
from numpy.typing import NDArray

from wayproof.harness.bench.raycast.kernels import GeomTree, RayGeoms, cast_rays
from wayproof.models.arrays import Array
from wayproof.models.rays.geometry import PRIMITIVES, visible
from wayproof.models.rays.lanes import Beams, SurfaceHits
from wayproof.models.rays.normals import surface_normals
from wayproof.models.rays.shapes import PLANE, SPHERE
from wayproof.models.rays.surfaces import Surfaces
from wayproof.models.rays.tree import build_tree

RAYS_AT_A_TIME = 64
"""Rays that are met with triangles in one run, as the beams of a tile are."""

UNIT_TOLERANCE = 1e-9
"""Tolerance of a direction's length, which is 1."""


class RayCaster:
    """Casts any rays against a model's planes, primitives, meshes and height fields.

    Distances agree with `mujoco.mj_ray` to the last digits and geom ids but for ties, of which the
    lower id wins. One thread; the same inputs give the same bits. For sweeps whose beams leave one
    point, a tile caster is several times as fast.
    """

    def __init__(self, model: mujoco.MjModel, group_mask: NDArray[np.uint8], range: float) -> None:
        """Build the tables of geoms once.

        Args:
            model: Its static geoms and its heights must stay as they are.
            group_mask: (6,) non-zero for each geom group that rays meet.
            range: Longest distance of a hit, m.

        Raises:
            ValueError: A ray-visible geom is an SDF, which only MuJoCo's caster can do; the range
                is not finite and positive; or the mask's shape.
        """
        if not 0.0 < range < np.inf:
            raise ValueError(f"range: got {range:g}, expected a finite length > 0 m")
        self._surfaces = Surfaces(model, group_mask)
        seen = visible(model, group_mask)
        self._ids = seen[np.isin(model.geom_type[seen], PRIMITIVES)]
        self._kinds = model.geom_type[self._ids].astype(np.int32)
        self._sizes = model.geom_size[self._ids]
        self._bounds = _bounds(model, self._ids)
        self._moves = bool((model.body_weldid[model.geom_bodyid[self._ids]] != 0).any())
        at_rest = mujoco.MjData(model)
        mujoco.mj_kinematics(model, at_rest)
        self._take(at_rest)
        self._range = float(range)

    def cast(
        self, data: mujoco.MjData, origins: Array, directions: Array
    ) -> tuple[Array, NDArray[np.int32]]:
        """Cast rays; call `mujoco.mj_kinematics` first, geom poses lag a step behind.

        Args:
            data: Geom poses of all that moves.
            origins: (n, 3) in the world, m.
            directions: (n, 3) unit vectors in the world.

        Returns:
            Distances (n,) in m and geom ids (n,); -1 and -1 for a miss.

        Raises:
            ValueError: The shapes; or a ray is not finite or has no direction of length 1.
        """
        distance, geom_id, _ = self._cast(data, *_checked(origins, directions))
        return distance, geom_id

    def cast_with_normals(
        self, data: mujoco.MjData, origins: Array, directions: Array
    ) -> tuple[Array, NDArray[np.int32], Array]:
        """Cast rays as `cast` does, with the normals of the surfaces that they hit.

        Returns:
            Distances (n,), geom ids (n,) and normals (n, 3) as `surface_normals` gives them.
        """
        origins, directions = _checked(origins, directions)
        distance, geom_id, face = self._cast(data, origins, directions)
        hits = surface_normals(
            data, self._surfaces, geom_id, face, points=origins + distance[:, None] * directions
        )
        return distance, geom_id, hits

    def _cast(
        self, data: mujoco.MjData, origins: Array, directions: Array
    ) -> tuple[Array, NDArray[np.int32], NDArray[np.int32]]:
        if self._moves:
            self._take(data)
        self._surfaces.refresh(data)
        count = len(origins)
        distance, geom_id = np.empty(count), np.empty(count, np.int32)
        face = np.full(count, -1, np.int32)
        geoms = RayGeoms(self._ids, self._kinds, self._sizes, self._positions, self._rotations)
        cast_rays(origins, directions, geoms, self._tree, self._range, distance, geom_id)
        self._meet_surfaces(origins, directions, SurfaceHits(distance, geom_id, face))
        return distance, geom_id, face

    def _meet_surfaces(self, origins: Array, directions: Array, hits: SurfaceHits) -> None:
        """Keep nearer hits on triangles; each ray is a beam of its own sensor, not turned."""
        count = len(origins)
        starts = np.append(np.arange(0, count, RAYS_AT_A_TIME), count)
        beams = Beams(
            directions=np.ascontiguousarray(directions.T),
            places=np.arange(count),
            pose_indices=np.arange(count, dtype=np.int32),
            origins=origins,
            rotations=np.tile(np.eye(3), (count, 1, 1)),
        )
        self._surfaces.meet(starts, beams, self._range, hits)

    def _take(self, data: mujoco.MjData) -> None:
        """Update all poses and build the tree over the geoms' boxes there."""
        self._positions, self._rotations = data.geom_xpos[self._ids], data.geom_xmat[self._ids]
        # MuJoCo does not turn rays into a sphere's frame either: so the last digits agree.
        self._rotations[self._kinds == SPHERE] = np.eye(3).ravel()
        middle, half = self._bounds[:, :3], self._bounds[:, 3:]
        bounded = np.isfinite(half).all(axis=1)
        rows = np.flatnonzero(bounded)
        R = self._rotations[rows].reshape(-1, 3, 3)
        centre = self._positions[rows] + np.einsum("gij,gj->gi", R, middle[rows])
        reach = np.einsum("gij,gj->gi", np.abs(R), half[rows])
        tree = build_tree(centre - reach, centre + reach)
        order = np.concatenate([rows[tree.order], np.flatnonzero(~bounded)]).astype(np.int32)
        self._tree = GeomTree(tree.boxes, tree.links, order, len(rows))


def _bounds(model: mujoco.MjModel, ids: NDArray[np.int32]) -> Array:
    """Return the middle and half sides of the box about each primitive in its frame, (g, 6).

    They are MuJoCo's but for planes, which it takes for endless: a side of 0 is.
    """
    bounds = model.geom_aabb[ids]
    planes = np.flatnonzero(model.geom_type[ids] == PLANE)
    sides = model.geom_size[ids[planes], :2]
    bounds[planes] = 0.0
    bounds[planes, 3:5] = np.where(sides > 0.0, sides, np.inf)
    return np.asarray(bounds)


def _checked(origins: Array, directions: Array) -> tuple[Array, Array]:
    """Return rays as the kernels take them; MuJoCo ends the process on one without a direction."""
    origins = np.ascontiguousarray(origins, dtype=np.float64)
    directions = np.ascontiguousarray(directions, dtype=np.float64)
    if origins.shape != directions.shape or origins.ndim != 2 or origins.shape[1] != 3:
        raise ValueError(
            f"rays: got origins {origins.shape} and directions {directions.shape}, "
            "expected (n, 3) and (n, 3)"
        )
    lost = np.flatnonzero(~np.isfinite(origins).all(axis=1))
    if len(lost):
        raise ValueError(f"origin {lost[0]}: got {origins[lost[0]]}, expected finite numbers")
    length = np.linalg.norm(directions, axis=1)
    wrong = np.flatnonzero(~(np.abs(length - 1.0) < UNIT_TOLERANCE))
    if len(wrong):
        raise ValueError(f"direction {wrong[0]}: got length {length[wrong[0]]:g}, expected 1")
    return origins, directions
