"""Ground truth for scoring: contacts and clearance, which the navigation stack does not get."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from wayproof.kernel_compiler import allocating
from wayproof.models.sensors.caster import ROBOT_GROUP

REST_SPEED = 0.05
"""Speed below which a robot is at rest, m/s."""

CLEARANCE_REACH = 2.0
"""Maximum clearance that is measured, m; one of this length is a lower bound."""

REST_WINDOW = 0.2
"""Time over which the speed at rest is averaged, s."""

LIFT_OFF = 0.05
"""Height above the floor, or above its start on it, at which a robot that flies has left it, m."""


class Truth:
    """Contacts and clearance between one robot and everything that it must not touch.

    A robot that walks may touch the floor. One that flies may not, but for the floor that it starts
    on, until it has taken off.

    Attributes:
        collisions: Number of times that the robot, in motion, started to touch an obstacle; or, at
            rest, one that does not move.
        hits_by_movers: Number of times that a mover started to touch the robot at rest.
        touched: What was last touched, in words: a mover by its name.
        is_robot: (geoms,) whether a geom is the robot's.
        is_obstacle: (geoms,) whether the robot must not touch a geom now.
        places: (k, 3) latest positions of the base, a ring buffer: step n is row n modulo k.
        steps: Physics steps so far.
    """

    def __init__(
        self, model: mujoco.MjModel, base: int, floor: Sequence[int], flies: bool = False
    ) -> None:
        """Sort the geoms into the robot's, the floor, and the rest.

        Args:
            model: Model of the scene.
            base: Body of the robot's base.
            floor: Geoms of the floor.
            flies: Whether the robot flies, so that the floor is an obstacle.
        """
        self._model = model
        self._base = base
        self.is_robot = model.geom_group == ROBOT_GROUP
        self.is_obstacle = ~self.is_robot
        self._floor = np.array(floor, np.int64)
        self._flies, self._takes_off_from = flies, -np.inf
        self._robot = np.flatnonzero(self.is_robot)
        self._fromto = np.zeros(6)
        self._set_standing(not flies)
        self._is_mover = model.body_mocapid[model.geom_bodyid] >= 0
        window = round(REST_WINDOW / float(model.opt.timestep)) + 1
        self.places, self.steps = np.zeros((window, 3)), 0
        self._touching = False
        self.collisions = 0
        self.hits_by_movers = 0
        self.touched = ""

    def place(self, data: mujoco.MjData) -> None:
        """Note whether a robot that flies starts on the floor, and at which height."""
        if self._flies:
            gaps = [self._distance(data, int(one), self._floor, LIFT_OFF) for one in self._robot]
            self._set_standing(min(gaps, default=LIFT_OFF) < LIFT_OFF)
            self._takes_off_from = float(data.xpos[self._base, 2])

    def _set_standing(self, standing: bool) -> None:
        """Let the robot touch the floor, or no longer."""
        self._standing = standing
        self.is_obstacle[self._floor] = not standing
        self._obstacles = np.flatnonzero(self.is_obstacle)

    def end_step(self, obstacle: int) -> None:
        """End a physics step; a collision counts whenever the robot starts to touch something.

        Args:
            obstacle: Geom id of what it touches, -1 if nothing; its place is in `places` already.
        """
        height = self.places[self.steps % len(self.places), 2]
        if self._flies and self._standing and height > self._takes_off_from + LIFT_OFF:
            self._set_standing(False)
        self.steps += 1
        if obstacle >= 0 and not self._touching:
            self._count_contact(obstacle)
        self._touching = obstacle >= 0

    def _count_contact(self, obstacle: int) -> None:
        """Count a new contact: a mover may hit a robot at rest, which is then no collision."""
        by_mover = bool(self._is_mover[obstacle])
        self.touched = "the floor" if obstacle in self._floor else "an obstacle"
        if by_mover:
            self.touched = self._model.body(self._model.geom_bodyid[obstacle]).name
        if by_mover and self._speed() < REST_SPEED:
            self.hits_by_movers += 1
        else:
            self.collisions += 1

    def _speed(self) -> float:
        """Return the mean speed of the base over the window, m/s: a standing trot sways."""
        places = self._recent_places()
        if len(places) < 2:
            return 0.0
        time = (len(places) - 1) * float(self._model.opt.timestep)
        return float(np.linalg.norm(places[-1] - places[0])) / time

    def _recent_places(self) -> NDArray[np.float64]:
        """Return the positions of the base at the last steps, (n, 3), the latest last."""
        oldest = self.steps % len(self.places)
        if self.steps < len(self.places):
            return self.places[:oldest].copy()
        return np.concatenate((self.places[oldest:], self.places[:oldest]))

    def clearance(self, data: mujoco.MjData, limit: float = CLEARANCE_REACH) -> float:
        """Return the least distance from robot geoms to what they must not touch, m, up to `limit`.

        Bounding spheres rule out the far pairs; `mj_geomDistance` measures the rest.
        """
        least = limit
        gap = self._sphere_gaps(data)  # (robot geoms, obstacles)
        near = np.argwhere(gap < limit)
        for k in np.argsort(gap[gap < limit], kind="stable"):
            i, j = near[k]
            if gap[i, j] >= least:
                break
            least = self._distance(data, int(self._robot[i]), self._obstacles[j : j + 1], least)
        return least

    def _distance(
        self, data: mujoco.MjData, mine: int, others: NDArray[np.int64], limit: float
    ) -> float:
        """Return the least distance of one of the robot's geoms to others, m, up to `limit`."""
        for other in others:
            distance = mujoco.mj_geomDistance(
                self._model, data, mine, int(other), limit, self._fromto
            )
            limit = min(limit, float(distance))
        return limit

    def state(self) -> dict[str, NDArray[Any]]:
        """Return the state between steps."""
        return {
            "touching": np.array(self._touching, np.int64),
            "standing": np.array(self._standing, np.int64),
            "collisions": np.array(self.collisions, np.int64),
            "struck": np.array(self.hits_by_movers, np.int64),
            "places": self._recent_places(),
        }

    def restore(self, state: dict[str, NDArray[Any]]) -> None:
        """Continue from what `state` returned.

        Raises:
            ValueError: The places are none, or more than are kept.
        """
        self._touching = bool(state["touching"])
        self._set_standing(bool(state["standing"]))
        self.collisions = int(state["collisions"])
        self.hits_by_movers = int(state["struck"])
        places = state["places"]
        if places.shape[1:] != (3,) or len(places) > len(self.places):
            raise ValueError(f"places: got {places.shape}, expected at most {self.places.shape}")
        self.steps = len(places)
        self.places[: self.steps] = places

    def _sphere_gaps(self, data: mujoco.MjData) -> NDArray[np.float64]:
        model, pairs = self._model, (self._robot, self._obstacles)
        bounds = model.geom_aabb, model.geom_rbound
        gaps: NDArray[np.float64] = sphere_gaps(*pairs, data.geom_xpos, data.geom_xmat, *bounds)
        return gaps


