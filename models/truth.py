"""What the simulator knows and the navigation stack does not: for scoring alone."""

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np
from numpy.typing import NDArray

from models._jit import kernel
from models.sensors import ROBOT_GROUP


class Truth:
    """Contacts and clearance between one robot and everything but the floor."""

    def __init__(self, model: mujoco.MjModel, base: int, floor: Sequence[int]) -> None:
        """Sort the geoms into the robot's, the floor (ids, to be stepped on), and the rest."""
        self._model = model
        self._base = base
        self._is_robot = model.geom_group == ROBOT_GROUP
        self._is_obstacle = ~self._is_robot
        self._is_obstacle[list(floor)] = False
        self._robot = np.flatnonzero(self._is_robot)
        self._obstacles = np.flatnonzero(self._is_obstacle)
        self._fromto = np.zeros(6)
        self._touching = False
        self.collisions = 0

    def count_contacts(self, data: mujoco.MjData) -> None:
        """Count a collision whenever the robot starts to touch something but the floor."""
        touching = self._touches_obstacle(data)
        self.collisions += touching and not self._touching
        self._touching = touching

    def clearance(self, data: mujoco.MjData, limit: float = 2.0) -> float:
        """Least distance from any robot geom to any geom but the floor, m, at most `limit`.

        Bounding spheres rule out the far pairs; `mj_geomDistance` measures the rest.
        """
        model = self._model
        least = limit
        gap = self._sphere_gaps(data)  # (robot geoms, obstacles)
        for flat in np.argsort(gap, axis=None):
            if gap.flat[flat] >= least:
                break
            i, j = np.unravel_index(flat, gap.shape)
            pair = int(self._robot[i]), int(self._obstacles[j])
            distance = mujoco.mj_geomDistance(model, data, *pair, least, self._fromto)
            least = min(least, float(distance))
        return least

    def uprightness(self, data: mujoco.MjData) -> float:
        """Cosine of the angle between the base's z axis and the world's."""
        return float(data.xmat[self._base, 8])

    def _touches_obstacle(self, data: mujoco.MjData) -> bool:
        count = data.ncon
        pairs = np.ascontiguousarray(data.contact.geom[:count])
        return count > 0 and bool(touches(pairs, self._is_robot, self._is_obstacle))

    def _sphere_gaps(self, data: mujoco.MjData) -> NDArray[np.float64]:
        model, robot, obstacles = self._model, self._robot, self._obstacles
        if not len(obstacles):
            return np.empty((len(robot), 0))
        # Lower bound on the distance of a robot geom's bounding sphere from an obstacle's box.
        offset = data.geom_xpos[robot][:, None] - data.geom_xpos[obstacles][None]
        R = data.geom_xmat[obstacles].reshape(-1, 3, 3)
        local = np.abs(np.einsum("rok,okl->rol", offset, R) - model.geom_aabb[obstacles, :3])
        outside = np.maximum(local - model.geom_aabb[obstacles, 3:], 0.0)
        gaps: NDArray[np.float64] = np.sqrt((outside**2).sum(axis=2))
        return gaps - np.asarray(model.geom_rbound[robot], np.float64)[:, None]


@kernel
def touches(
    pairs: NDArray[np.int32], is_robot: NDArray[np.bool_], is_obstacle: NDArray[np.bool_]
) -> bool:
    """Whether any pair of geoms (n, 2) is one of the robot's and one that it should not touch."""
    for k in range(len(pairs)):
        a, b = pairs[k, 0], pairs[k, 1]
        if (is_robot[a] and is_obstacle[b]) or (is_robot[b] and is_obstacle[a]):
            return True
    return False


def warm_up() -> None:
    """Compile the kernel, or load it from the cache."""
    touches(np.zeros((1, 2), np.int32), np.zeros(1, np.bool_), np.zeros(1, np.bool_))
