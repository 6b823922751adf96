"""Gaits: turning on the spot, then going; going in any direction; flight."""

from __future__ import annotations

from wayproof.harness.mission import Mission
from wayproof.harness.stack.gait import Gait
from wayproof.harness.stack.manoeuvres.driving import drive
from wayproof.harness.stack.manoeuvres.following import (
    brake_on_path,
    keep_admitted_trajectory,
    keep_course,
    wait_on_path,
)
from wayproof.harness.stack.manoeuvres.setting_out import (
    set_out,
    step_aside,
    turn_into_path,
    turn_while_driving,
)
from wayproof.planners import MotionLimits


class AnyDirection(Gait):
    """A body on the ground that sets out at once, and turns meanwhile."""

    following = (
        # In motion first what keeps the stop that is always left.
        keep_admitted_trajectory,
        brake_on_path,
        # At rest, a way off the path where it is blocked at once; without one the body waits.
        step_aside,
        wait_on_path,
        set_out,
        turn_while_driving,
        drive,
        keep_course,
    )

    @classmethod
    def suits(cls, mission: Mission) -> bool:
        """Return whether a mission's body moves so."""
        return mission.planar and mission.sideways_speed > 0.0


EARLY_BENDS = (0.5, 0.05)
"""Shares of the way to a stop after which a new path may leave the present one, besides all of it:
the later ones leave more of the way ahead to be seen, the earlier ones bend less."""

REPLAN_LENGTH = 1.2
"""Distance at full speed after which a path is searched again at the latest, m."""

BLEND_SHARE = 0.3
"""Blend of a corner to the radius of a bend at full speed: a turn by 33 degrees costs no speed."""


class Flight(Gait):
    """A round body in space; with a speed in any direction it bends off its path early."""

    in_plane = False
    following = (brake_on_path, wait_on_path, drive)

    @classmethod
    def suits(cls, mission: Mission) -> bool:
        """Return whether a mission's body moves so."""
        return not mission.planar

    @property
    def early_bends(self) -> tuple[float, ...]:
        """Shares of the way to a stop after which it may leave its path, besides all of it."""
        return EARLY_BENDS if self.sideways_speed else ()

    @property
    def sees_ahead(self) -> bool:
        """Whether it sees what lies ahead while it draws near: not with only a camera."""
        return self.omnidirectional

    @property
    def replan_period(self) -> float:
        """Time between searches for a better path, s."""
        period = super().replan_period
        return min(period, REPLAN_LENGTH / self.limits.speed) if self.sideways_speed else period

    def blend_length(self, longest: float) -> float:
        """Return the longest stretch on each side of a corner over which it is rounded, m."""
        if not self.sideways_speed:
            return longest
        limits = self.limits
        return max(longest, BLEND_SHARE * limits.speed * limits.speed / limits.lateral_acceleration)


class TurnThenGo(Gait):
    """A body on the ground that turns into its path before it moves."""

    following = (
        # In motion first what keeps the stop that is always left.
        keep_admitted_trajectory,
        brake_on_path,
        wait_on_path,
        # Then the heading before the way.
        set_out,
        turn_into_path,
        drive,
        keep_course,
    )

    @classmethod
    def suits(cls, mission: Mission) -> bool:
        """Return whether a mission's body moves so."""
        return mission.planar


GAITS: tuple[type[Gait], ...] = (Flight, AnyDirection, TurnThenGo)
"""Gaits by precedence: one that may move more freely comes before one that may not."""


def gait_of(mission: Mission, limits: MotionLimits, omnidirectional: bool) -> Gait:
    """Return the first gait that suits a mission's body.

    Args:
        mission: Mission with the body.
        limits: Greatest speed, acceleration, jerk and yaw rate of a command.
        omnidirectional: Whether the sensors see all around, as `is_omnidirectional` says.
    """
    kind = next(gait for gait in GAITS if gait.suits(mission))
    return kind(limits, mission.body_discs, mission.sideways_speed, omnidirectional)
