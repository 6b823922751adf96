"""Perturbation of the range scale: every range is too long by one factor."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from wayproof.harness.perturbations.perturbation import Changes, Perturbation, Ranges, Report
from wayproof.models.sensors.beams import MILLIMETRES


class DepthScale(Perturbation, frozen=True, tag="depth_scale"):
    """Obstacles seem farther away than they are, to every sensor by the same factor 1 + amount."""

    changes: ClassVar[Changes] = "ranges"
    measured_in: ClassVar[str] = "share"
    values: ClassVar[tuple[float, float, float, float, float]] = (0.005, 0.01, 0.02, 0.05, 0.1)

    def report(self, report: Report) -> Ranges:
        """Return the sweep with longer ranges; echoes then beyond the device's range are lost."""
        scaled = np.rint(report.ranges_mm * (1.0 + self.amount))
        seen = scaled <= report.device.range * MILLIMETRES
        longer = np.where(seen, scaled, report.silence)
        return np.where(report.echoes, longer, report.ranges_mm).astype(np.uint32)