@allocating
def sphere_gaps(
    robot: NDArray[np.int64],
    obstacles: NDArray[np.int64],
    positions: NDArray[np.float64],
    rotations: NDArray[np.float64],
    boxes: NDArray[np.float64],
    radii: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Lower bounds on distances (r, o): a robot geom's bounding sphere from an obstacle's box.

    Args:
        robot: (r,) geom ids.
        obstacles: (o,) geom ids.
        positions: (n, 3) positions of all geoms, world, m.
        rotations: (n, 9) their axes, row by row.
        boxes: (n, 6) centre and half extents of each in its own axes, m.
        radii: (n,) radii of bounding spheres, m.
    """
    gaps = np.empty((len(robot), len(obstacles)))
    for i in range(len(robot)):
        for j in range(len(obstacles)):
            o, square = obstacles[j], 0.0
            x = positions[robot[i], 0] - positions[o, 0]
            y = positions[robot[i], 1] - positions[o, 1]
            z = positions[robot[i], 2] - positions[o, 2]
            for axis in range(3):
                along = x * rotations[o, axis] + y * rotations[o, 3 + axis]
                along += z * rotations[o, 6 + axis] - boxes[o, axis]
                outside = max(abs(along) - boxes[o, 3 + axis], 0.0)
                square += outside * outside
            gaps[i, j] = np.sqrt(square) - radii[robot[i]]
    return gaps


def warm_up() -> None:
    """Compile the kernels, or load them from the cache."""
    none = np.zeros(1, np.int64)
    places, axes, boxes = (np.zeros((1, n)) for n in (3, 9, 6))
    sphere_gaps(none, none, places, axes, boxes, np.zeros(1))
