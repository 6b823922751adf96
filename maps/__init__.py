"""Occupancy maps and costmaps; numpy and numba only."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from maps.columns import states_in
from maps.config import MapConfig, UnknownPolicy
from maps.costmap import INSCRIBED_COST, Costmap
from maps.grid2d import Grid2D
from maps.inflation import inflate
from maps.octomap import OctoMap
from maps.representation import Representation
from maps.states import FREE, OCCUPIED, STATE_NAMES, UNKNOWN
from maps.sweep import SweepStatistics
from maps.tsdf import TsdfMap
from maps.voxel import RayEnd, VoxelMap

MAPS: dict[str, Callable[[MapConfig, int], Representation]] = {
    "grid2d": Grid2D,
    "octomap": OctoMap,
    "tsdf": TsdfMap,
    "voxel": VoxelMap,
}
"""Representations by name, made from the settings and a number of threads."""

__all__ = [
    "FREE",
    "INSCRIBED_COST",
    "MAPS",
    "OCCUPIED",
    "STATE_NAMES",
    "UNKNOWN",
    "Costmap",
    "Grid2D",
    "MapConfig",
    "RayEnd",
    "Representation",
    "SweepStatistics",
    "TsdfMap",
    "UnknownPolicy",
    "VoxelMap",
    "inflate",
    "states_in",
    "warm_up",
]


def warm_up() -> None:
    """Compile every kernel of the package, so that nothing timed pays for it."""
    config = MapConfig(memory_mib=1)
    tiny = VoxelMap(config)
    beams = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
    for representation in (Grid2D(config), TsdfMap(config), tiny):
        ranges_mm = np.array([400, 65535], np.uint16)
        representation.integrate((0.5, 0.5, 0.5), beams, ranges_mm, 1.0, 0)
        representation.mark_free((0.0, 0.0, 0.1), (0.2, 0.2, 0.3), 0)
        representation.columns((0, 0, 0), (1, 1, 1))
        representation.advance(round(2e9 * config.decay_period))
        representation.probability_at([[0.5, 0.5, 0.5]])
        representation.version()
        representation.counts()
    tiny.cast_ray((0.5, 0.5, 0.5), (1.0, 0.0, 0.0), 1.0)
    low, high = (0.0, 0.0, -0.2), (1.0, 1.0, 1.0)
    Costmap(config, tiny, low, high, "ground", radius=0.1, height=0.5, step_height=0.15)
    costmap = Costmap(config, tiny, low, high, "air", radius=0.1, height=0.2, step_height=0.0)
    costmap.clearance_at([[0.5, 0.5, 0.5]])
    costmap.cost_at([[0.5, 0.5, 0.5]])
    inflate(np.zeros((1, 1, 1), np.uint64), 1)
    tiny.advance(round(1e4 * 1e9 * config.decay_period))  # forgets its bricks
