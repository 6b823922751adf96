"""The gait of a body: how it moves along a path, and whether it sees all around meanwhile."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from wayproof.harness.mission import Mission
from wayproof.planners import MotionLimits

if TYPE_CHECKING:
    from wayproof.harness.stack.situation import Course
    from wayproof.harness.stack.types import Decided
from collections.abc import Iterable

import numpy as np

from wayproof.harness.inputs import Beams

REPLAN_PERIOD = 1.0
"""Time between searches for a cheaper global path, s; Nav2's behaviour tree replans at 1 Hz."""


@dataclass(frozen=True)
class Gait:
    """How a body moves along a path; chosen once per mission.

    Attributes:
        limits: Greatest speed, acceleration, jerk and yaw rate of a command.
        discs: Offset along the x axis of the body, and radius without the margin, of each of its
            discs, m; those of an elongated body in the circumscribed space, too.
        sideways_speed: Speed in any direction, whatever the body faces, m/s; 0 if it turns before
            it moves, or if it flies, if it takes a bend no faster than it turns.
        omnidirectional: Whether the sensors see all around the body, not ahead of it alone.
        in_plane: Whether it moves in the plane, where heading matters for motion.
        following: Manoeuvres along a global path by precedence.
    """

    limits: MotionLimits
    discs: tuple[tuple[float, float], ...]
    sideways_speed: float = 0.0
    omnidirectional: bool = True

    in_plane: ClassVar[bool] = True
    following: ClassVar[tuple[Callable[[Course], Decided | None], ...]]

    @classmethod
    def suits(cls, mission: Mission) -> bool:
        """Return whether a mission's body moves so."""
        raise NotImplementedError

    @property
    def early_bends(self) -> tuple[float, ...]:
        """Shares of the way to a stop after which it may leave its path, besides all of it."""
        return ()

    @property
    def sees_ahead(self) -> bool:
        """Whether it sees what lies ahead while it draws near (see `prices`)."""
        return False

    @property
    def replan_period(self) -> float:
        """Time between searches for a better path, s."""
        return REPLAN_PERIOD

    def blend_length(self, longest: float) -> float:
        """Return the longest stretch on each side of a corner over which it is rounded, m."""
        return longest


LEVEL = 0.25
"""Sine of the elevation up to which a beam counts as level: 14 degrees."""

OCTANTS = 8
"""Number of parts of the horizon, 45 degrees each."""


def is_omnidirectional(sensors: Iterable[Beams]) -> bool:
    """Return whether each octant of the horizon of a level body holds a beam of some sensor.

    Sweeps that list their own beams say nothing of a field of view, and count as none.
    """
    seen: set[int] = set()
    for beams in sensors:
        x, y, z = beams.directions_in_base().T
        level = np.abs(z) <= LEVEL
        x, y = x[level], y[level]
        seen.update((4 * (x >= 0.0) + 2 * (y >= 0.0) + (np.abs(x) >= np.abs(y))).tolist())
    return len(seen) == OCTANTS
