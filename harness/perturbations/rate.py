"""Perturbation of the sensor rate below the rate of decisions."""

from __future__ import annotations

import math
from typing import ClassVar

from wayproof.harness.perturbations.perturbation import Arrival, Changes, Lag, Perturbation


class Rate(Perturbation, frozen=True, tag="rate"):
    """Only each n-th sweep of every sensor arrives; decisions are made as often as before.

    For a fractional n, the sweeps that come next after whole multiples of n arrive.
    """

    changes: ClassVar[Changes] = "arrivals"
    measured_in: ClassVar[str] = "divisor"
    values: ClassVar[tuple[float, float, float, float, float]] = (2.0, 3.0, 5.0, 10.0, 20.0)
    nothing: ClassVar[float] = 1.0

    def lag(self, arrival: Arrival) -> Lag:
        """Return none of the sweeps between those that arrive."""
        number = arrival.number
        arrives = math.floor(number / self.amount) > math.floor((number - 1) / self.amount)
        return 0 if arrives else "none"
