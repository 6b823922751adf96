"""Perturbation of ranges by noise beyond the device's figures."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from wayproof.harness.perturbations.perturbation import Changes, Perturbation, Ranges, Report
from wayproof.models.sensors.beams import MILLIMETRES


class DepthNoise(Perturbation, frozen=True, tag="depth_noise"):
    """An additional Gaussian error of each echo of every sensor, independent from beam to beam."""

    changes: ClassVar[Changes] = "ranges"
    measured_in: ClassVar[str] = "m"
    values: ClassVar[tuple[float, float, float, float, float]] = (0.01, 0.03, 0.06, 0.12, 0.24)

    def report(self, report: Report) -> Ranges:
        """Add the error to the sweep, clipped to the device's range so that no echo is lost."""
        device, reported = report.device, report.ranges_mm
        error = self.amount * MILLIMETRES * report.rng().standard_normal(len(reported))
        nearest = max(1.0, device.minimum_range * MILLIMETRES)
        noisy = np.clip(np.rint(reported + error), nearest, device.range * MILLIMETRES)
        return np.where(report.echoes, noisy, reported).astype(np.uint32)
