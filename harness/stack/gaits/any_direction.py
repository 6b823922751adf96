"""Going in any direction: a body on the ground that moves sideways, too, at some speed."""

from __future__ import annotations

from wayproof.harness.mission import Mission
from wayproof.harness.stack.gait import Gait
from wayproof.harness.stack.manoeuvres.course_keeping import keep_admitted_trajectory, keep_course
from wayproof.harness.stack.manoeuvres.driving import drive
from wayproof.harness.stack.manoeuvres.following import brake_on_path, wait_on_path
from wayproof.harness.stack.manoeuvres.setting_out import set_out, step_aside, turn_while_driving


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
