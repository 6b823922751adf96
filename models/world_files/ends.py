"""Start, goal and area of an imported scene: free for the robot, connected, and far apart."""

from __future__ import annotations

from collections.abc import Sequence
from math import ceil, sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayproof.models.arrays import Vector3
from wayproof.models.grids import ways
from wayproof.models.world_files.ground import EMPTY_EXTENT, FLOOR_KIND, raise_by
from wayproof.models.world_files.movers import around_start, stood_on_ground
from wayproof.models.world_files.options import Ends, Found, ImportOptions
from wayproof.models.world_files.parts import bounds_of
from wayproof.models.world_files.solids import solid_of
from wayproof.models.world_files.terrain import Terrain, ground_heights, terrain_of
from wayproof.models.worlds.solids import Band, HeightField, Solid
from wayproof.models.worlds.solvability import RESOLUTION, label_regions

MAX_CELLS = 300_000
"""Number of cells of `RESOLUTION` from which they are larger."""

BAND = (0.03, 1.6)
"""Height band that is clear above the ground, m: of the built-in quadruped and the drone."""

MAX_WALK_SLOPE = 0.35
"""Steepest ground on the way between chosen ends, rad."""

MAX_TILT = 0.12
"""Steepest ground at a chosen end, rad."""

SPARE = (0.3, 0.2, 0.1, 0.05)
"""Clearances beyond the radius, tried in this order, m: first a margin and two cells of 10 cm."""

SHORT = 2.0
"""Length of a way below which it is called short, m."""

BORDER, WIDE_BORDER = 1.0, 5.0
"""Border of the operating area around the solids, m; the wide one where there is little room."""

AREA_DEPTH = 0.5
"""Depth of the operating area below the floor, m."""

HEADROOM, LEAST_TOP, MOST_TOP = 1.0, 3.0, 12.0
"""Height of the area above the highest thing, and its bounds, m: a map holds the cells up there."""


class NoSpaceError(ValueError):
    """The scene has no place for the robot; the message says where the widest one is."""


class Grid:
    """Cells over the operating area."""

    def __init__(self, low: Vector3, high: Vector3) -> None:
        """Divide the area between two corners into at most about `MAX_CELLS` cells."""
        extent = np.subtract(high[:2], low[:2])
        self.cell = max(RESOLUTION, sqrt(float(np.prod(extent)) / MAX_CELLS))
        self.low = np.array(low[:2])
        self.shape = tuple(max(round(float(n) / self.cell), 1) for n in extent)

    def centres(self, i: NDArray[np.int64], j: NDArray[np.int64]) -> NDArray[np.float64]:
        """Return the centres (n, 2) of cells, m."""
        return np.asarray(self.low + (np.column_stack([i, j]) + 0.5) * self.cell)

    def under(self, solid: Solid, reach: float = 0.0) -> tuple[slice, slice]:
        """Return the cells within a reach, m, of a solid's bounds."""
        end = self.low + np.array(self.shape) * self.cell
        # Clipped first: what is far beyond all numbers of cells divides to no number.
        low = np.clip(np.array(solid.low[:2]) - reach, self.low, end) - self.low
        high = np.clip(np.array(solid.high[:2]) + reach, self.low, end) - self.low
        (i, j), (k, m) = (np.floor(low / self.cell), np.ceil(high / self.cell))
        return slice(int(i), min(int(k), self.shape[0])), slice(int(j), min(int(m), self.shape[1]))

    def distances(
        self, solids: Sequence[Solid], ground: NDArray[np.float64], band: Band, reach: float
    ) -> NDArray[np.float64]:  # (nx, ny)
        """Return distances to obstacles in a band above the ground, up to a reach, m."""
        gaps = np.full(self.shape, reach)
        for solid in solids:
            cells = self.under(solid, reach)
            under, window = ground[cells], gaps[cells]
            if not under.size:
                continue
            low, high = float(under.min()) + band[0], float(under.max()) + band[1]
            if solid.bottom >= high or solid.top <= low:
                continue
            i, j = np.nonzero(window > 0.0)
            centres = self.centres(i + cells[0].start, j + cells[1].start)
            there = solid.distance_in_plane(centres, (low, high))
            window[i, j] = np.minimum(window[i, j], there)
        return gaps


