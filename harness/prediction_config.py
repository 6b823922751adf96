"""Settings of the section `prediction`: what a predictor says of space that was not measured."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

from wayproof.bounds import Bounds, check_fields

NO_PREDICTOR = "none"
"""Source of no prediction."""

OWN_PREDICTORS = ("completion",)
"""Sources that are our own: their predictions are recomputed from the measured map."""

ONNX_FILE = ".onnx"
"""Ending of a network's file."""


@dataclass(frozen=True)
class PredictionConfig:
    """A predictor of unmeasured space, and what its cells may do.

    Attributes:
        source: `none`, `completion` (a small network for cells of 0.1 m), or one from outside. That
            is `module:Class`, `path/to/file.py:Class`, `FILE.onnx`, `exec:COMMAND`, or `unix:PATH`
            or `tcp:HOST:PORT` of one that listens. What it says is an input in the log.
        policy: `guide`, as `prior.policy`, below a prior map; or `ignore`. It never admits.
        occupied_from: Probability of occupancy from which a cell counts as occupied.
        free_below: Probability below which it counts as free.
        reach: Distance from the robot to the sides of the box of map that an outside predictor
            gets, m. The box ends with the operating area.
    """

    source: str = NO_PREDICTOR
    policy: Literal["guide", "ignore"] = "guide"
    occupied_from: Annotated[float, Bounds(0.5, 0.999)] = 0.8
    free_below: Annotated[float, Bounds(0.001, 0.5)] = 0.1
    reach: Annotated[float, Bounds(1.0, 100.0, "m")] = 10.0

    def __post_init__(self) -> None:
        """Check every field."""
        check_fields(self, "prediction.")
        known = self.source in (NO_PREDICTOR, *OWN_PREDICTORS)
        if not known and ":" not in self.source and not self.source.endswith(ONNX_FILE):
            names = ", ".join((NO_PREDICTOR, *OWN_PREDICTORS))
            raise ValueError(
                f"prediction.source: got '{self.source}', expected {names}, module:Class, "
                f"FILE{ONNX_FILE}, exec:COMMAND, unix:PATH or tcp:HOST:PORT"
            )


def is_outside(source: str) -> bool:
    """Return whether a source is a predictor from outside, whose predictions are inputs."""
    return source not in (NO_PREDICTOR, *OWN_PREDICTORS)
