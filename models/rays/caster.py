"""A sweep of beams against MuJoCo's primitives, a tile of neighbouring beams at a time."""

from __future__ import annotations

import mujoco
import numpy as np
from numpy.typing import NDArray

from models.beams import beam_directions
from models.rays.geometry import Geometry
from models.rays.kernels import approach, cast_blocks
from models.rays.tiles import cut


class TileCaster:
    """Casts one pattern of beams against a model's planes, boxes and round primitives.

    Distances agree with `mujoco.mj_ray` to the last digits and geom ids but for ties. Beams start
    anywhere, inside geoms too. One thread; the same inputs give the same bits.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        rows: NDArray[np.float64],
        columns: NDArray[np.float64],
        group_mask: NDArray[np.uint8],
        range: float,
    ) -> None:
        """Build the tables of beams and geoms once.

        Args:
            model: Its static geoms must stay where they are.
            rows: Beam table, see `models.beams.beam_directions`.
            columns: Likewise.
            group_mask: (6,) non-zero for each geom group that beams meet.
            range: Longest distance of a hit, m.

        Raises:
            ValueError: A ray-visible geom is a mesh, a height field or an SDF, which only MuJoCo's
                caster can do; a beam is no unit vector; the range is not finite and positive.
        """
        if not 0.0 < range < np.inf:
            raise ValueError(f"range: got {range:g}, expected a finite length > 0 m")
        self._pattern = cut(beam_directions(rows, columns), len(rows), len(columns))
        self._geometry = Geometry(model, group_mask)
        self._range = float(range)
        count = len(self._geometry.geoms.ids)
        self._local = np.empty((count, 3))
        self._nearest = np.empty(count)

    def cast(
        self, data: mujoco.MjData, origin: NDArray[np.float64], R_world_sensor: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
        """Cast one sweep; call `mujoco.mj_kinematics` first, geom poses lag a step behind.

        Args:
            data: Geom poses of all that moves.
            origin: (3,) in the world, m.
            R_world_sensor: (3, 3).

        Returns:
            Distances (n,) in m and geom ids (n,), row-major as the beams; -1 and -1 for a miss.
        """
        self._geometry.refresh(data)
        origin = np.ascontiguousarray(origin, dtype=np.float64)
        R = np.ascontiguousarray(R_world_sensor, dtype=np.float64)
        geoms = self._geometry.geoms
        views = np.empty((6, len(geoms.ids)))
        approach(origin, 0.0, geoms, self._local, views)
        order = np.argsort(views[0], kind="stable")
        views = np.ascontiguousarray(views[:, order])
        beams = len(self._pattern.places)
        distance, geom_id = np.empty(beams), np.empty(beams, np.int32)
        tile_cones, block_cones = self._pattern.tile_cones.copy(), self._pattern.block_cones.copy()
        for cones in (tile_cones, block_cones):
            cones[:, :3] = cones[:, :3] @ R.T
        self.stats = np.zeros(20, np.int64)
        cast_blocks(
            0, 1, self._pattern, tile_cones, block_cones, R[None], 0.0, geoms, self._local,
            order, views, self._range, distance, geom_id, self.stats,
        )  # fmt: skip
        return distance, geom_id
