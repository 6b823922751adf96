"""Settings of a robot's sensors and of how they are simulated."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

OWN = "own"
"""Name for the device that the robot's spec mounts."""


@dataclass(frozen=True)
class SensorConfig:
    """Devices that a robot carries, and how their sweeps are simulated.

    Attributes:
        lidar: Name in `DEVICES` of the device mounted as `lidar`; `own` is the robot's own.
        depth: Name in `DEVICES` of the device mounted as `depth`; `own` is the robot's own.
        engine: `tile` is Wayproof's caster; `mujoco` takes MuJoCo's own, which is slower, to check
            an episode against it.
        semantics: Whether a sweep reports the class of the geom that each beam met, without
            errors, as a labelled camera would.
    """

    lidar: str = OWN
    depth: str = OWN
    engine: Literal["tile", "mujoco"] = "tile"
    semantics: bool = False
