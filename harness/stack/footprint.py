"""Footprint of the body for planning: one disc or ball, or several discs at its heading."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from wayproof.harness.mission import Mission
from wayproof.maps import INSCRIBED_COST, Costmap
from wayproof.maps.elementary import exponentials
from wayproof.planners import Body

Array = NDArray[np.float64]

HEADING_TOLERANCE = 0.05
"""Yaw error of the body that the margin covers, rad; a larger one is planned with."""

COST_STEPS = 2.0**20
"""Number of steps of a unit of cost, to which costs are rounded."""

NARROW_COST = 2.0
"""Cost at the edge of the inflation, where the body cannot turn; where it just can, it is 1."""


def body_of(mission: Mission) -> Body:
    """Return the discs of a mission's body, or the circumscribed one."""
    offsets, radii = zip(*mission.body_discs, strict=True)
    return Body(offsets, radii)


def lever_arm(body: Body) -> float:
    """Return the lever arm of the outermost disc: its shift by an error of the yaw, m/rad."""
    return max(abs(offset) for offset in body.offsets)


def costs(costmap: Costmap, body: Body) -> Array:
    """Return the cost of a cell by squared distance, (t,): 1 where the body can just turn.

    Beyond, it falls as the costmap's does; nearer, it grows to ``NARROW_COST``.
    """
    table: Array = costmap.cost_table / INSCRIBED_COST
    width = body.circumscribed_radius - min(body.radii)
    if width <= 0.0:
        return table
    away = np.sqrt(np.arange(len(table))) * costmap.resolution - costmap.inflation_radius - width
    fall = exponentials(-costmap.config.cost_scaling_factor * np.maximum(away, 0.0))
    narrow = np.clip(-away / width, 0.0, 1.0) * (NARROW_COST - 1.0)
    grown: Array = np.rint((fall + narrow) * COST_STEPS) / COST_STEPS
    grown[table == math.inf] = math.inf
    grown[-1] = 0.0  # that far or farther
    return grown
