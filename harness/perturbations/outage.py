"""Outages: something stops for a while, from a time that the seed or a window gives."""

from __future__ import annotations

from typing import ClassVar

from wayproof.harness.perturbations.perturbation import Perturbation
from wayproof.models.random_streams import stream

EARLIEST, LATEST = 2.0, 10.0
"""Span of a seeded beginning, s: the robots are on their way, and in most worlds not yet there."""


class Outage(Perturbation, frozen=True):
    """Something stops for the amount, in s, or until its window ends.

    It begins with the window, else at a seeded time in whole tenths of a second.
    """

    measured_in: ClassVar[str] = "s"
    values: ClassVar[tuple[float, float, float, float, float]] = (0.3, 1.0, 2.0, 5.0, 100.0)

    def end_ns(self, seed: int, time_ns: int) -> int | None:
        """Return when the outage that includes a time ends, ns; None outside of it."""
        begin_s, latest_s = self.window or (self._begin_s(seed), float("inf"))
        end_s = min(begin_s + self.amount, latest_s)
        return round(end_s * 1e9) if round(begin_s * 1e9) <= time_ns < end_s * 1e9 else None

    def _begin_s(self, seed: int) -> float:
        drawn = stream(seed, f"perturbation/{self.kind}", 1).uniform(EARLIEST, LATEST)
        return round(float(drawn) * 10.0) / 10.0
