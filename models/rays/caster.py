"""Caster of sweeps against MuJoCo's geoms, a tile of neighbouring beams at a time."""

from __future__ import annotations

import mujoco
import numpy as np
from numpy.typing import NDArray

from wayproof.models.rays.bounds import turn_cones, view_geoms
from wayproof.models.rays.geometry import Geometry
from wayproof.models.rays.records import Geoms, Pattern, Room, Sweep, Waiting
from wayproof.models.rays.tile_kernels import cast_blocks
from wayproof.models.rays.tiles import cut_scattered
from wayproof.models.rays.tree import STACK_SIZE


class TileCaster:
    """Caster of patterns of beams against a model's primitives, meshes and height fields.

    Distances and geom ids are those of `mujoco.mj_ray`, for beams that start on a surface, run
    within a face or along an edge too, so that axis-parallel beams among boxes on a lattice are met
    alike. Two kinds of beams of measure zero are decided by rounding, and can be hits in one and
    misses in the other: slanted ones that touch only the rim of a cylinder or a capsule's side
    tangentially, and slanted ones along the seams or the border of a height field. Where two geoms
    are met at one distance, either id may be returned.

    Beams start anywhere, inside geoms too. The same inputs give the same bits.
    """

    def __init__(self, model: mujoco.MjModel, group_mask: NDArray[np.uint8], range: float) -> None:
        """Build the tables of geoms once.

        Args:
            model: Its static geoms and its heights must stay as they are.
            group_mask: (6,) non-zero for each geom group that beams meet.
            range: Longest distance of a hit, m.

        Raises:
            ValueError: A ray-visible geom is an SDF, which only MuJoCo's caster can do; the range
                is not finite and positive.
        """
        if not 0.0 < range < np.inf:
            raise ValueError(f"range: got {range:g}, expected a finite length > 0 m")
        self._geometry = Geometry(model, group_mask)
        self._range = float(range)
        self._waiting = Waiting(np.empty(STACK_SIZE, np.int64), np.empty(STACK_SIZE, np.float32))
        if self._geometry.soup is not None:
            self._cast_once(model)

    def _cast_once(self, model: mujoco.MjModel) -> None:
        """Cast a beam, so that no sweep compiles the kernels of triangles; few worlds need them."""
        data = mujoco.MjData(model)
        mujoco.mj_kinematics(model, data)
        self.cast(data, cut_scattered(np.array([[0.0, 0.0, 1.0]])), np.zeros(3), np.eye(3))

    def cast(
        self,
        data: mujoco.MjData,
        pattern: Pattern,
        origins: NDArray[np.float64],
        R_world_sensor: NDArray[np.float64],
    ) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
        """Cast one sweep; call `mujoco.mj_kinematics` first, geom poses lag a step behind.

        Args:
            data: Geom poses of all that moves; a rolling sweep meets them all as they are now.
            pattern: Pattern by `cut_grid` or `cut_scattered`.
            origins: (3,) or, for each of m scan poses, (m, 3) in the world, m.
            R_world_sensor: (3, 3) or (m, 3, 3). With one pose all beams leave from it, whatever
                the pattern's pose indices.

        Returns:
            Distances (n,) in m and geom ids (n,), in the order in which the beams were given to
            the pattern; -1 and -1 for a miss.

        Raises:
            ValueError: Numbers of origins, rotations and pose indices differ.
        """
        starts, rotations = _poses(pattern, origins, R_world_sensor)
        self._geometry.refresh(data)
        geoms = self._geometry.geoms
        sweep = _survey(geoms, pattern, starts, rotations, self._range)
        beams = len(pattern.places)
        distance, geom_id = np.full(beams, -1.0), np.full(beams, -1, np.int32)
        if len(geoms.ids):
            room = _room(pattern, geoms)
            soup = self._geometry.soup
            cast_blocks(pattern, geoms, sweep, room, soup, self._waiting, distance, geom_id)
        return distance, geom_id


def _poses(
    pattern: Pattern, origins: NDArray[np.float64], R_world_sensor: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return origins (m, 3) and rotations (m, 3, 3) of the scan poses."""
    o = _several("origins", origins, (3,))
    R = _several("R_world_sensor", R_world_sensor, (3, 3))
    m = max(len(o), len(R))
    if len(o) not in (1, m) or len(R) not in (1, m):
        raise ValueError(f"poses: got {len(o)} origins, {len(R)} rotations, expected as many")
    if m > 1 and pattern.pose_indices.max() >= m:
        raise ValueError(
            f"pose_indices: got up to {pattern.pose_indices.max()}, expected less than {m}"
        )
    # Copies, as numba compiles again for arrays that may not be written to.
    o, R = (np.repeat(array, m // len(array), axis=0) for array in (o, R))
    return o, R


def _several(name: str, got: NDArray[np.float64], shape: tuple[int, ...]) -> NDArray[np.float64]:
    """Return one array of a shape, or several of them, as several."""
    array = np.asarray(got, np.float64)
    if array.size == 0 or shape not in (array.shape, array.shape[1:]):
        raise ValueError(f"{name}: got shape {array.shape}, expected {shape} or several of these")
    return array.reshape(-1, *shape)


def _survey(
    geoms: Geoms,
    pattern: Pattern,
    origins: NDArray[np.float64],
    rotations: NDArray[np.float64],
    limit: float,
) -> Sweep:
    """Place the beams and, nearest first, the geoms in the world."""
    spread = float(np.sqrt(((origins - origins[0]) ** 2).sum(axis=1).max()))
    local, views = np.empty((len(geoms.ids), 3)), np.empty((6, len(geoms.ids)))
    view_geoms(origins[0], spread, geoms, local, views)
    order = np.argsort(views[0], kind="stable")
    beams, R = pattern.beams, rotations[0]
    tile_cones, block_cones = np.empty_like(pattern.tile_cones), np.empty_like(pattern.block_cones)
    if len(rotations) == 1:
        turn_cones(pattern.tile_cones, R, tile_cones)
        turn_cones(pattern.block_cones, R, block_cones)
    else:
        beams, R = np.empty_like(pattern.beams), np.eye(3)
    return Sweep(
        origins=origins,
        turns=rotations,
        R=R,
        beams=beams,
        spread=spread,
        limit=limit,
        tile_cones=tile_cones,
        block_cones=block_cones,
        order=order,
        views=np.ascontiguousarray(views[:, order]),
        local=local,
    )


def _room(pattern: Pattern, geoms: Geoms) -> Room:
    w, g = int(np.diff(pattern.tile_starts).max()), len(geoms.ids)
    best = np.empty(w + 1)
    return Room(
        v=np.empty((3, w)),
        starts=np.empty((3, w)),
        local_starts=np.empty((3, w)),
        reach=np.empty(w),
        best=best,
        best_bits=best.view(np.int64),
        best_geom=np.empty(w, np.int64),
        walls=np.empty((5, 3)),
        slack=np.empty(g),
        block_views=np.empty((6, g)),
        block_rows=np.empty(g, np.int64),
        chosen=np.empty(g + 1, np.int64),
    )
