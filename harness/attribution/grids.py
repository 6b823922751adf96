"""Paths of a body through a grid: distances and connected regions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wayproof.harness.attribution.case import Case
from wayproof.harness.stack.pipeline import Navigator
from wayproof.models.grids import distances, ways

Array = NDArray[np.float64]
Cells = NDArray[np.bool_]

DETOUR = {2: 1.0824, 3: 1.1283}
"""Greatest ratio of a path along edges and diagonals to the straight line, by axes."""

STEPS = 8
"""Bisections in the search for the widest passage, to 1/256 of the initial interval."""


def clearances(occupied: Cells, size: float) -> Array:
    """Return the distance of each cell to the nearest occupied or outer cell, m."""
    walls = tuple((1, 1) if cells > 1 else (0, 0) for cells in occupied.shape)
    padded = np.pad(occupied, walls, constant_values=True)
    inner = tuple(slice(a, -b if b else None) for a, b in walls)
    return distances(padded)[inner] * size


HEADINGS = 32
"""Number of headings at which a long body is looked at."""


@dataclass(frozen=True)
class Passage:
    """Two cells, and the body that is to get from the surroundings of one to those of the other.

    Attributes:
        start: Cell of the body's origin.
        goal: Cell of the goal.
        reach: Width of the surroundings, cells to each side; any heading will do there.
        size: Side of a cell, m.
        offsets: Offsets of the discs along a body, m; fewer than two of a round one.
        corners: Whether cells that share an edge or a corner alone are connected. No planner goes
            through those, as a line between them touches the cells beside it.
    """

    start: tuple[int, ...]
    goal: tuple[int, ...]
    reach: int
    size: float = 1.0
    offsets: Sequence[float] = ()
    corners: bool = True

    def lets_turn(self, free: Cells) -> bool:
        """Return whether cells connect the ends that are free for a disc about the whole body."""
        ends = self._about(self.start), self._about(self.goal)
        return _connected(free, *ends, corners=self.corners)

    def leads(self, free: Cells) -> bool:
        """Return whether the body, which may turn anywhere, gets through cells (nx, ny, nz).

        They are those that may hold the centre of a disc.
        """
        connected = self.lets_turn(free)
        if not connected or len(self.offsets) < 2:
            return connected
        layers = []
        for turn in 2.0 * np.pi / HEADINGS * np.arange(HEADINGS):
            poses = np.ones(free.shape[:2], np.bool_)
            for offset in self.offsets:
                along = offset / self.size * np.array([np.cos(turn), np.sin(turn)])
                poses &= _shifted(free[:, :, 0], *np.rint(along).astype(int).tolist())
            layers.append(poses)
        ends = [(slice(None), *self._about(cell)[:2]) for cell in (self.start, self.goal)]
        return _connected(np.stack(layers), *ends, corners=True, rounds=True)

    def widest(self, distances: Array) -> float:
        """Return the radius of the widest body, or of its discs, that gets through, m; or 0.

        Args:
            distances: (nx, ny, nz) distance of each cell to the nearest that is not free, m.
        """
        low, high = 0.0, float(distances.max())
        for _ in range(STEPS):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if self.leads(distances > middle) else (low, middle)
        return low

    def _about(self, cell: tuple[int, ...]) -> tuple[slice, ...]:
        return neighbourhood(cell, self.reach)


def passage(case: Case, navigator: Navigator, start: Array, *, corners: bool) -> Passage:
    """Return the passage from a place (3,), m, to the goal, through the cells of a costmap."""
    size = navigator.costmap.resolution
    mission = case.mission
    return Passage(
        start=cell_of(navigator, start),
        goal=cell_of(navigator, np.array(mission.goal)),
        reach=max(1, round(case.config.episode.goal_tolerance / size)),
        size=size,
        offsets=tuple(along for along, _ in mission.discs) if mission.planar else (),
        corners=corners,
    )


def _shifted(free: NDArray[np.bool_], i: int, j: int) -> NDArray[np.bool_]:
    """Return for each cell of (nx, ny) whether the one that lies i and j farther is free."""
    padded = np.pad(free, ((abs(i), abs(i)), (abs(j), abs(j))))
    nx, ny = free.shape
    return padded[abs(i) + i : abs(i) + i + nx, abs(j) + j : abs(j) + j + ny]


def _connected(
    free: Cells,
    begin: tuple[slice, ...],
    end: tuple[slice, ...],
    *,
    corners: bool,
    rounds: bool = False,
) -> bool:
    """Return whether free cells connect a part of a grid with another; the rest as of `ways`."""
    lengths = ways(free, _numbers(free, begin), 1.0, corners=corners, rounds=rounds)[0]
    return bool(np.isfinite(lengths[end]).any())


def distances_from(free: Cells, goal: tuple[int, ...], reach: int, size: float) -> Array:
    """Return the shortest path length from each cell to the surroundings of a cell, m, or inf.

    Paths follow edges and diagonals, so they are up to 8 % longer than the shortest one in a plane
    and 13 % in space: divide by `DETOUR` for a lower bound.
    """
    return ways(free, _numbers(free, neighbourhood(goal, reach)), size)[0]


def _numbers(free: Cells, part: tuple[slice, ...]) -> NDArray[np.int64]:
    """Return the numbers of the free cells in a part of a grid."""
    inside = np.zeros_like(free)
    inside[part] = free[part]
    return np.flatnonzero(inside)


def true_occupancy(
    case: Case, navigator: Navigator, moving: bool = False, steepest: float | None = None
) -> Cells:
    """Return the true occupancy of the cells of a costmap, with the movers as placed.

    Args:
        case: The episode.
        navigator: Stack with the costmap.
        moving: Whether only movers count.
        steepest: Slope up to which ramps of class `floor` are climbed, rad; by default they are
            obstacles, and a field of heights is climbed as far as `CLIMBED`.
    """
    costmap, mission, size = navigator.costmap, case.mission, navigator.map.resolution
    if not mission.planar:
        occupied = case.space.occupied(costmap.origin, costmap.shape, size, moving)
        if moving:
            return occupied
        return occupied | _outside_altitudes(case, costmap.origin, costmap.shape, size)
    nx, ny, _ = costmap.shape
    x, y = np.meshgrid(*(np.arange(n) + 0.5 for n in (nx, ny)), indexing="ij")
    spots = costmap.origin[:2] + size * np.stack([x, y], axis=-1).reshape(-1, 2)
    ground = case.space.terrain(spots, climbed=steepest is not None)
    if ground is not None:
        standing = _standing_on(
            case, costmap.origin, ground.reshape(nx, ny), size, moving=moving, steepest=steepest
        )
        return standing[:, :, None]
    layers = max(1, int(np.ceil((mission.height - mission.step_height) / size - 1e-6)))
    corner = np.array([*costmap.origin[:2], mission.step_height])
    layered = case.space.occupied(corner, (nx, ny, layers), size, moving)
    standing = np.asarray(layered.any(axis=2))
    if moving:
        return standing[:, :, None]
    holes = ~case.space.borne(np.column_stack([spots, np.zeros(len(spots))])).reshape(nx, ny)
    return (standing | holes)[:, :, None]


CLIMBED = 0.35
"""Slope that a body which walks climbs whatever its settings, rad: as far as ends are chosen."""


def _standing_on(
    case: Case, origin: Array, ground: Array, size: float, *, moving: bool, steepest: float | None
) -> Cells:
    """Return the columns (nx, ny) that are closed on terrain: by a thing, a slope, or no ground.

    Args:
        case: The episode.
        origin: Low corner of the columns, m.
        ground: (nx, ny) height of the ground, m; -inf where none is.
        size: Side of a column, m.
        moving: Whether only movers count.
        steepest: As of `true_occupancy`.
    """
    mission, there = case.mission, np.isfinite(ground)
    level = np.where(there, ground, 0.0)
    lowest = float(level.min()) + mission.step_height
    layers = max(1, int(np.ceil((float(level.max()) + mission.height - lowest) / size)))
    corner = np.array([*origin[:2], lowest])
    layered = case.space.occupied(
        corner, (*ground.shape, layers), size, moving, climbed=steepest is not None
    )
    first = np.floor((level + mission.step_height - lowest) / size + 1e-6).astype(int)
    end = np.ceil((level + mission.height - lowest) / size - 1e-6).astype(int)
    k = np.arange(layers)
    within = (k >= first[:, :, None]) & (k < end[:, :, None])
    standing = np.asarray((layered & within).any(axis=2))
    if moving:
        return standing
    if steepest is None:
        steepest = max(case.config.costmap.max_slope, CLIMBED)
    along, across = (np.zeros(ground.shape) if n < 2 else np.gradient(level, size, axis=axis)
                     for axis, n in enumerate(ground.shape))  # fmt: skip
    return np.asarray(standing | ~there | (np.hypot(along, across) > np.tan(steepest)))


def cell_of(navigator: Navigator, point: Array) -> tuple[int, ...]:
    """Return the cell of a costmap at a point (3,), clipped to it; on the ground in its layer."""
    costmap = navigator.costmap
    cell = np.floor((point - costmap.origin) / costmap.resolution).astype(int)
    return tuple(np.clip(cell, 0, np.array(costmap.shape) - 1).tolist())


def _outside_altitudes(
    case: Case, origin: Array, shape: tuple[int, int, int], size: float
) -> Cells:
    edges = origin[2] + np.arange(shape[2]) * size
    motion = case.config.motion
    outside = (edges < motion.altitude_low - 1e-6) | (edges + size > motion.altitude_high + 1e-6)
    return np.broadcast_to(outside, shape)


def neighbourhood(cell: tuple[int, ...], reach: int) -> tuple[slice, ...]:
    """Return the part of a grid within some cells to each side of one."""
    return tuple(slice(max(c - reach, 0), c + reach + 1) for c in cell)
