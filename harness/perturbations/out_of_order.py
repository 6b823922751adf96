"""Perturbation of the order of sweeps: some come late, some twice, some never."""

from __future__ import annotations

from typing import ClassVar

from wayproof.harness.perturbations.perturbation import Arrival, Changes, Lag, Perturbation
from wayproof.models.random_streams import stream

LATEST = 3
"""Greatest number of messages by which one is late: 0.3 s at 10 Hz."""


class OutOfOrder(Perturbation, frozen=True, tag="out_of_order"):
    """In place of a share of the sweeps an older one comes, with its own stamp.

    One to three sweeps older: so some come after newer ones, some twice, and some never, as on a
    network without order.

    Attributes:
        sensor: The one whose sweeps they are; all of them if none is named.
    """

    sensor: str = ""
    changes: ClassVar[Changes] = "arrivals"
    measured_in: ClassVar[str] = "share"
    values: ClassVar[tuple[float, float, float, float, float]] = (0.05, 0.1, 0.2, 0.4, 0.8)

    def lag(self, arrival: Arrival) -> Lag:
        """Return a random lag of a share of the sweeps."""
        rng = stream(arrival.seed, f"perturbation/{arrival.stream}", arrival.number)
        return int(rng.integers(1, LATEST + 1)) if rng.random() < self.amount else 0