def complete(found: Found, options: ImportOptions | None = None) -> Ends:
    """Return the area, start and goal: the file's own, or chosen and noted where it gives none.

    A scene with terrain is moved so that the ground is at 0 where the robot starts.

    Raises:
        NoSpaceError: There is no room for a start and a goal.
    """
    floors = [solid_of(part) for part in found.parts if part.kind == FLOOR_KIND]
    terrain = terrain_of(floors)
    start, goal = (
        None if end is None or not terrain else _on_ground(terrain, *end[:2])
        for end in (found.start, found.goal)
    )
    start, goal = start or found.start, goal or found.goal
    low, high = area_of(found, BORDER)
    if start is None or goal is None:
        bounded = found.closed or found.low or found.high or not (found.plane and found.parts)
        for border in (BORDER, *(() if bounded else (WIDE_BORDER,))):
            low, high = area_of(found, border)
            survey = _Survey(found, low, high, floors, terrain, options or ImportOptions())
            ends = survey.ends(start, goal)
            if ends is not None and ends.way >= SHORT:
                break
        if ends is None:
            raise NoSpaceError(survey.refusal(given=start is not None or goal is not None))
        if border == WIDE_BORDER:
            found.notes.append(
                f"little room in the scene itself: {border:g} m of floor around it too"
            )
        start, goal = survey.described(ends, start, goal, found.notes)
    if terrain and (rise := -start[2]):
        raise_by(found, rise)
        low, high = (*low[:2], low[2] + rise), (*high[:2], high[2] + rise)
        start, goal = (start[0], start[1], 0.0), (goal[0], goal[1], goal[2] + rise)
        found.notes.append(
            f"ground at {-rise:g} m at the start: the scene is moved by {rise:g} m in z"
        )
        terrain = terrain_of([solid_of(part) for part in found.parts if part.kind == FLOOR_KIND])
    found.movers, above = stood_on_ground(found.movers, terrain)
    if above:
        found.notes.append(f"{above} actors that are not on this floor: left out")
    heading = found.start_heading
    if heading is None:
        heading = float(np.arctan2(goal[1] - start[1], goal[0] - start[0]))
    return Ends(low, high, start, heading, goal)


def area_of(found: Found, border: float) -> tuple[Vector3, Vector3]:
    """Return the operating area where the file gives none: about all that is solid, or its floor.

    Args:
        found: A scene with its floor at 0, or terrain.
        border: Width of the area around the solids, m.
    """
    low, high = np.array([[-EMPTY_EXTENT] * 2 + [0.0], [EMPTY_EXTENT] * 2 + [0.0]])
    bottom = 0.0
    if found.parts:
        low, high = bounds_of(found.parts) if found.extent is None else np.array(found.extent)
    else:
        border = 0.0
    floors = [part for part in found.parts if part.kind == FLOOR_KIND]
    if floors and not found.plane:
        (low[:2], high[:2]), border = bounds_of(floors)[:, :2], 0.0
        bottom = min(0.0, float(bounds_of(floors)[0, 2]))
    for point in (found.start, found.goal):
        if point is not None:
            low[:2], high[:2] = np.minimum(low[:2], point[:2]), np.maximum(high[:2], point[:2])
    top = float(np.clip(float(high[2]) + HEADROOM, LEAST_TOP, MOST_TOP))
    return (
        found.low or (float(low[0]) - border, float(low[1]) - border, bottom - AREA_DEPTH),
        found.high or (float(high[0]) + border, float(high[1]) + border, top),
    )


def _on_ground(terrain: Terrain, x: float, y: float) -> Vector3:
    return x, y, float(ground_heights(terrain, [(x, y)])[0])


Cell = tuple[int, int]


class _Ends(NamedTuple):
    start: Cell
    goal: Cell
    way: float


