"""Ray engines: Wayproof's tile caster and MuJoCo's own `mj_multiRay`, behind one call."""

from __future__ import annotations

from typing import NamedTuple, Protocol

import mujoco
import numpy as np
from numpy.typing import NDArray

from wayproof.models.arrays import Array
from wayproof.models.rays import Pattern, TileCaster
from wayproof.models.sensors.beams import rotate


class Hits(NamedTuple):
    """Hits of the beams of a sweep.

    Attributes:
        distance: (n,) m, -1 for a miss; some may lie beyond range.
        geom_id: (n,) -1 for a miss.
        normals: (n, 3) surface normals in the world, zeros for a miss; (0, 3) if not requested.
    """

    distance: Array
    geom_id: NDArray[np.int32]
    normals: Array


class Firing(NamedTuple):
    """Beams of one sweep.

    Attributes:
        directions: (n, 3) unit vectors, sensor frame.
        pose_indices: (n,) index of the scan pose that each beam leaves from.
        pattern: Beams cut into tiles.
    """

    directions: Array
    pose_indices: NDArray[np.int32]
    pattern: Pattern


class Engine(Protocol):
    """A caster of sweeps against one model's geoms."""

    def __init__(self, model: mujoco.MjModel, groups: NDArray[np.uint8], range: float) -> None:
        """Build the tables of geoms once.

        Args:
            model: World and robot.
            groups: (6,) non-zero for each geom group that beams meet.
            range: Longest distance of a hit, m.
        """

    def cast(
        self,
        data: mujoco.MjData,
        firing: Firing,
        origins: Array,
        rotations: Array,
        normals: bool = False,
    ) -> Hits:
        """Cast a sweep from its scan poses, origins (m, 3) in m and rotations (m, 3, 3), world."""


class TileEngine:
    """Sweeps by Wayproof's own caster."""

    def __init__(self, model: mujoco.MjModel, groups: NDArray[np.uint8], range: float) -> None:
        """Build the tables of geoms; see `TileCaster`."""
        self._caster = TileCaster(model, groups, range)

    def cast(
        self,
        data: mujoco.MjData,
        firing: Firing,
        origins: Array,
        rotations: Array,
        normals: bool = False,
    ) -> Hits:
        """Cast a sweep from its scan poses."""
        if normals:
            return Hits(*self._caster.cast_with_normals(data, firing.pattern, origins, rotations))
        return Hits(*self._caster.cast(data, firing.pattern, origins, rotations), np.empty((0, 3)))


class MujocoEngine:
    """Sweeps by MuJoCo's own `mj_multiRay`, one call for each scan pose."""

    def __init__(self, model: mujoco.MjModel, groups: NDArray[np.uint8], range: float) -> None:
        """Keep the geom groups (6,) and the range in m."""
        self._model = model
        self._groups = groups
        self._range = range

    def cast(
        self,
        data: mujoco.MjData,
        firing: Firing,
        origins: Array,
        rotations: Array,
        normals: bool = False,
    ) -> Hits:
        """Cast a sweep from its scan poses."""
        count = len(firing.pose_indices)
        hits = Hits(
            distance=np.empty(count),
            geom_id=np.empty(count, np.int32),
            normals=np.empty((count if normals else 0, 3)),
        )
        for pose, (origin, R_world_sensor) in enumerate(zip(origins, rotations, strict=True)):
            rolling = len(origins) > 1
            beams = np.flatnonzero(firing.pose_indices == pose) if rolling else slice(None)
            rays = rotate(R_world_sensor, firing.directions[beams])
            part = self._cast_from(data, origin, rays, normals)
            hits.distance[beams], hits.geom_id[beams] = part.distance, part.geom_id
            if normals:
                hits.normals[beams] = part.normals
        return hits

    def _cast_from(
        self, data: mujoco.MjData, origin: Array, directions: Array, normals: bool
    ) -> Hits:
        count = len(directions)
        distance, geom_id = np.empty(count), np.empty(count, np.int32)
        facing = np.empty(3 * count if normals else 0)
        mujoco.mj_multiRay(
            self._model, data, origin, directions.ravel(), self._groups, 1, -1,
            geom_id, distance, facing if normals else None, count, self._range,
        )  # fmt: skip
        return Hits(distance, geom_id, facing.reshape(-1, 3))


ENGINES: dict[str, type[Engine]] = {"tile": TileEngine, "mujoco": MujocoEngine}
"""Ray engines by the name that `SensorConfig.engine` takes."""
