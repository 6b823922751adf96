"""Perturbation of a sensor's stream: nothing arrives any more."""

from __future__ import annotations

from typing import ClassVar

from wayproof.harness.perturbations.outage import Outage
from wayproof.harness.perturbations.perturbation import Arrival, Changes, Lag


class SensorStop(Outage, frozen=True, tag="sensor_stop"):
    """No sweep arrives for a while, as with a broken cable or a driver that died.

    Attributes:
        sensor: The one that stops; all of them if none is named.
    """

    sensor: str = ""
    changes: ClassVar[Changes] = "arrivals"

    def lag(self, arrival: Arrival) -> Lag:
        """Return none during the outage."""
        return 0 if self.end_ns(arrival.seed, arrival.time_ns) is None else "none"
