"""Perturbation of the stack's processor: it gets none for a while."""

from __future__ import annotations

from typing import ClassVar

from wayproof.harness.perturbations.outage import Outage
from wayproof.harness.perturbations.perturbation import Changes


class StackStall(Outage, frozen=True, tag="stack_stall"):
    """Each decision that falls into the stall is late by what is left of it.

    By simulated time, so in lockstep and on a stack's own timer alike; beyond `latency.deadline` a
    decision is discarded, and the robot ends what it follows.
    """

    changes: ClassVar[Changes] = "delay"

    def delay_at(self, seed: int, time_ns: int) -> float:
        """Return the time that is left of the stall, s."""
        end_ns = self.end_ns(seed, time_ns)
        return 0.0 if end_ns is None else (end_ns - time_ns) * 1e-9
