"""Ray engines: Wayproof's tile caster, and MuJoCo's own `mj_multiRay` behind the same calls."""

from __future__ import annotations

import mujoco
import numpy as np
from numpy.typing import NDArray

from wayproof.models.arrays import Array
from wayproof.models.rays import Pattern, TileCaster
from wayproof.models.sensors.beams import rotate


class MujocoCaster:
    """Caster of sweeps by `mj_multiRay`, one call for each scan pose; see `TileCaster`."""

    def __init__(self, model: mujoco.MjModel, group_mask: NDArray[np.uint8], range: float) -> None:
        """Keep the geom groups (6,) and the range in m, beyond which some hits may lie."""
        self._model = model
        self._groups = group_mask
        self._range = range

    def cast(
        self, data: mujoco.MjData, pattern: Pattern, origins: Array, R_world_sensor: Array
    ) -> tuple[Array, NDArray[np.int32]]:
        """Cast a sweep from its scan poses, origins (m, 3) in m and rotations (m, 3, 3), world."""
        return self._cast(data, pattern, origins, R_world_sensor, normals=False)[:2]

    def cast_with_normals(
        self, data: mujoco.MjData, pattern: Pattern, origins: Array, R_world_sensor: Array
    ) -> tuple[Array, NDArray[np.int32], Array]:
        """Cast a sweep as `cast` does, with the normals (n, 3) of what the beams meet."""
        return self._cast(data, pattern, origins, R_world_sensor, normals=True)

    def _cast(
        self, data: mujoco.MjData, pattern: Pattern, origins: Array, rotations: Array, normals: bool
    ) -> tuple[Array, NDArray[np.int32], Array]:
        count = len(pattern.places)
        distance, geom_id = np.empty(count), np.empty(count, np.int32)
        facing = np.empty((count, 3))
        for pose, (origin, R) in enumerate(zip(origins, rotations, strict=True)):
            rolling = len(origins) > 1
            beams = np.flatnonzero(pattern.pose_indices == pose) if rolling else slice(None)
            rays, places = rotate(R, pattern.beams.T[beams]), pattern.places[beams]
            own_distance, own_id = np.empty(len(rays)), np.empty(len(rays), np.int32)
            own_facing = np.empty(3 * len(rays)) if normals else None
            mujoco.mj_multiRay(
                self._model, data, origin, rays.ravel(), self._groups, 1, -1,
                own_id, own_distance, own_facing, len(rays), self._range,
            )  # fmt: skip
            distance[places], geom_id[places] = own_distance, own_id
            if own_facing is not None:
                facing[places] = own_facing.reshape(-1, 3)
        return distance, geom_id, facing


ENGINES: dict[str, type[TileCaster] | type[MujocoCaster]] = {
    "tile": TileCaster,
    "mujoco": MujocoCaster,
}
"""Ray engines by the name that `SensorConfig.engine` takes."""
