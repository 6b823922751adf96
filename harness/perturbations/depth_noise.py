"""Ranges are noisier than the device's figures say."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

import numpy as np

from wayproof.harness.perturbations.perturbation import Perturbation, Ranges, Report
from wayproof.models.sensors.beams import MILLIMETRES


class DepthNoise(Perturbation, frozen=True, tag="depth_noise"):
    """A Gaussian error more on each echo of every sensor, independent from beam to beam."""

    measured_in: ClassVar[str] = "m"
    values: ClassVar[tuple[float, float, float, float, float]] = (0.01, 0.03, 0.06, 0.12, 0.24)

    def affected(self, sensors: Sequence[str]) -> tuple[str, ...]:
        """All sensors."""
        return tuple(sensors)

    def report(self, report: Report) -> Ranges:
        """The sweep with the error; it does not make an echo one that was not seen."""
        device, reported = report.device, report.ranges_mm
        error = self.amount * MILLIMETRES * report.rng().standard_normal(len(reported))
        nearest = max(1.0, device.minimum_range * MILLIMETRES)
        noisy = np.clip(np.rint(reported + error), nearest, device.range * MILLIMETRES)
        return np.where(report.echoes, noisy, reported).astype(np.uint16)
