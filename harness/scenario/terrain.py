"""Ways over terrain: whether a walking robot has level ground from start to goal."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from wayproof.harness.errors import InputError
from wayproof.models.robots import RobotSpec
from wayproof.models.world_files import FileWorld
from wayproof.models.world_files.free_space import Grid
from wayproof.models.worlds import World

Point = tuple[float, float, float]

REACH = 0.5
"""Distance from a start or goal within which level ground counts as there, m."""


def refuse_climb(world: World, spec: RobotSpec, points: Sequence[Point]) -> None:
    """Refuse a mission on terrain whose every way leaves the level ground of its start.

    To a robot that walks the floor is flat unless `costmap.max_slope` is set: what rises above its
    step height is an obstacle, and what falls a hole.

    Args:
        world: Of the episode; one without height fields is level.
        spec: The robot; one that flies is never refused.
        points: Start and goals in their order, m.

    Raises:
        InputError: There is no level way, or no level ground at one of the points.
    """
    if not isinstance(world, FileWorld) or not world.terrain or spec.motion != "ground":
        return
    from scipy import ndimage  # slow to load

    grid = Grid(world.low, world.high)
    i, j = np.indices(grid.shape).reshape(2, -1)
    heights = np.full(i.shape, -np.inf)
    for field in world.terrain:
        np.maximum(heights, field.surface(grid.centres(i, j)), out=heights)
    ground = np.where(np.isfinite(heights), heights, 0.0).reshape(grid.shape)
    radius = min((radius for _, radius in spec.discs), default=spec.radius)
    uneven = np.abs(ground) > spec.step_height
    room = ndimage.distance_transform_edt(~uneven) * grid.cell if uneven.any() else np.inf
    gaps = grid.distances(world.solids, ground, (spec.step_height, spec.height), radius)
    labels, _ = ndimage.label((gaps >= radius) & (room >= radius), np.ones((3, 3)))
    regions = [_regions_near(grid, labels, point) for point in points]
    if all(a & b for a, b in pairwise(regions)):
        return
    climb = float(np.abs(ground).max())
    raise InputError(
        f"world '{world.name}': no level ground leads '{spec.name}' from its start to its goal; it "
        f"rises or falls by up to {climb:.2f} m, and what walks takes its floor for flat; expected "
        "a start and goal on one level, a robot that flies, or --set costmap.max_slope=0.3 to try"
    )


def _regions_near(grid: Grid, labels: NDArray[np.int32], point: Point) -> set[int]:
    """Return the regions that come within `REACH` of a point."""
    cell = (np.array(point[:2]) - grid.low) / grid.cell
    reach = REACH / grid.cell
    low = np.clip(np.floor(cell - reach), 0, None).astype(int)
    high = np.ceil(cell + reach).astype(int) + 1
    near = labels[low[0] : max(high[0], 0), low[1] : max(high[1], 0)]
    return set(near[near > 0].tolist())
