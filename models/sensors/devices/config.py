"""Which sensors a robot carries and how they are simulated."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

OWN = "own"
"""In place of a device's name: what the robot carries by itself."""


@dataclass(frozen=True)
class SensorConfig:
    """Which sensors a robot carries and how they are simulated.

    Attributes:
        lidar: Name in `DEVICES` of what is mounted as `lidar`, or `own` for the robot's own.
        depth: Likewise as `depth`.
        engine: `tile` is Wayproof's caster; `mujoco` takes MuJoCo's own, which is slower and lets
            anybody check an episode against it.
        semantics: Whether a sweep tells of each return what it met, as a labelled camera would: the
            class of the geom, without an error.
    """

    lidar: str = OWN
    depth: str = OWN
    engine: Literal["tile", "mujoco"] = "tile"
    semantics: bool = False
