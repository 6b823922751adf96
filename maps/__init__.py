"""Occupancy maps and costmaps; numpy and numba only."""

from __future__ import annotations

from typing import Any

import numpy as np

from maps.config import MapConfig, UnknownPolicy
from maps.costmap import INSCRIBED_COST, Costmap
from maps.octomap import OctoMap
from maps.states import FREE, OCCUPIED, STATE_NAMES, UNKNOWN
from maps.sweep import SweepStatistics
from maps.voxel import VoxelMap

MAPS: dict[str, Any] = {"octomap": OctoMap, "voxel": VoxelMap}
"""Representations by name. Each answers the methods of VoxelMap."""

__all__ = [
    "FREE",
    "INSCRIBED_COST",
    "MAPS",
    "OCCUPIED",
    "STATE_NAMES",
    "UNKNOWN",
    "Costmap",
    "MapConfig",
    "SweepStatistics",
    "UnknownPolicy",
    "VoxelMap",
    "warm_up",
]


def warm_up() -> None:
    """Compile every kernel of the package, so that nothing timed pays for it."""
    config = MapConfig()
    tiny = VoxelMap(config, (0.0, 0.0, -0.2), (1.0, 1.0, 1.0))
    beams = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
    tiny.integrate((0.5, 0.5, 0.5), beams, np.array([400, 65535], np.uint16), 1.0, 0)
    tiny.advance(round(2e9 * config.decay_period))
    tiny.state_at([[0.5, 0.5, 0.5]])
    tiny.version()
    Costmap(config, tiny, "ground", radius=0.1, height=0.5, step_height=0.15)
    Costmap(config, tiny, "air", radius=0.1, height=0.2, step_height=0.0)
