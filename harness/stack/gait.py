"""The gait of a body: how it moves along a path."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from wayproof.harness.mission import Mission
from wayproof.planners import MotionLimits

if TYPE_CHECKING:
    from wayproof.harness.stack.course import Course
    from wayproof.harness.stack.types import Decided

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
        """Whether it sees what lies ahead while it draws near (see `unknown_ahead`)."""
        return False

    @property
    def replan_period(self) -> float:
        """Time between searches for a better path, s."""
        return REPLAN_PERIOD

    def blend_length(self, longest: float) -> float:
        """Return the longest stretch on each side of a corner over which it is rounded, m."""
        return longest
