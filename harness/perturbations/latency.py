"""Decisions take longer than the stack reckons with."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar, Literal

from wayproof.harness.perturbations.perturbation import Perturbation


class Latency(Perturbation, frozen=True, tag="latency"):
    """One stage takes longer, by the same time at each decision.

    Attributes:
        stage: Where the time is lost; the pipeline has no queue, so the robot feels only the sum.
    """

    stage: Literal["sense", "map", "plan"] = "plan"
    measured_in: ClassVar[str] = "s"
    values: ClassVar[tuple[float, float, float, float, float]] = (0.02, 0.05, 0.1, 0.15, 0.25)

    def streams(self, sensors: Sequence[str]) -> tuple[str, ...]:
        """The delays."""
        return ("latency",)

    @property
    def delay(self) -> float:
        """What it adds to the delay of a decision, s."""
        return self.amount
