"""Perturbation of the field of view: a blocked sector of the first sensor."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from wayproof.harness.perturbations.perturbation import Changes, Perturbation, Ranges, Report
from wayproof.models.random_streams import stream
from wayproof.models.sensors.beams import DROPPED


class Occlusion(Perturbation, frozen=True, tag="occlusion"):
    """A sector of azimuth about a seeded beam of the first sensor gives no information, or no echo.

    Attributes:
        mode: `blind` beams give no information, as behind a mast; `silent` ones lose their echo, as
            behind dirt or glass, and the device reports that as it reports a lost echo.
        direction: Azimuth of its middle in the sensor's frame, about z from x, degrees; by the seed
            if none.
    """

    mode: Literal["blind", "silent"] = "blind"
    direction: float | None = None
    changes: ClassVar[Changes] = "ranges"
    measured_in: ClassVar[str] = "degrees"
    values: ClassVar[tuple[float, float, float, float, float]] = (10.0, 30.0, 60.0, 120.0, 240.0)

    def affected(self, sensors: Sequence[str]) -> tuple[str, ...]:
        """Return the first sensor."""
        return tuple(sensors[:1])

    def report(self, report: Report) -> Ranges:
        """Return the sweep with its blocked beams blinded, or without their echoes."""
        cosine = _planar(report.directions) @ self._centre(report)
        blocked = cosine >= math.cos(math.radians(0.5 * self.amount))
        if self.mode == "silent":
            return np.where(blocked & report.echoes, report.silence, report.ranges_mm)
        return np.where(blocked, DROPPED, report.ranges_mm)

    def _centre(self, report: Report) -> NDArray[np.float64]:  # (2,)
        if self.direction is not None:
            angle = math.radians(self.direction)
            return np.array([math.cos(angle), math.sin(angle)])
        beams = _planar(report.first_directions)
        chosen = stream(report.seed, "perturbation/occlusion", 0).integers(len(beams))
        return np.asarray(beams[chosen])


def _planar(beams: NDArray[np.float64]) -> NDArray[np.float64]:  # (n, 2)
    """Return unit vectors of the beams' azimuths; a vertical beam has none and is never blocked."""
    plane = beams[:, :2]
    length = np.linalg.norm(plane, axis=1, keepdims=True)
    azimuths = np.zeros_like(plane)
    np.divide(plane, length, out=azimuths, where=length > 0.0)
    return azimuths
