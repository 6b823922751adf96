"""The costmap of one body: states of its cells, distances to obstacles, and costs."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wayproof.maps.columns import ColumnMap, Columns, Window, unpack
from wayproof.maps.config import CostmapConfig
from wayproof.maps.costmap.blockers import Blocker
from wayproof.maps.costmap.distance_field import ALL_ONES, DistanceField
from wayproof.maps.costmap.inflation import collision_distance_sq, inflation_radius_cells
from wayproof.maps.costmap.projection import Airspace, Projection
from wayproof.maps.costmap.terrain import walked
from wayproof.maps.costmap.widening import NOT_WIDENED, Widened, reached, widened
from wayproof.maps.elementary import exponentials
from wayproof.maps.kernels import columns as kernels
from wayproof.maps.kernels.edt import MAX_REACH
from wayproof.maps.states import FREE, OCCUPIED, UNKNOWN

INSCRIBED_COST = 252.0
"""Cost at the edge of forbidden space; Nav2 reserves 253 and 254 for its inside."""

COST_STEPS = 2.0**20
"""Steps to one unit of cost: costs are whole multiples of one step."""

MOTIONS = ("ground", "air")


class Costmap:
    """Distances and cost for one body over a window of a voxel map.

    On the ground the map is projected to a plane (nz = 1), see `Ground`; in the air it is used as
    it is, between floor and ceiling, and the body is a ball. Space outside the window is blocked.
    The window can move: see `move`.

    An update processes only the cells that changed since the last one. The arrays hold until the
    next update.

    Attributes:
        config: The settings.
        resolution: Edge of a cell, m.
        project: Makes the projection of a window of cells for this body.
        margin: Localization margin of the last update, m.
        widening: Cells by which what is blocked was widened along x and y.
        inflation_radius: Body's radius, margin and half a cell's diagonal, m.
        collision_distance_sq: A cell is forbidden where its squared distance is at most this.
        truncation: Greatest squared distance in use, cells^2; farther cells have it too.
        cost_table: (truncation + 1,) float64, cost by squared distance; inf where forbidden.
    """

    def __init__(
        self,
        config: CostmapConfig,
        voxel_map: ColumnMap,
        low: ArrayLike,
        high: ArrayLike,
        motion: str,
        radius: float,
        height: float,
        step_height: float,
        floor: float = -math.inf,
        ceiling: float = math.inf,
    ) -> None:
        """Make a costmap and update it with the configured margin.

        Args:
            config: The settings.
            voxel_map: The map that it follows.
            low: (3,) least corner of the window, m, world.
            high: (3,) greatest corner, m, world; the cells reach at least this far.
            motion: `ground` or `air`.
            radius: Radius of the body's disc (ground) or ball (air), m.
            height: Height of the body's back above the floor, m; ground only.
            step_height: Greatest height that the body can step on, m above the floor; ground only.
            floor: Lowest altitude that any of the body may be at, m, world; air only.
            ceiling: Highest altitude that any of the body may be at, m, world; air only.

        Raises:
            ValueError: The window is empty, the body does not fit it, or the motion is not known.
        """
        if motion not in MOTIONS:
            raise ValueError(f"motion: got {motion!r}, expected one of {', '.join(MOTIONS)}")
        if not 0.0 < radius < math.inf:
            raise ValueError(f"radius: got {radius:g}, expected more than 0 m")
        self.config = config
        self.motion = motion
        self.radius = radius
        self.resolution = voxel_map.resolution
        self._map = voxel_map

        def project(window: Window) -> Projection:
            if motion == "ground":
                return walked(window, height, step_height, config.max_slope)
            return Airspace(window, floor, ceiling)

        self.project = project
        self._cells = project(Window.covering(low, high, self.resolution))
        self._moved = False
        reach = self._set_margin(config.localization_margin)
        self._cells.read(voxel_map)
        self.widening = NOT_WIDENED
        self._blocked = Widened(self._cells.free, self._cells.occupied)
        self._measure_all(reach)
        self._state: NDArray[np.uint8] | None = None
        self.update(config.localization_margin)

    def stand_at(self, feet: ArrayLike) -> None:
        """Find the ground from the body's feet as well, from the next update on: see `Terrain`.

        Args:
            feet: (3,) on the ground below the body's centre, m, world.

        Raises:
            ValueError: They are not finite.
        """
        self._cells.stand_at(feet)

    @property
    def shape(self) -> tuple[int, int, int]:
        """(nx, ny, nz) cells; nz is 1 on the ground."""
        return self._cells.shape

    @property
    def origin(self) -> NDArray[np.float64]:
        """(3,) corner of the first cell, m, world."""
        return self._cells.origin

    def move(self, low: ArrayLike, high: ArrayLike) -> None:
        """Move to another window of the same map; the next update reads all of it.

        After that all is as of a new costmap of that window.

        Args:
            low: (3,) least corner of the window, m, world.
            high: (3,) greatest corner, m, world.

        Raises:
            ValueError: The window is empty, or the body does not fit it.
        """
        self._cells = self.project(Window.covering(low, high, self.resolution))
        self._moved = True

    def update(self, margin: float, widening: tuple[int, int] = NOT_WIDENED) -> None:
        """Bring states, distances and costs up to date with the map.

        Args:
            margin: Localization margin that is added to the body's radius, m.
            widening: Cells by which what is blocked is widened along x and y for the distances: a
                margin along one axis alone, such as one along which the pose is not held.

        Raises:
            ValueError: The margin is negative or not finite, or needs distances of more than 181
                cells.
        """
        held = self._to_obstacles.reach  # the greatest that was ever needed
        reach = held if margin == self.margin else self._set_margin(margin)
        cells = self._cells
        changed = cells.read(self._map)
        if widening != self.widening:
            self.widening, changed = widening, _whole(cells.rows)
        if changed is not None or self._moved:
            self._blocked = self._widen()
        if held < reach or self._moved:
            self._moved = False
            self._measure_all(max(reach, held))
        elif changed is not None:
            wide = widening != NOT_WIDENED
            self._measure(reached(changed, cells.rows, widening) if wide else changed)
        self._state = None

    @property
    def state(self) -> NDArray[np.uint8]:
        """The three states, (nx, ny, nz) uint8, without widening."""
        if self._state is None:
            self._state = self._states(self._cells, np.zeros(3, np.int64), np.array(self.shape))
        return self._state

    def states_between(self, first: NDArray[np.int64], end: NDArray[np.int64]) -> NDArray[np.uint8]:
        """Return the three states of the cells from `first` (3,) up to, but not with, `end` (3,).

        With the widening, as the distances have it.
        """
        return self._states(self._blocked, first, end)

    def blocker(self, centre: NDArray[np.float64]) -> Blocker:
        """Return the cell of the map for which a cell of the costmap blocks.

        Args:
            centre: (3,) centre of a cell that is not free, by the widened states, m, world.
        """
        cell = np.floor((centre - self.origin) / self.resolution).astype(np.int64)
        occupied = bool(self.states_between(cell, cell + 1)[0, 0, 0] == OCCUPIED)
        wide = np.array([*self.widening, 0])
        first, end = np.maximum(cell - wide, 0), np.minimum(cell + wide + 1, self.shape)
        near = self._states(self._cells, first, end)
        found = first + np.argwhere(near == OCCUPIED if occupied else near == UNKNOWN)
        if not len(found):  # it is widened from beyond the window
            beyond = np.where(
                cell < wide, -1, np.where(cell + wide >= self.shape, self.shape, cell)
            )
            x, y, z = (self.origin + (beyond + 0.5) * self.resolution).tolist()
            return Blocker((x, y, z), "outside")
        x, y, z = found[np.square(found - cell).sum(axis=1).argmin()].tolist()
        return self._cells.blocker(self._map, x, y, z, occupied)

    @property
    def clearance(self) -> NDArray[np.uint16]:
        """Squared distances, (nx, ny, nz) uint16, in cells^2, at most `truncation`.

        To the nearest cell that is not free: occupied, unknown or outside.
        """
        return self._truncated(self._to_not_free.squared)

    @property
    def obstacle_clearance(self) -> NDArray[np.uint16]:
        """Squared distances, cells^2, to the nearest cell that is occupied or outside."""
        return self._truncated(self._to_obstacles.squared)

    def field(self) -> NDArray[np.uint16]:
        """Return the squared distances that decide under the unknown policy, (nx, ny, nz).

        Under `forbid` those to anything not known to be free, otherwise those to obstacles.
        """
        if self.config.unknown_policy == "forbid":
            return self.clearance
        return self.obstacle_clearance

    def _truncated(self, squared: NDArray[np.uint16]) -> NDArray[np.uint16]:
        """Cut distances off at `truncation`, where the fields reach farther."""
        cells = squared.reshape(self.shape)
        if self._to_obstacles.reach * self._to_obstacles.reach <= self.truncation:
            return cells
        return np.minimum(cells, np.uint16(self.truncation))

    def clearance_at(self, points: ArrayLike) -> NDArray[np.float64]:
        """Return the distances of points (n, 3), m, world, to blocked cells: (n,) m.

        Interpolated between cell centres, at most the square root of `truncation` cells; 0 outside.

        Raises:
            ValueError: The points have another shape.
        """
        return self._interpolate(points)[0]

    def gradient_at(self, points: ArrayLike) -> NDArray[np.float64]:
        """Return the gradients of `clearance_at` at points (n, 3), m, world: (n, 3) m/m.

        It is that of the trilinear interpolation itself; 0 along an axis of one cell, and outside.

        Raises:
            ValueError: The points have another shape.
        """
        return self._interpolate(points)[1]

    def _interpolate(self, points: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        places = _points(points)
        distances = np.empty(len(places), np.float64)
        gradients = np.empty((len(places), 3), np.float64)
        kernels.interpolate(
            places,
            self.origin,
            self.resolution,
            self.field(),
            self._distances,
            distances,
            gradients,
        )
        return distances, gradients

    def _measure_all(self, reach: int) -> None:
        """Compute all distances of the window, up to a reach, cells."""
        rows = self._cells.rows
        self._to_not_free = DistanceField(rows, reach)
        self._to_obstacles = DistanceField(rows, reach)
        self._measure(_whole(rows))

    def _measure(self, part: Columns) -> None:
        """Bring the distances up to date with the columns of a part of the window."""
        self._to_not_free.update(self._blocked.free, flip=ALL_ONES, part=part)
        self._to_obstacles.update(self._blocked.occupied, part=part)

    def _states(
        self, cells: Projection | Widened, first: NDArray[np.int64], end: NDArray[np.int64]
    ) -> NDArray[np.uint8]:
        """Return the states of the cells from `first` (3,) up to, but not with, `end` (3,)."""
        (x0, y0, z0), (x1, y1, z1) = first.tolist(), end.tolist()
        flat = self.motion == "ground"  # there a row of bits runs along y
        rows = (slice(x0, x1), slice(0, 1) if flat else slice(y0, y1))
        states = unpack(cells.free[rows], self._cells.rows[2]) * np.uint8(FREE)
        states += unpack(cells.occupied[rows], self._cells.rows[2]) * np.uint8(OCCUPIED)
        return states[:, 0, y0:y1, None] if flat else states[:, :, z0:z1]

    def _widen(self) -> Widened:
        cells = self._cells
        if self.widening == NOT_WIDENED:
            return Widened(cells.free, cells.occupied)
        flat = self.motion == "ground"
        return widened(cells.free, cells.occupied, cells.rows, flat, self.widening)

    def _set_margin(self, margin: float) -> int:
        """Compute the collision distance and the costs; return the reach that they need, cells."""
        if not 0.0 <= margin < math.inf:
            raise ValueError(f"margin: got {margin:g}, expected 0 m or more")
        radius, flat = self.radius + margin, self.motion == "ground"
        forbidden = inflation_radius_cells(radius, self.resolution, flat)
        reach = math.ceil(forbidden + self.config.cost_range / self.resolution)
        if reach > MAX_REACH:
            raise ValueError(
                f"margin: got {margin:g} m, which needs distances up to {reach} cells, "
                f"expected at most {MAX_REACH}"
            )
        self.margin = margin
        self.inflation_radius = forbidden * self.resolution
        self.collision_distance_sq = collision_distance_sq(radius, self.resolution, flat)
        self.truncation = reach * reach
        self.cost_table = self._costs(forbidden)
        self._distances = np.sqrt(np.arange(self.truncation + 1)) * self.resolution  # m
        return reach

    def _costs(self, forbidden: float) -> NDArray[np.float64]:
        """Return Nav2's inflation costs: 252 exp(-scaling (distance - forbidden)); 0 at the end."""
        squared = np.arange(self.truncation + 1)
        beyond = (np.sqrt(squared) - forbidden) * self.resolution  # m
        fall = exponentials(-self.config.cost_scaling_factor * np.maximum(beyond, 0.0))
        costs = INSCRIBED_COST * fall
        costs = np.rint(costs * COST_STEPS) / COST_STEPS
        costs[squared <= self.collision_distance_sq] = math.inf
        costs[-1] = 0.0  # that far or farther
        return costs


def _whole(rows: tuple[int, int, int]) -> Columns:
    return slice(0, rows[0]), slice(0, rows[1])


def _points(points: ArrayLike) -> NDArray[np.float64]:
    """Return a copy (n, 3): to the compiler a read-only array is another type."""
    places = np.array(points, np.float64, order="C", ndmin=2)
    if places.ndim != 2 or places.shape[1] != 3:
        raise ValueError(f"points: got shape {places.shape}, expected (n, 3)")
    return places
