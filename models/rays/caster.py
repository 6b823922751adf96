"""A sweep of beams against MuJoCo's primitives, a tile of neighbouring beams at a time."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import mujoco
import numpy as np
from numpy.typing import NDArray

from models.rays.geometry import Geometry, shape_name
from models.rays.kernels import (
    Geoms,
    Pattern,
    Room,
    Sweep,
    aim_all,
    cast_blocks,
    fit_cones,
    look,
)


class TileCaster:
    """Casts patterns of beams against a model's planes, boxes and round primitives.

    Distances agree with `mujoco.mj_ray` to the last digits and geom ids but for ties. Beams start
    anywhere, inside geoms too. The same inputs give the same bits, on any number of threads.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        group_mask: NDArray[np.uint8],
        range: float,
        threads: int = 1,
    ) -> None:
        """Build the tables of geoms once.

        Args:
            model: Its static geoms must stay where they are.
            group_mask: (6,) non-zero for each geom group that beams meet.
            range: Longest distance of a hit, m.
            threads: That a sweep is cast on.

        Raises:
            ValueError: A ray-visible geom is a mesh, a height field or an SDF, which only MuJoCo's
                caster can do; the range is not finite and positive; there is no thread.
        """
        if not 0.0 < range < np.inf:
            raise ValueError(f"range: got {range:g}, expected a finite length > 0 m")
        if threads < 1:
            raise ValueError(f"threads: got {threads}, expected at least 1")
        self._geometry = Geometry(model, group_mask)
        _refuse(model, self._geometry.left_out)
        self._range = float(range)
        self._threads = threads
        self._pool = ThreadPoolExecutor(threads - 1, "rays") if threads > 1 else None

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
            pattern: By `cut_grid` or `cut_scattered`.
            origins: (3,) or, for each of m moments, (m, 3) in the world, m.
            R_world_sensor: (3, 3) or (m, 3, 3). With one pose all beams leave from it, whatever
                the pattern's moments.

        Returns:
            Distances (n,) in m and geom ids (n,), in the order in which the beams were given to
            the pattern; -1 and -1 for a miss.

        Raises:
            ValueError: Numbers of origins, rotations and moments do not fit each other.
        """
        self._geometry.refresh(data)
        geoms = self._geometry.geoms
        sweep = _survey(geoms, pattern, *_poses(pattern, origins, R_world_sensor), self._range)
        beams = len(pattern.places)
        distance, geom_id = np.empty(beams), np.empty(beams, np.int32)

        def share(first: int) -> None:
            room = _room(pattern, geoms)
            cast_blocks(first, self._threads, pattern, geoms, sweep, room, distance, geom_id)

        # Neighbouring blocks take about as long: each thread gets every so many of them.
        others = [self._pool.submit(share, first) for first in range(1, self._threads)] if self._pool else []
        share(0)
        for other in others:
            other.result()
        return distance, geom_id


def _refuse(model: mujoco.MjModel, ids: NDArray[np.int32]) -> None:
    for geom in ids:
        name = model.geom(geom).name or f"number {geom}"
        raise ValueError(
            f"geom '{name}': got shape {shape_name(model, geom)}, expected a primitive for ray "
            "engine 'tile'; engine 'mujoco' casts it"
        )


def _poses(
    pattern: Pattern, origins: NDArray[np.float64], R_world_sensor: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Origins (m, 3) and rotations (m, 3, 3) of the moments."""
    if np.shape(origins)[-1:] != (3,) or np.ndim(origins) not in (1, 2):
        raise ValueError(f"origins: got shape {np.shape(origins)}, expected (3,) or (m, 3)")
    if np.shape(R_world_sensor)[-2:] != (3, 3) or np.ndim(R_world_sensor) not in (2, 3):
        raise ValueError(
            f"R_world_sensor: got shape {np.shape(R_world_sensor)}, expected (3, 3) or (m, 3, 3)"
        )
    o = np.asarray(origins, np.float64).reshape(-1, 3)
    R = np.asarray(R_world_sensor, np.float64).reshape(-1, 3, 3)
    m = max(len(o), len(R))
    if len(o) not in (1, m) or len(R) not in (1, m):
        raise ValueError(f"poses: got {len(o)} origins and {len(R)} rotations, expected as many")
    if m > 1 and pattern.moments.max() >= m:
        raise ValueError(f"moments: got up to {pattern.moments.max()}, expected less than {m}")
    o, R = np.broadcast_to(o, (m, 3)), np.broadcast_to(R, (m, 3, 3))
    return np.ascontiguousarray(o), np.ascontiguousarray(R)


def _survey(
    geoms: Geoms,
    pattern: Pattern,
    origins: NDArray[np.float64],
    rotations: NDArray[np.float64],
    limit: float,
) -> Sweep:
    """How the geoms look from where the beams leave, nearest first."""
    spread = float(np.sqrt(((origins - origins[0]) ** 2).sum(axis=1).max()))
    local, views = np.empty((len(geoms.ids), 3)), np.empty((6, len(geoms.ids)))
    look(origins[0], spread, geoms, local, views)
    order = np.argsort(views[0], kind="stable")
    tile_cones, block_cones = _world_cones(pattern, rotations)
    return Sweep(
        origins, rotations, spread, limit, tile_cones, block_cones, order,
        np.ascontiguousarray(views[:, order]), local,
    )  # fmt: skip


def _world_cones(
    pattern: Pattern, rotations: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Cones about tiles (t, 5) and blocks (b, 5): turned, or fitted anew to the turning sensor."""
    if len(rotations) == 1:
        turned = pattern.tile_cones.copy(), pattern.block_cones.copy()
        for cones in turned:
            x, y, z = cones[:, :1].copy(), cones[:, 1:2].copy(), cones[:, 2:3].copy()
            R = rotations[0]
            cones[:, :3] = x * R[:, 0] + y * R[:, 1] + z * R[:, 2]
        return turned
    v = np.empty_like(pattern.beams)
    aim_all(pattern, rotations, v)
    fitted = np.empty_like(pattern.tile_cones), np.empty_like(pattern.block_cones)
    fit_cones(v, pattern.tile_starts, fitted[0])
    fit_cones(v, pattern.tile_starts[pattern.block_starts], fitted[1])
    return fitted


def _room(pattern: Pattern, geoms: Geoms) -> Room:
    w, g = int(np.diff(pattern.tile_starts).max()), len(geoms.ids)
    best = np.empty(w + 1)
    return Room(
        v=np.empty((3, w)),
        starts=np.empty((3, w)),
        spots=np.empty((3, w)),
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
