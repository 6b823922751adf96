"""Ground that a walking robot needs: level on its way, and seen by its sensors from the start."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import partial
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from wayproof.harness.config import Config
from wayproof.harness.errors import InputError
from wayproof.maps.grid import FLOOR_HEIGHT_IN_CELL
from wayproof.models.robots import RobotSpec
from wayproof.models.sensors.beams import directions
from wayproof.models.sensors.caster import Caster
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


STEP = 0.05
"""The proposed radius is a multiple of it, m."""


def warn_of_blind_start(
    casters: Sequence[Caster], spec: RobotSpec, config: Config
) -> tuple[str, ...]:
    """Warn of a robot that may find no way out of the floor that it cannot see from its start.

    The start is declared free up to `episode.start_clear_radius` beyond the body, which it may
    leave by as much in order to see more. Under `forbid` it enters nothing else unseen.

    Args:
        casters: Sensors of the robot.
        spec: The robot; one that flies is never warned of.
        config: Config with the resolved start.

    Returns:
        A warning with the radius that declares it free, or none.
    """
    if spec.motion == "air" or config.costmap.unknown_policy != "forbid":
        return ()
    nearest = min((nearest_floor(caster, spec.rest_height) for caster in casters), default=math.inf)
    declared = config.episode.start_clear_radius
    if not math.isfinite(nearest) or nearest <= spec.radius + 2.0 * declared:
        return ()
    enough = STEP * math.ceil((nearest - spec.radius) / STEP - 1e-9)
    return (
        f"the sensors see no floor nearer than {nearest:.2f} m, and what is declared free at the "
        f"start ends at {spec.radius + declared:.2f} m: the robot may find no way out; "
        f"--set episode.start_clear_radius={enough:g} declares it free",
    )


def nearest_floor(caster: Caster, rest_height: float) -> float:
    """Return the least distance from the base at which a beam of a level robot meets its floor, m.

    Args:
        caster: A sensor.
        rest_height: Height of the base above the floor, m.

    Returns:
        Infinity if no beam meets the floor within the sensor's range.
    """
    if caster.table.listed:
        return math.inf
    position, R = caster.mounting
    beams = directions(caster.table, 0) @ R.T
    down = beams[beams[:, 2] < 0.0]
    reach = (rest_height + position[2]) / -down[:, 2]
    met = (reach > 0.0) & (reach <= caster.mount.device.range)
    spots = position[:2] + reach[met, None] * down[met, :2]
    return float(np.hypot(spots[:, 0], spots[:, 1]).min(initial=math.inf))
