"""Turning on the spot, then going: a body on the ground that moves only where it faces."""

from __future__ import annotations

from wayproof.harness.mission import Mission
from wayproof.harness.stack.gait import Gait
from wayproof.harness.stack.manoeuvres.course_keeping import keep_admitted_trajectory, keep_course
from wayproof.harness.stack.manoeuvres.driving import drive
from wayproof.harness.stack.manoeuvres.following import brake_on_path, wait_on_path
from wayproof.harness.stack.manoeuvres.setting_out import set_out, turn_into_path


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