class _Survey:
    """What stands above the ground of an area, and the ends that it leaves room for."""

    def __init__(
        self, found: Found, low: Vector3, high: Vector3, floors: Sequence[Solid],
        terrain: Terrain, options: ImportOptions,
    ) -> None:  # fmt: skip
        self.options, self.grid, self.terrain = options, Grid(low, high), terrain
        i, j = np.indices(self.grid.shape).reshape(2, -1)
        centres = self.grid.centres(i, j)
        self.heights = ground_heights(terrain, centres).reshape(self.grid.shape)
        reach = options.robot_radius + SPARE[0] + RESOLUTION
        standing = [solid_of(part) for part in found.parts if part.kind != FLOOR_KIND]
        standing += map(around_start, found.movers)
        gaps = self.grid.distances(standing, self.heights, BAND, reach)
        self.gaps = np.minimum(gaps, self._to_edges([] if found.plane else floors))
        self.slope = _slope_of(self.grid, self.heights)

    def ends(self, start: Vector3 | None, goal: Vector3 | None) -> _Ends | None:
        """Return two ends, or the one that is missing, in the largest region with most to spare.

        For a robot that walks, first on ground of one level.
        """
        best: _Ends | None = None
        step = self.options.robot_step
        for level in (True, False) if step and np.ptp(self.heights) else (False,):
            for spare in SPARE:
                free = self.gaps > self.options.robot_radius + spare
                free &= self.slope <= MAX_WALK_SLOPE
                if level and free.any():
                    usual = float(np.median(self.heights[free]))
                    free &= np.abs(self.heights - usual) <= step / 2.0
                ends = self._pair(free, start, goal)
                if ends is not None and (best is None or ends.way > best.way):
                    best = ends
                if best is not None and best.way >= SHORT:
                    return best
        return best

    def refusal(self, *, given: bool) -> str:
        """Return why there are no ends."""
        radius, most = self.options.robot_radius, float(self.gaps.max())
        widest = np.unravel_index(int(np.argmax(self.gaps)), self.gaps.shape)
        x, y = self.grid.centres(*(np.array([n]) for n in widest))[0]
        what = f"the widest place is {most:.2f} m from everything, at ({x:.2f}, {y:.2f})"
        if given:
            what = "nothing else can be reached from the given end"
        elif most > radius + SPARE[-1]:
            what += (
                f", but no two such places are joined by ground less steep than {MAX_WALK_SLOPE:g} "
                "rad; expected --start and --goal"
            )
        return f"no space for a radius of {radius:g} m and {SPARE[-1]:g} m to spare: {what}"

    def described(
        self, ends: _Ends, start: Vector3 | None, goal: Vector3 | None, notes: list[str]
    ) -> tuple[Vector3, Vector3]:
        """Return the ends as points, and note those that were chosen."""
        points: list[Vector3] = []
        for name, given, cell in (("start", start, ends.start), ("goal", goal, ends.goal)):
            if given is not None:
                points.append(given)
                continue
            x, y = self.grid.centres(*(np.array([n]) for n in cell)).round(3)[0].tolist()
            points.append((x, y, round(float(self.heights[cell]), 4)))
            notes.append(f"{name} chosen: ({x:g}, {y:g}), {float(self.gaps[cell]):.2f} m clear")
        short = "" if ends.way >= SHORT else ", which is short: nothing farther is connected"
        notes.append(f"way from start to goal: {ends.way:.1f} m{short}")
        return points[0], points[1]

    def _pair(
        self, free: NDArray[np.bool_], start: Vector3 | None, goal: Vector3 | None
    ) -> _Ends | None:
        labels = label_regions(free)
        places = (labels > 0) & (self.slope <= MAX_TILT)
        if not places.any():
            return None
        given = start or goal
        if given is not None:
            cell = tuple(((np.array(given[:2]) - self.grid.low) / self.grid.cell).astype(int))
            if not all(0 <= n < most for n, most in zip(cell, self.grid.shape, strict=True)):
                return None
            label = int(labels[cell])
        else:
            label = int(np.argmax(np.bincount(labels[places])))
        region = labels == label
        places &= region
        if not label or not places.any():
            return None
        if given is None:
            i, j = np.nonzero(places)
            first = int(np.argmin(i + j))
            cell, _ = self._farthest_from(region, places, (int(i[first]), int(j[first])))
        other, way = self._farthest_from(region, places, cell)
        if other == cell:
            return None
        return _Ends(cell, other, way) if start else _Ends(other, cell, way)

    def _farthest_from(
        self, region: NDArray[np.bool_], places: NDArray[np.bool_], cell: Cell
    ) -> tuple[Cell, float]:
        """Return the place of a region that is farthest from a cell on foot, and how far, m."""
        first = int(np.ravel_multi_index(cell, region.shape))
        lengths, _ = ways(region, [first], RESOLUTION)
        lengths = np.where(places & np.isfinite(lengths), lengths, -1.0)
        i, j = np.unravel_index(int(np.argmax(lengths)), lengths.shape)
        return (int(i), int(j)), float(lengths[i, j]) * self.grid.cell / RESOLUTION

    def _to_edges(self, floors: Sequence[Solid]) -> NDArray[np.float64]:  # (nx, ny)
        """Return distances to where no floor is, and to the border of the area, m."""
        from scipy import ndimage

        borne = np.full(self.grid.shape, not floors)
        for floor in floors:
            cells = self.grid.under(floor)
            if isinstance(floor, HeightField):
                borne[cells] = True
                continue
            i, j = np.nonzero(~borne[cells])
            if len(i):
                at = i + cells[0].start, j + cells[1].start
                band = (floor.bottom - 1.0, floor.top + 1.0)
                borne[at] = floor.distance_in_plane(self.grid.centres(*at), band) <= 0.0
        far = ndimage.distance_transform_edt(np.pad(borne, 1), sampling=self.grid.cell)
        return np.asarray(far[1:-1, 1:-1] - self.grid.cell / 2.0)


def _slope_of(grid: Grid, heights: NDArray[np.float64]) -> NDArray[np.float64]:  # (nx, ny)
    """Return the steepest slope of the floor near each cell, rad."""
    from scipy import ndimage

    if min(heights.shape) < 2 or not np.ptp(heights):
        return np.zeros(heights.shape)
    slopes = np.arctan(np.hypot(*np.gradient(heights, grid.cell)))
    size = max(ceil(0.5 / grid.cell), 1)
    return np.asarray(ndimage.maximum_filter(slopes, size=2 * size + 1))
