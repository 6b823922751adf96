"""Costs of a costmap by the scale of Nav2."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wayproof.maps.costmap.costmap import Costmap
from wayproof.maps.states import OCCUPIED, UNKNOWN

INSCRIBED, LETHAL, NO_INFORMATION = 253, 254, 255
"""Costs of `nav2_costmap_2d/cost_values.hpp`; free space without any is 0."""


def costs_of(costmap: Costmap, layer: int, collision_distance_sq: int) -> NDArray[np.uint8]:
    """Return costs (nx, ny) of a layer by Nav2's scale.

    Occupied cells are lethal (254), unknown ones have no information (255), free ones within the
    inflation radius of an occupied one are inscribed (253), and beyond it the cost falls by Nav2's
    law from 252 to 0.

    Args:
        costmap: The costmap.
        layer: Index along z.
        collision_distance_sq: Greatest squared distance that is forbidden, cells^2.
    """
    states = costmap.state[:, :, layer]
    distances = costmap.obstacle_clearance[:, :, layer]
    fall = np.where(np.isinf(costmap.cost_table), INSCRIBED, costmap.cost_table)
    costs = np.floor(fall).astype(np.uint8)[distances]
    costs[distances <= collision_distance_sq] = INSCRIBED
    costs[states == OCCUPIED] = LETHAL
    costs[states == UNKNOWN] = NO_INFORMATION
    return costs
