"""Settings of the section `prediction`: what a predictor says of space that was not measured."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

from wayproof.maps.bounds import Bounds, check_fields

NO_PREDICTOR = "none"
"""Source of no prediction."""


@dataclass(frozen=True)
class PredictionConfig:
    """A predictor of unmeasured space, and what its cells may do.

    Attributes:
        source: `none`, or `completion`: a small network that continues what was measured, for
            cells of 0.1 m.
        policy: `guide`, as `prior.policy`, below a prior map; or `ignore`. It never admits.
        occupied_from: Probability of occupancy from which a cell counts as occupied.
        free_below: Probability below which it counts as free.
    """

    source: Literal["none", "completion"] = "none"
    policy: Literal["guide", "ignore"] = "guide"
    occupied_from: Annotated[float, Bounds(0.5, 0.999)] = 0.8
    free_below: Annotated[float, Bounds(0.001, 0.5)] = 0.1

    def __post_init__(self) -> None:
        """Check every field."""
        check_fields(self, "prediction.")
