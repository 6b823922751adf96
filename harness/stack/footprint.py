"""Footprint of the body: one disc or ball, or several discs at its heading; and its own space.

A recorded body stands where it stands, and its sensors do not see there.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from wayproof.harness.inputs import Pose
from wayproof.harness.mission import Mission
from wayproof.maps import INSCRIBED_COST, Costmap, Representation
from wayproof.maps.cell_sets import CellMask, box_mask, floor_mask
from wayproof.maps.elementary import exponentials, sines_cosines
from wayproof.maps.grid import centres
from wayproof.maps.states import FREE, OCCUPIED
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


def clear_footprint(a_map: Representation, mission: Mission, pose: Pose, time_ns: int) -> None:
    """Mark the body's space free, and the floor under a body on the ground.

    Args:
        a_map: Written to.
        mission: Mission with the body.
        pose: Pose of the body.
        time_ns: Time of the pose.
    """
    if not mission.planar:
        x, y, z = pose.position.tolist()
        a_map.mark_free_sphere((x, y, z), mission.radius, time_ns)
        return
    sines, cosines = sines_cosines(np.array([pose.heading]))
    size = a_map.resolution
    for offset, radius in mission.body_discs:
        x = float(pose.position[0] + offset * cosines[0])
        y = float(pose.position[1] + offset * sines[0])
        low, high = (x - radius, y - radius), (x + radius, y + radius)
        floor = floor_mask(low, high, size)
        a_map.mark(_cells_within(floor, x, y, radius, resolution=size), OCCUPIED, time_ns)
        body = box_mask((*low, 0.25 * size), (*high, mission.height), size)
        a_map.mark(_cells_within(body, x, y, radius, resolution=size), FREE, time_ns)


def _cells_within(mask: CellMask, x: float, y: float, radius: float, resolution: float) -> CellMask:
    """Return the cells of a mask whose centres lie within a radius of a vertical axis."""
    across, along, _ = mask.inside.shape
    cells = np.stack(
        np.meshgrid(np.arange(across), np.arange(along), [0], indexing="ij"), axis=-1
    ).reshape(-1, 3)
    middles = centres(cells + mask.first, resolution)[:, :2]
    near = np.square(middles - (x, y)).sum(axis=1) <= radius * radius
    return CellMask(mask.first, mask.inside & near.reshape(across, along, 1))
