"""Perturbation of echoes: a share is lost, single ones, a patch, or whole sweeps."""

from __future__ import annotations

import math
from typing import ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from wayproof.harness.perturbations.perturbation import Changes, Perturbation, Ranges, Report


class DepthDropout(Perturbation, frozen=True, tag="depth_dropout"):
    """A share of the echoes of every sensor is lost, as the device reports a lost echo.

    Attributes:
        mode: `ray` loses each by itself, `patch` those of one seeded rectangle of the image (a run
            of beams where a sensor has no image), `sweep` those of a whole sweep at once.
    """

    mode: Literal["ray", "patch", "sweep"] = "ray"
    changes: ClassVar[Changes] = "ranges"
    measured_in: ClassVar[str] = "share"
    values: ClassVar[tuple[float, float, float, float, float]] = (0.01, 0.03, 0.1, 0.3, 0.6)

    def report(self, report: Report) -> Ranges:
        """Return the sweep without the echoes that are lost."""
        lost = LOST[self.mode](report, self.amount) & report.echoes
        return np.where(lost, report.silence, report.ranges_mm)


def _rays(report: Report, share: float) -> NDArray[np.bool_]:
    return report.rng().random(len(report.ranges_mm)) < share


def _patch(report: Report, share: float) -> NDArray[np.bool_]:
    """Choose a patch of that share of the image, of its shape; it may wrap round the columns."""
    rows, columns = report.image_shape
    height = max(1, round(rows * math.sqrt(share)))
    width = max(1, round(share * rows * columns / height))
    rng = report.rng()
    top = int(rng.integers(rows - height + 1))
    first = int(rng.integers(columns))
    lost = np.zeros((rows, columns), np.bool_)
    lost[top : top + height, (first + np.arange(width)) % columns] = True
    return lost.ravel()


def _sweep(report: Report, share: float) -> NDArray[np.bool_]:
    return np.full(len(report.ranges_mm), report.rng().random() < share)


LOST = {"ray": _rays, "patch": _patch, "sweep": _sweep}
"""Mask of the lost echoes by mode."""
