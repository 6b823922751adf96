"""Perturbation of ranges by what is in the air: rain, snow, dust."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from wayproof.harness.perturbations.perturbation import Changes, Perturbation, Ranges, Report
from wayproof.models.sensors.beams import DROPPED, MILLIMETRES

NEAREST = 0.5
"""Least distance of a false return, m: nearer ones fall to a device's own filter."""

FARTHEST = 10.0
"""Greatest distance, m; an echo fades with its square, and a drop's is weak."""


class FalseReturns(Perturbation, frozen=True, tag="false_returns"):
    """A share of the beams of every sensor returns from something small in the air.

    Drops and flakes are everywhere alike, and the chance that one is detected is taken to fall with
    the square of its distance, as the power of its echo does (lidar equation; Goodin et al. 2019,
    "Predicting the Influence of Rain on LIDAR in ADAS", Electronics 8(1)). A beam that meets a
    surface before it is as it was.
    """

    changes: ClassVar[Changes] = "ranges"
    measured_in: ClassVar[str] = "share"
    values: ClassVar[tuple[float, float, float, float, float]] = (0.001, 0.003, 0.01, 0.03, 0.1)

    def report(self, report: Report) -> Ranges:
        """Return the sweep with the false returns that come before a beam's own."""
        device, reported, rng = report.device, report.ranges_mm, report.rng()
        chosen = rng.random(len(reported)) < self.amount
        nearest = max(NEAREST, device.minimum_range)
        farthest = max(min(FARTHEST, device.range), nearest)
        # The distribution of a density that falls with the square, inverted.
        share = rng.random(len(reported)) * (1.0 / nearest - 1.0 / farthest)
        false = np.rint(MILLIMETRES / (1.0 / nearest - share))
        before = (false < reported) & (reported != DROPPED)
        return np.where(chosen & before, false, reported).astype(np.uint32)
