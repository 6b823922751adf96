"""Ways over terrain: whether a walking robot has level ground from start to goal."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from wayproof.harness.errors import InputError
from wayproof.maps.grid import FLOOR_HEIGHT_IN_CELL
from wayproof.models.robots import RobotSpec
from wayproof.models.world_files import FileWorld
from wayproof.models.world_files.ends import Grid
from wayproof.models.world_files.terrain import ground_heights
from wayproof.models.worlds import World

Point = tuple[float, float, float]

REACH = 0.5
"""Distance from a start or goal within which level ground counts as there, m."""

SLOPES = tuple(round(0.05 * n, 2) for n in range(1, 12))
"""Greatest slopes of a way that are tried, rad."""

SPARE = 0.05
"""Excess of the proposed `costmap.max_slope` over a way's slope, rad: the map has whole cells."""

BASELINE = 0.4
"""Distance over which a slope is measured, m: a scan's noise is no slope."""


def check_climb(
    world: World, spec: RobotSpec, points: Sequence[Point], resolution: float
) -> tuple[str, ...]:
    """Refuse a mission on terrain whose every way leaves the level ground of its start.

    To a robot that walks the floor is flat unless `costmap.max_slope` is set: what rises above its
    step height is an obstacle, and what falls a hole.

    Args:
        world: World of the episode; one without height fields is level.
        spec: The robot; one that flies is never refused.
        points: Start and goals in their order, m.
        resolution: Edge of a cell of the map, m.

    Returns:
        Warnings: one if the ways on level ground leave the layer of cells that z = 0 is in, as what
        lies in another is mapped badly without `costmap.max_slope`.

    Raises:
        InputError: There is no level way, or no level ground at one of the points; it names the
            least `costmap.max_slope` that allows a way.
    """
    if not isinstance(world, FileWorld) or not world.terrain or spec.motion != "ground":
        return ()
    grid = Grid(world.low, world.high)
    i, j = np.indices(grid.shape).reshape(2, -1)
    ground = ground_heights(world.terrain, grid.centres(i, j)).reshape(grid.shape)
    radius = min((radius for _, radius in spec.discs), default=spec.radius)
    gaps = grid.distances(world.solids, ground, (spec.step_height, spec.height), radius)
    leads = partial(_leads_through, grid, gaps >= radius, radius=radius, points=points)
    bottom = -FLOOR_HEIGHT_IN_CELL * resolution
    flat = (bottom <= ground) & (ground < bottom + resolution)
    if leads(flat):
        return ()
    climb, slopes = float(np.abs(ground).max()), slope_of(ground, grid.cell)
    limits = [limit for limit in SLOPES if leads(flat | (slopes <= limit))]
    setting = f"--set costmap.max_slope={limits[0] + SPARE:g}" if limits else ""
    if leads(np.abs(ground) <= spec.step_height):
        return (f"the ground rises or falls by up to {climb:.2f} m: {setting} maps its slopes",)
    allowed = setting or f"another world: every way is steeper than {SLOPES[-1]:g} rad"
    raise InputError(
        f"world '{world.name}': no level ground leads '{spec.name}' from its start to its goal; it "
        f"rises or falls by up to {climb:.2f} m, and what walks takes its floor for flat; expected "
        f"a start and goal on one level, a robot that flies, or {allowed}"
    )


def slope_of(ground: NDArray[np.float64], cell: float) -> NDArray[np.float64]:
    """Return the slope of the ground over `BASELINE` about each place, rad.

    Args:
        ground: (nx, ny) heights, m.
        cell: Distance between them, m.
    """
    reach = max(round(0.5 * BASELINE / cell), 1)
    padded = np.pad(ground, reach, "edge")
    inner = slice(reach, -reach)
    along = padded[2 * reach :, inner] - padded[: -2 * reach, inner]
    across = padded[inner, 2 * reach :] - padded[inner, : -2 * reach]
    return np.asarray(np.arctan(np.hypot(along, across) / (2 * reach * cell)))


def _leads_through(
    grid: Grid,
    clear: NDArray[np.bool_],
    even: NDArray[np.bool_],
    *,
    radius: float,
    points: Sequence[Point],
) -> bool:
    """Return whether a disc gets from point to point over clear and even cells, (nx, ny)."""
    from scipy import ndimage  # slow to load

    room = ndimage.distance_transform_edt(even) * grid.cell if not even.all() else np.inf
    labels, _ = ndimage.label(clear & (room >= radius), np.ones((3, 3)))
    regions = [_regions_near(grid, labels, point) for point in points]
    return all(a & b for a, b in pairwise(regions))


def _regions_near(grid: Grid, labels: NDArray[np.int32], point: Point) -> set[int]:
    """Return the regions that come within `REACH` of a point."""
    cell = (np.array(point[:2]) - grid.low) / grid.cell
    reach = REACH / grid.cell
    low = np.clip(np.floor(cell - reach), 0, None).astype(int)
    high = np.ceil(cell + reach).astype(int) + 1
    near = labels[low[0] : max(high[0], 0), low[1] : max(high[1], 0)]
    return set(near[near > 0].tolist())
