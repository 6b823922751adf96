"""Footprint clearing: the space of a recorded robot is free at the place where it stands.

That the robot stands there is evidence as good as a beam, and its sensors do not see there. Nav2's
obstacle layer does the same (`footprint_clearing_enabled`). Occupied cells stay, and nothing beyond
the bare body is cleared, no margin either.
"""

from __future__ import annotations

import numpy as np

from wayproof.harness.inputs import Pose
from wayproof.harness.mission import Mission
from wayproof.maps import Representation
from wayproof.maps.cell_sets import CellMask, box_mask, floor_mask
from wayproof.maps.elementary import sines_cosines
from wayproof.maps.grid import centres
from wayproof.maps.states import FREE, OCCUPIED


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
