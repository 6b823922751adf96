"""Perturbation of a sensor's stream: the last sweep comes again and again, stamped as new."""

from __future__ import annotations

from typing import ClassVar

from wayproof.harness.perturbations.outage import Outage
from wayproof.harness.perturbations.perturbation import Arrival, Changes, Lag


class SensorFreeze(Outage, frozen=True, tag="sensor_freeze"):
    """The last sweep is repeated for a while under new stamps, as by a driver's stuck buffer.

    PX4's failure injection calls it `stuck`.

    Attributes:
        sensor: The one that freezes; all of them if none is named.
    """

    sensor: str = ""
    changes: ClassVar[Changes] = "arrivals"
    restamps: ClassVar[bool] = True

    def lag(self, arrival: Arrival) -> Lag:
        """Return the last one during the outage."""
        return 0 if self.end_ns(arrival.seed, arrival.time_ns) is None else "last"
