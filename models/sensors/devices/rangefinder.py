"""Rangefinders: sensors of a single beam."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from wayproof.models.sensors.beams import BeamTable
from wayproof.models.sensors.devices.device import Device


@dataclass(frozen=True, kw_only=True)
class Rangefinder(Device):
    """One beam by MuJoCo's own `<rangefinder>` sensor, which sees no geom of its own body."""

    kind: ClassVar[str] = "rangefinder"
    by_mujoco: ClassVar[bool] = True

    def beam_table(self) -> BeamTable:
        """Return the one beam, along the site's z axis as MuJoCo defines it."""
        return BeamTable(
            rows=np.array([[0.0, 1.0]]),
            columns=np.array([[1.0, 0.0]]),
            beams=1,
            measures=self.measures,
        )
