"""Occupancy maps and costmaps; numpy and numba only."""

from __future__ import annotations

import numpy as np

from maps.config import MapConfig, UnknownPolicy
from maps.costmap import INSCRIBED_COST, Costmap
from maps.dynamic import DynamicMap
from maps.inflation import inflate
from maps.semantic import UNLABELLED, SemanticLayer
from maps.states import FREE, OCCUPIED, STATE_NAMES, UNKNOWN
from maps.sweep import SweepStatistics
from maps.voxel import RayEnd, VoxelMap

MAPS = {"voxel": VoxelMap, "dynamic": DynamicMap}
"""Representations by name. Each answers the methods of VoxelMap."""

__all__ = [
    "FREE",
    "INSCRIBED_COST",
    "MAPS",
    "OCCUPIED",
    "STATE_NAMES",
    "UNKNOWN",
    "UNLABELLED",
    "Costmap",
    "DynamicMap",
    "MapConfig",
    "RayEnd",
    "SemanticLayer",
    "SweepStatistics",
    "UnknownPolicy",
    "VoxelMap",
    "inflate",
    "warm_up",
]


def warm_up() -> None:
    """Compile every kernel of the package, so that nothing timed pays for it."""
    config = MapConfig(memory_mib=1)
    tiny = VoxelMap(config)
    beams = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
    tiny.integrate((0.5, 0.5, 0.5), beams, np.array([400, 65535], np.uint16), 1.0, 0)
    tiny.advance(round(2e9 * config.decay_period))
    tiny.probability_at([[0.5, 0.5, 0.5]])
    tiny.cast_ray((0.5, 0.5, 0.5), (1.0, 0.0, 0.0), 1.0)
    tiny.version()
    low, high = (0.0, 0.0, -0.2), (1.0, 1.0, 1.0)
    Costmap(config, tiny, low, high, "ground", radius=0.1, height=0.5, step_height=0.15)
    costmap = Costmap(config, tiny, low, high, "air", radius=0.1, height=0.2, step_height=0.0)
    costmap.clearance_at([[0.5, 0.5, 0.5]])
    costmap.cost_at([[0.5, 0.5, 0.5]])
    inflate(np.zeros((1, 1, 1), np.uint64), 1)
    traffic = DynamicMap(config)
    traffic.integrate((0.5, 0.5, 0.5), beams, np.array([400, 65535], np.uint16), 1.0, 10**10)
    traffic.columns((0, 0, 0), (1, 1, 1))
    labels = SemanticLayer(config.resolution, classes=1, memory_mib=1)
    labels.integrate([[0.5, 0.5, 0.5]], np.zeros(1, np.uint8))
    labels.label_at([[0.5, 0.5, 0.5]])
    tiny.advance(round(1e4 * 1e9 * config.decay_period))  # forgets its bricks
