"""Traffic: the movers of a world, moved step by step in a simulation."""

from __future__ import annotations

from collections.abc import Sequence
from math import cos, hypot, sin
from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from wayproof.models.worlds.movers import ASIDE_DISTANCE, Mover, Place

ABSENT_POSITION = (0.0, 0.0, -1000.0)
"""Position of an absent mover, m: out of every sensor's and body's reach."""


class MoverState(NamedTuple):
    """A mover now.

    Attributes:
        name: Name of the mover.
        present: Whether it exists.
        position: T_world_mover, m.
        quaternion: w x y z.
    """

    name: str
    present: bool
    position: tuple[float, float, float]
    quaternion: tuple[float, float, float, float]


class Traffic:
    """The movers of one simulation; their state is whole nanoseconds, so that it repeats exactly.

    A mover stands still while a robot is in its way: ahead of it, within `ASIDE_DISTANCE` of the
    width of both, and nearer than `Mover.stands_off`. It appears only where no robot is that near.
    """

    def __init__(
        self, model: mujoco.MjModel, movers: Sequence[Mover], base: int, radius: float
    ) -> None:
        """Find the movers' bodies.

        Args:
            model: World and robot.
            movers: Movers of the world in the model.
            base: Body id of the robot's base, which has a free joint.
            radius: Radius of the robot, m.
        """
        self._movers = tuple(movers)
        self._mocap = [int(model.body(mover.name).mocapid[0]) for mover in movers]
        joint = int(model.body_jntadr[base])
        self._robot = int(model.jnt_qposadr[joint]) if joint >= 0 else 0
        self._radius = radius
        self.moving_ns = [0] * len(self._movers)
        self.present = [False] * len(self._movers)

    def advance(self, data: mujoco.MjData, time_ns: int, step_ns: int) -> None:
        """Bring every mover to `time_ns`, a step of `step_ns` after the last time; 0 to begin."""
        x, y = data.qpos[self._robot : self._robot + 2].tolist()
        for number, mover in enumerate(self._movers):
            place = mover.place(self.moving_ns[number])
            present = self._is_present(number, time_ns, place, (x, y))
            if present and mover.moves and not self._is_blocked(mover, place, (x, y)):
                self.moving_ns[number] += step_ns
            self.present[number] = present
        self.show(data)

    def show(self, data: mujoco.MjData) -> None:
        """Put every mover where it is now; one that does not exist, away."""
        for number, mover in enumerate(self._movers):
            place = mover.place(self.moving_ns[number])
            data.mocap_pos[self._mocap[number]] = (
                place.position if self.present[number] else ABSENT_POSITION
            )
            data.mocap_quat[self._mocap[number]] = _quaternion(place.yaw)

    def state(self) -> dict[str, NDArray[np.int64]]:
        """Return the state between steps."""
        return {
            "moving_ns": np.array(self.moving_ns, np.int64),
            "present": np.array(self.present, np.int64),
        }

    def restore(self, state: dict[str, NDArray[np.int64]]) -> None:
        """Continue from what `state` returned; `show` puts the movers there."""
        self.moving_ns = [int(value) for value in state["moving_ns"]]
        self.present = [bool(value) for value in state["present"]]

    def states(self) -> list[MoverState]:
        """Return the pose of every mover; an absent one has the pose it would have."""
        states = []
        for mover, moving_ns, present in zip(
            self._movers, self.moving_ns, self.present, strict=True
        ):
            place = mover.place(moving_ns)
            states.append(MoverState(mover.name, present, place.position, _quaternion(place.yaw)))
        return states

    def _is_present(
        self, number: int, time_ns: int, place: Place, robot: tuple[float, float]
    ) -> bool:
        mover = self._movers[number]
        if not mover.appears <= time_ns * 1e-9 < mover.vanishes:
            return False
        if self.present[number] or time_ns == 0:
            return True
        room = self._radius + hypot(*mover.size) + mover.stands_off
        return hypot(robot[0] - place.position[0], robot[1] - place.position[1]) > room

    def _is_blocked(self, mover: Mover, place: Place, robot: tuple[float, float]) -> bool:
        """Return whether the robot is in the mover's way and too near."""
        if not mover.stands_off:
            return False
        dx, dy = robot[0] - place.position[0], robot[1] - place.position[1]
        c, s = cos(place.heading), sin(place.heading)
        ahead, aside = c * dx + s * dy, abs(c * dy - s * dx)
        gap = ahead - mover.size[0] - self._radius
        return (
            ahead > 0.0
            and gap < mover.stands_off
            and aside < mover.size[1] + self._radius + ASIDE_DISTANCE
        )


def _quaternion(yaw: float) -> tuple[float, float, float, float]:
    return cos(yaw / 2), 0.0, 0.0, sin(yaw / 2)
