"""Perturbation of the pose's stream: no estimate comes any more."""

from __future__ import annotations

from typing import ClassVar

from wayproof.harness.perturbations.outage import Outage
from wayproof.harness.perturbations.perturbation import Arrival, Changes, Lag


class PoseStop(Outage, frozen=True, tag="pose_stop"):
    """For a while the stack has no newer pose than the last one, by whose stamp it can tell.

    The controllers of the body, which estimate its motion themselves, go on.
    """

    changes: ClassVar[Changes] = "pose_arrivals"

    def lag(self, arrival: Arrival) -> Lag:
        """Return the last one during the outage."""
        return 0 if self.end_ns(arrival.seed, arrival.time_ns) is None else "last"
