"""Small map with every kind of cell."""

import numpy as np

from wayproof.maps import Costmap, CostmapConfig, MapConfig, VoxelMap

LOW, HIGH = (0.0, 0.0, 0.0), (4.0, 4.0, 1.0)


def seen_map():
    """Free from x = 0 to 2 m, one obstacle in it, unknown beyond."""
    config = MapConfig(resolution=0.1, half_life=0.0)
    a_map = VoxelMap(config)
    a_map.mark_free((0.0, 0.0, 0.0), (2.0, 4.0, 1.0), 0)
    beam, ranges_mm = np.array([[1.0, 0.0, 0.0]]), np.array([500], np.uint16)
    for sweep in range(8):
        a_map.integrate((0.55, 2.05, 0.55), beam, ranges_mm, 2.0, sweep)
    return a_map, Costmap(CostmapConfig(), a_map, LOW, HIGH, "air", 0.15, 0.2, 0.0)
