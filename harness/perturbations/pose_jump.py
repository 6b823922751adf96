"""Perturbation of the pose by one lasting jump, as after a wrong match against a map."""

from __future__ import annotations

from typing import ClassVar

from wayproof.harness.perturbations.outage import EARLIEST, LATEST
from wayproof.harness.perturbations.perturbation import UNCHANGED, Changes, Perturbation
from wayproof.harness.perturbations.pose_drift import along, direction
from wayproof.models.pose_model import PoseError
from wayproof.models.random_streams import stream


class PoseJump(Perturbation, frozen=True, tag="pose_jump"):
    """One jump in a seeded horizontal direction at a seeded time, in whole tenths of a second.

    Within a window it jumps where the window begins, and back where it ends.

    Attributes:
        direction: About z from x, degrees; by the seed if none.
    """

    direction: float | None = None
    changes: ClassVar[Changes] = "pose"
    measured_in: ClassVar[str] = "m"
    values: ClassVar[tuple[float, float, float, float, float]] = (0.03, 0.1, 0.3, 0.8, 1.4)

    def active_pose_error(self, seed: int, time_ns: int, travelled: float) -> PoseError:
        """Return no error before the jump, all of it from then on."""
        if self.window is None and time_ns < jump_time_ns(seed):
            return UNCHANGED
        return along(direction(self.direction, seed, self.kind), self.amount)


def jump_time_ns(seed: int) -> int:
    """Return the simulated time at which the pose jumps, ns."""
    time_s = float(stream(seed, "perturbation/pose_jump", 1).uniform(EARLIEST, LATEST))
    return round(time_s * 10.0) * 10**8
