"""Occupancy maps and costmaps; numpy and numba only."""

from __future__ import annotations

if __name__ != "wayproof.maps":  # from the root of a clone, where it would be a second copy
    raise ImportError("got 'import maps', expected 'import wayproof.maps'")

import numpy as np

from wayproof.maps import elementary
from wayproof.maps.columns import states_in
from wayproof.maps.config import CostmapConfig, DynamicConfig, MapConfig, UnknownPolicy
from wayproof.maps.costmap.class_margins import ClassMargins
from wayproof.maps.costmap.costmap import INSCRIBED_COST, Costmap
from wayproof.maps.costmap.distance_field import DistanceField
from wayproof.maps.costmap.inflation import collision_distance_sq
from wayproof.maps.others.dynamic import DynamicMap
from wayproof.maps.others.grid2d import Grid2D
from wayproof.maps.others.octomap import OctoMap
from wayproof.maps.others.tsdf import TsdfMap
from wayproof.maps.representation import Representation
from wayproof.maps.semantic import UNLABELLED, SemanticLayer
from wayproof.maps.states import FREE, OCCUPIED, STATE_NAMES, UNKNOWN
from wayproof.maps.sweep import SweepStatistics, beams_from_points
from wayproof.maps.voxel.voxel_map import RayEnd, VoxelMap

MAPS: dict[str, type[Representation]] = {
    "dynamic": DynamicMap,
    "grid2d": Grid2D,
    "octomap": OctoMap,
    "tsdf": TsdfMap,
    "voxel": VoxelMap,
}
"""Representations by name."""

LATER_NS = 100_000_000_000
"""Time at which a map that is compiled closes a period of `DynamicConfig`, ns."""

__all__ = [
    "FREE",
    "INSCRIBED_COST",
    "MAPS",
    "OCCUPIED",
    "STATE_NAMES",
    "UNKNOWN",
    "UNLABELLED",
    "ClassMargins",
    "Costmap",
    "CostmapConfig",
    "DistanceField",
    "DynamicConfig",
    "DynamicMap",
    "Grid2D",
    "MapConfig",
    "RayEnd",
    "Representation",
    "SemanticLayer",
    "SweepStatistics",
    "TsdfMap",
    "UnknownPolicy",
    "VoxelMap",
    "beams_from_points",
    "collision_distance_sq",
    "states_in",
    "warm_up",
]


def warm_up(kind: str = "voxel", max_slope: float = 0.0, labels: bool = False) -> None:
    """Compile the kernels of an episode on one representation, before anything is timed."""
    half_life = 1.0 if MAPS[kind].decays else 0.0
    config = MapConfig(kind=kind, memory_mib=1, half_life=half_life)
    costs = CostmapConfig(max_slope=max_slope)
    tiny = MAPS[kind](config)
    beams, ranges_mm = np.array([[1.0, 0, 0], [0, 0, -1.0]]), np.array([400, 65535], np.uint16)
    tiny.integrate((0.5, 0.5, 0.5), beams, ranges_mm, 1.0, 0)
    tiny.mark_free((0.0, 0.0, 0.1), (0.2, 0.2, 0.3), 0)
    tiny.advance(round(2e9 * config.decay_period))
    tiny.observed_ns_at([[0.5, 0.5, 0.5]])
    tiny.integrate((0.5, 0.5, 0.5), beams, ranges_mm, 1.0, LATER_NS)
    tiny.version()
    tiny.counts()
    low, high = (0.0, 0.0, -0.2), (1.0, 1.0, 1.0)
    Costmap(costs, tiny, low, high, "ground", radius=0.1, height=0.5, step_height=0.15)
    Costmap(costs, tiny, low, high, "air", radius=0.1, height=0.2, step_height=0.0)
    elementary.arc_tangent(0.0, 1.0)
    elementary.norm(np.zeros(3))
    if labels:
        layer = SemanticLayer(config.resolution, 1, memory_mib=1)
        classes = np.zeros(2, np.uint8)
        moments = np.zeros(2, np.int32)
        layer.integrate_sweep((0.5, 0.5, 0.5), beams, ranges_mm, (0.1, 1.0), classes, moments)
        layer.votes_at([[0.5, 0.5, 0.5]])
        margined = ClassMargins(tiny, layer, {0: 0.1})
        Costmap(costs, margined, low, high, "ground", radius=0.1, height=0.5, step_height=0.15)
    tiny.advance(round(1e4 * 1e9 * config.decay_period))  # forgets its bricks
