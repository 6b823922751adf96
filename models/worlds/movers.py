"""Movers: a body, a route and a timetable each; moved step by step in a simulation."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from math import atan2, cos, hypot, inf, sin
from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from wayproof.models.arrays import Vector3
from wayproof.models.worlds.solids import Solid

STAND_OFF = 0.8
"""Distance at which people stop for a robot in their way, m; assumed."""

ASIDE_DISTANCE = 0.3
"""Gap beside a mover beyond which a body is not in its way, m."""


class Place(NamedTuple):
    """Pose of a mover.

    Attributes:
        position: Origin of its frame, world, m.
        yaw: Heading of its frame, rad.
        heading: The way it is going, rad; its yaw, or the opposite where it backs up.
    """

    position: Vector3
    yaw: float
    heading: float


@dataclass(frozen=True)
class Mover:
    """Solids that follow a route together, in a straight line from point to point.

    They go at one speed, or by a timetable.

    Attributes:
        name: Unlike any other in the world.
        solids: Solids in the mover's own frame: x ahead, z up, its origin on the ground; m.
        route: World frame, m; one point for what stands still.
        speed: m/s.
        begin: Arc length along the route at the start, m.
        returns: Whether it goes back and forth along the route; otherwise it stays at the end.
        backs_up: Whether it returns without turning round, as a vehicle does in an aisle.
        stands_off: It stops while a robot in its way is nearer than this, m; 0 for what never does.
        appears: When it comes into being, s; later while a robot is within `stands_off` of there.
        vanishes: When it ceases to be, s.
        times: Time at which it is at each point of the route, increasing from 0, s, in place of a
            speed; standing for a robot delays it. A point that is repeated is a stop.
        loops: Whether it begins again at the end of the route, which then is where it began.
    """

    name: str
    solids: tuple[Solid, ...]
    route: tuple[Vector3, ...]
    speed: float = 0.0
    begin: float = 0.0
    returns: bool = True
    backs_up: bool = False
    stands_off: float = STAND_OFF
    appears: float = 0.0
    vanishes: float = inf
    times: tuple[float, ...] = ()
    loops: bool = False

    def __post_init__(self) -> None:
        """Refuse a mover without a body, a route or a timetable.

        Raises:
            ValueError: Naming the field, what was got and what was expected.
        """
        if not self.solids or not self.route:
            raise ValueError(f"mover '{self.name}': expected at least one solid and one point")
        for field in ("speed", "begin", "stands_off", "appears"):
            if not 0.0 <= getattr(self, field) < inf:
                raise ValueError(f"{field}: got {getattr(self, field)}, expected 0 or more")
        if not self.vanishes > self.appears:
            raise ValueError(f"vanishes: got {self.vanishes}, expected after {self.appears} s")
        if self.times:
            self._check_times()
        elif any(tail == head for tail, head in zip(self.route, self.route[1:], strict=False)):
            raise ValueError("route: got the same point twice in a row, expected another one")
        if self.loops and self.route[0] != self.route[-1]:
            raise ValueError("loops: expected a route that ends where it begins")

    def _check_times(self) -> None:
        increasing = all(a < b for a, b in zip(self.times, self.times[1:], strict=False))
        if len(self.times) != len(self.route) or self.times[0] or not increasing:
            raise ValueError("times: expected one for each point of the route, increasing from 0")
        if not self.times[-1] < inf or self.speed or self.begin:
            raise ValueError("times: expected finite ones, and neither speed nor begin")

    @cached_property
    def milestones(self) -> tuple[float, ...]:
        """Arc length of each point of the route, m."""
        lengths = [0.0]
        for tail, head in zip(self.route, self.route[1:], strict=False):
            lengths.append(
                lengths[-1] + hypot(head[0] - tail[0], head[1] - tail[1], head[2] - tail[2])
            )
        return tuple(lengths)

    @property
    def length(self) -> float:
        """Length of the route, m."""
        return self.milestones[-1]

    @property
    def moves(self) -> bool:
        """Whether it ever moves."""
        return bool(self.speed or self.times)

    @cached_property
    def size(self) -> tuple[float, float]:
        """Half extents along its own x and y axes, m."""
        x = max(max(-solid.low[0], solid.high[0]) for solid in self.solids)
        y = max(max(-solid.low[1], solid.high[1]) for solid in self.solids)
        return x, y

    def place(self, moving_ns: int) -> Place:
        """Return the pose after moving, not standing, for a number of nanoseconds."""
        if len(self.route) == 1:
            return Place(self.route[0], 0.0, 0.0)
        marks = self.times or self.milestones
        gone = self.begin + (1.0 if self.times else self.speed) * (moving_ns * 1e-9)
        back = False
        if self.loops:
            gone %= marks[-1]
        elif self.returns:
            gone %= 2.0 * marks[-1]
            back = gone > marks[-1]
            gone = 2.0 * marks[-1] - gone if back else gone
        gone = min(gone, marks[-1])
        leg = min(bisect_right(marks, gone), len(self.route) - 1) - 1
        (x0, y0, z0), (x1, y1, z1) = self.route[leg : leg + 2]
        share = (gone - marks[leg]) / (marks[leg + 1] - marks[leg])
        onward, backward = self._headings(leg)
        heading = backward if back else onward
        yaw = onward if self.backs_up else heading
        x, y, z = x0 + share * (x1 - x0), y0 + share * (y1 - y0), z0 + share * (z1 - z0)
        return Place((x, y, z), yaw, heading)

    def _headings(self, leg: int) -> tuple[float, float]:
        """Return the headings along a leg and back, rad; of a stop those of the last leg, or 0."""
        while leg > 0 and self.route[leg] == self.route[leg + 1]:
            leg -= 1
        (x0, y0, _), (x1, y1, _) = self.route[leg : leg + 2]
        return atan2(y1 - y0, x1 - x0), atan2(y0 - y1, x0 - x1)

    @property
    def solid_names(self) -> tuple[str, ...]:
        """Geom name of each solid."""
        return tuple(f"{self.name}/{number}" for number in range(len(self.solids)))


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
