"""Perturbation of the latency: decisions take longer than the stack expects."""

from __future__ import annotations

from typing import ClassVar, Literal

from wayproof.harness.perturbations.perturbation import Changes, Perturbation


class Latency(Perturbation, frozen=True, tag="latency"):
    """One stage takes longer, by the same time at each decision.

    Attributes:
        stage: Stage that is delayed; without a queue only the sum of all stages matters.
    """

    stage: Literal["sense", "map", "plan"] = "plan"
    changes: ClassVar[Changes] = "delay"
    measured_in: ClassVar[str] = "s"
    values: ClassVar[tuple[float, float, float, float, float]] = (0.02, 0.05, 0.1, 0.15, 0.25)

    def delay_at(self, seed: int, time_ns: int) -> float:
        """Return the delay added to each decision, s."""
        del seed, time_ns
        return self.amount
