"""Pinhole depth cameras."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from wayproof.models.sensors.beams import BeamTable, Measures
from wayproof.models.sensors.devices.device import Device


@dataclass(frozen=True, kw_only=True)
class DepthCamera(Device):
    """A pinhole camera with a global shutter; x along its axis, the image's top row up.

    Attributes:
        height: Rows of pixels.
        width: Columns of pixels.
        field_of_view_horizontal: Full angle, rad.
        field_of_view_vertical: Full angle, rad.
    """

    kind: ClassVar[str] = "depth_camera"

    height: int
    width: int
    field_of_view_horizontal: float
    field_of_view_vertical: float
    measures: Measures = "depth"

    def beam_table(self) -> BeamTable:
        """Return slopes z/x of each row and y/x of each column, through the pixels' centres."""
        for name in ("field_of_view_horizontal", "field_of_view_vertical"):
            angle = getattr(self, name)
            if not 0.0 < angle < math.pi:
                raise ValueError(f"{name}: got {angle:g}, expected > 0 to less than pi rad")
        if min(self.height, self.width) < 1:
            raise ValueError(
                f"height, width: got {self.height} and {self.width}, expected each >= 1"
            )
        rows = np.tan(self.field_of_view_vertical / 2) * _pixel_centres(self.height)
        columns = np.tan(self.field_of_view_horizontal / 2) * _pixel_centres(self.width)
        return BeamTable(
            rows=rows[:, None],
            columns=columns[:, None],
            beams=self.height * self.width,
            measures=self.measures,
        )


def _pixel_centres(count: int) -> NDArray[np.float64]:
    """Return pixel centres over [1, -1], the top row and the left column first."""
    centres: NDArray[np.float64] = 1.0 - (2.0 * np.arange(count) + 1.0) / count
    return centres
