"""A flat grid of log-odds: what a robot on a flat floor would use, blind to height."""

from __future__ import annotations

import struct

import numpy as np
from numpy.typing import ArrayLike, NDArray

from maps import _beam_kernels as beams
from maps import _grid2d_kernels as kernels
from maps.block_map import BlockMap
from maps.columns import WORD_BITS, layer_bits
from maps.config import MapConfig
from maps.ends import Ends
from maps.evidence import Evidence
from maps.grid import FLOOR_LAYER, cell_box, cells_at
from maps.states import FREE, OCCUPIED, UNKNOWN
from maps.sweep import SweepStatistics, prepare_sweep

TILE = 64  # cells along a tile's edge
MAX_WINDOW_CELLS = 1 << 26
TOP = 1 << 40  # one past the layers that a cell stands for


class Grid2D(BlockMap):
    """One layer of cells over the floor, each with the log-odds that something stands there.

    Returns between `map.band_low` and `map.band_high` raise their cell; every beam lowers the cells
    that it crosses between these heights, once a sweep, and occupied wins over free. Returns from
    above and below the band raise nothing.

    A cell stands for its whole column: occupied, all of it above the floor is occupied; free, all
    of it is free, and in both cases the floor is taken to be there. So nothing tells an obstacle in
    the band from one that can be passed below, and what is above the band, a hole in the floor, or
    what stands lower than the beams that cross a cell, is not seen.

    Steps, clamps and decay are those of VoxelMap, in the same whole units.

    Attributes:
        units: Steps and clamps in units.
    """

    evidence = "log_odds"
    told = ("log_odds",)

    def __init__(
        self,
        config: MapConfig,
        threads: int = 1,
        low: ArrayLike | None = None,
        high: ArrayLike | None = None,
    ) -> None:
        """Make an unknown map.

        Args:
            config: The settings.
            threads: Number of threads that share the beams of a sweep.
            low: (3,) least corner of the region of interest, m, world; None for all space. What
                lies outside its x and y stays unknown.
            high: (3,) greatest corner, m, world.

        Raises:
            ValueError: Not 1 to 64 threads, only one corner, or a region that is empty, not finite
                or of more cells than a costmap may have.
        """
        super().__init__(config, threads, low, high, (TILE, TILE, 1), {"log_odds": np.int8})
        self.units = Evidence.of(config)
        scale = beams.SUBCELLS / config.resolution
        bottom, top = round(config.band_low * scale), round(config.band_high * scale)
        self._band = 2 * (bottom + beams.FLOOR_SUBCELLS), 2 * (top + beams.FLOOR_SUBCELLS)

    def integrate(
        self,
        origins: ArrayLike,
        directions: NDArray[np.float64],
        ranges_mm: NDArray[np.uint16],
        range_limit: float,
        time_ns: int,
        moments: NDArray[np.int32] | None = None,
    ) -> SweepStatistics:
        """Take in one sweep; the arguments are those of `VoxelMap.integrate`.

        Raises:
            ValueError: As there; the beams may span 2^26 cells of floor. The map is then as before.
        """
        sweep = prepare_sweep(
            origins,
            moments,
            directions,
            ranges_mm,
            range_limit,
            self.config.minimum_range,
            self.resolution,
        )
        ends = Ends.of(sweep)
        starts = sweep.sensors[ends.moments]
        if len(starts) == 0:
            self.advance(time_ns)
            return ends.statistics(0)
        cells = np.concatenate([starts, ends.points])[:, :2] >> beams.SUBCELL_BITS
        corner, extent = self._window(cells.min(axis=0), cells.max(axis=0) + 1)
        self.advance(time_ns)
        marks = np.zeros((self._team.size, *extent), np.uint8)
        shift = np.array([*corner, 0]) << beams.SUBCELL_BITS
        first, last = 2 * (starts - shift) + 1, 2 * (ends.points - shift) + 1
        inside = np.array([(0, 0), extent])

        def trace(member: int, part: tuple[int, int]) -> None:
            kernels.trace_all(first, last, ends.returned, part, self._band, inside, marks[member])

        self._team.share(trace, len(starts))
        merged = np.bitwise_or.reduce(marks, axis=0)
        marked = np.argwhere(merged)
        raised = merged[tuple(marked.T)] & kernels.HIT > 0
        self._update(marked + corner, np.where(raised, self.units.hit, -self.units.miss), time_ns)
        return ends.statistics(len(marked))

    def mark_free(self, low: ArrayLike, high: ArrayLike, time_ns: int) -> None:
        """Lower the cells whose columns stand in a box by one miss, except occupied ones.

        Args:
            low: (3,) least corner, m, world.
            high: (3,) greatest corner, m, world.
            time_ns: Simulated time, ns.

        Raises:
            ValueError: A corner is not finite.
        """
        first, end = cell_box(low, high, self.resolution)
        self.advance(time_ns)
        if end[2] <= max(first[2], FLOOR_LAYER + 1):
            return  # nothing of it is above the floor
        corner, extent = self._window(first[:2], end[:2])
        cells = _cells_of(corner, extent)
        cells = cells[self._log_odds(cells) <= 0]
        self._update(cells, np.full(len(cells), -self.units.miss), time_ns)

    def mark_free_sphere(self, centre: ArrayLike, radius: float, time_ns: int) -> None:
        """Refuse: a body in a ball of free space flies, and the grid knows no heights.

        Raises:
            ValueError: Always.
        """
        raise ValueError(_no_heights("a body that flies"))

    def mark_floor(self, low: ArrayLike, high: ArrayLike, time_ns: int) -> None:
        """Only time passes: the floor is taken to be everywhere.

        Args:
            low: (2,) least corner, m, world.
            high: (2,) greatest corner, m, world.
            time_ns: Simulated time, ns.

        Raises:
            ValueError: A corner is not finite.
        """
        cell_box([*np.ravel(low), 0.0], [*np.ravel(high), 0.0], self.resolution)
        self.advance(time_ns)

    def probability_at(self, points: ArrayLike) -> NDArray[np.float64]:
        """The probability that something stands in the columns of points (n, 3): (n,).

        It is that of the column at any height; 0.5 where unknown.
        """
        cells, inside = cells_at(points, self.resolution)
        return self.units.probability(np.where(inside, self._log_odds(cells[:, :2]), 0))

    def columns(
        self, low_cell: ArrayLike, shape: tuple[int, int, int]
    ) -> tuple[NDArray[np.uint64], NDArray[np.uint64]]:
        """The states of a window of cells, a bit each, as `VoxelMap.columns` tells them.

        Raises:
            ValueError: The window does not hold the floor's layer: heights are asked for.
        """
        nx, ny, words = shape
        x, y, z = (int(cell) for cell in np.ravel(low_cell))
        layers = WORD_BITS * words
        floor = FLOOR_LAYER - z
        if not 0 <= floor < layers:
            raise ValueError(_no_heights("a window without the floor"))
        cells = _cells_of((x, y), (nx, ny))
        values = self._log_odds(cells).reshape(nx, ny, 1)
        above = layer_bits(floor + 1, layers, layers)
        standing = layer_bits(floor, floor + 1, layers)
        return above * (values > 0) | standing * (values != 0), above * (values < 0)

    def changed(self, since: int) -> tuple[NDArray[np.int64], int]:
        """Where states changed since an earlier call; a box for each tile, floor to sky."""
        boxes, now = super().changed(since)
        boxes[:, 2], boxes[:, 5] = FLOOR_LAYER, TOP
        return boxes, now

    def _units(self) -> bytes:
        return b"grid2d" + struct.pack("<3q", self.units.units, *self._band)

    def _held_cells(self, cells: NDArray[np.int64]) -> NDArray[np.int64]:
        flat: NDArray[np.int64] = cells * np.array([1, 1, 0])
        return flat

    def _states_of(self, cells: NDArray[np.int64]) -> NDArray[np.uint8]:
        values, z = self._log_odds(cells[:, :2]), cells[:, 2]
        states = np.where(values > 0, OCCUPIED, np.where(values < 0, FREE, UNKNOWN))
        states[(z == FLOOR_LAYER) & (values != 0)] = OCCUPIED
        states[z < FLOOR_LAYER] = UNKNOWN
        return states.astype(np.uint8)

    def _held_states(self, slot: int) -> NDArray[np.uint8]:
        values = self._blocks.layers["log_odds"][slot]
        return np.where(values > 0, OCCUPIED, np.where(values < 0, FREE, UNKNOWN)).astype(np.uint8)

    def _log_odds(self, cells: NDArray[np.int64]) -> NDArray[np.int8]:
        """Log-odds (n,) of cells (n, 2) of the floor, units; 0 where unknown."""
        slots, places = self._blocks.locate(np.pad(cells, ((0, 0), (0, 1))))
        values: NDArray[np.int8] = self._blocks.layers["log_odds"][slots, places]
        values[slots < 0] = 0
        return values

    def _window(
        self, first: NDArray[np.int64], end: NDArray[np.int64]
    ) -> tuple[NDArray[np.int64], tuple[int, int]]:
        """The part of a rectangle of cells in the region of interest: least cell and extent."""
        if self._region is not None:
            first = np.maximum(first, self._region[0][:2])
            end = np.minimum(end, self._region[1][:2])
        nx, ny = (max(int(n), 0) for n in end - first)
        if nx * ny > MAX_WINDOW_CELLS:
            raise ValueError(
                f"beams: got {nx * ny} cells of floor around them, "
                f"expected at most {MAX_WINDOW_CELLS}: a shorter range or coarser cells"
            )
        return first, (nx, ny)

    def _update(self, cells: NDArray[np.int64], steps: NDArray[np.int64], time_ns: int) -> None:
        """Add a step to each of the cells (n, 2), which all differ."""
        blocks = self._blocks
        self._stamp += 1
        cells = np.pad(cells, ((0, 0), (0, 1)))
        keys = np.unique(cells // blocks.shape, axis=0)
        held = blocks.reserve(keys, self._stamp)
        slots, places = blocks.locate(cells)
        known = slots >= 0  # the others found no room
        slots, places, steps = slots[known], places[known], steps[known]
        values = blocks.layers["log_odds"]
        before = values[slots, places].astype(np.int64)
        after = np.clip(before + steps, self.units.low, self.units.high)
        values[slots, places] = after
        blocks.layers["fresh"][slots, places] = True
        held = held[held >= 0]
        blocks.observed_ns[held] = np.maximum(blocks.observed_ns[held], time_ns)
        blocks.dirty[slots[after != before]] = True
        blocks.stamps[slots[np.sign(after) != np.sign(before)]] = self._stamp


def _cells_of(first: ArrayLike, extent: tuple[int, int]) -> NDArray[np.int64]:
    """All cells (n, 2) of a rectangle."""
    cells: NDArray[np.int64] = np.argwhere(np.ones(extent, np.bool_)) + np.asarray(first)
    return cells


def _no_heights(asked: str) -> str:
    return f"map.kind: got 'grid2d' for {asked}, expected a kind that knows heights, as 'voxel'"
