"""A flat grid of log-odds, as is usual for robots on a flat floor: blind to height."""

from __future__ import annotations

import struct

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wayproof.maps.cell_sets import CellMask
from wayproof.maps.columns import WORD_BITS, layer_bits
from wayproof.maps.config import MapConfig
from wayproof.maps.grid import FLOOR_LAYER, cells_at
from wayproof.maps.kernels import beams
from wayproof.maps.kernels import grid2d as kernels
from wayproof.maps.others.block_map import BlockMap
from wayproof.maps.states import FREE, OCCUPIED, UNKNOWN
from wayproof.maps.sweep import Spared
from wayproof.maps.voxel.endpoints import BeamEndpoints
from wayproof.maps.voxel.log_odds import LogOddsModel, states_of

TILE = 64  # cells along a tile's edge
MAX_WINDOW_CELLS = 1 << 26
TOP = 1 << 40  # one past the layers that a cell stands for


class Grid2D(BlockMap):
    """One layer of cells over the floor, each with the log-odds that something stands there.

    Returns between `map.min_obstacle_height` and `map.max_obstacle_height` raise their cell;
    every beam lowers the cells that it crosses between these heights, once a sweep, and occupied
    wins over free. Returns from above and below the band raise nothing.

    A cell stands for its whole column: occupied, all of it above the floor is occupied; free, all
    of it is free, and in both cases the floor is taken to be there. So an
    obstacle in the band cannot be passed below, and things above the band, holes in the floor, and
    things lower than the beams that cross a cell are not seen.

    Steps, clamps and decay are those of VoxelMap, in the same whole units.

    Attributes:
        units: Steps and clamps in units.
    """

    evidence = "log_odds"
    content = ("log_odds",)

    def __init__(
        self,
        config: MapConfig,
        low: ArrayLike | None = None,
        high: ArrayLike | None = None,
    ) -> None:
        """Make an unknown map, as `Representation` says; of a region of interest x and y count."""
        super().__init__(config, low, high, (TILE, TILE, 1), {"log_odds": np.int8})
        self.units = LogOddsModel.from_config(config)
        scale = beams.SUBCELLS / config.resolution
        bottom, top = (
            round(config.min_obstacle_height * scale),
            round(config.max_obstacle_height * scale),
        )
        self._band = 2 * (bottom + beams.FLOOR_SUBCELLS), 2 * (top + beams.FLOOR_SUBCELLS)

    def mark_free_sphere(self, centre: ArrayLike, radius: float, time_ns: int) -> None:
        """Refuse: a body in a ball of free space flies, and the grid has no heights.

        Raises:
            ValueError: Always.
        """
        raise ValueError(_no_heights("a body that flies"))

    def mark(self, cells: CellMask, state: int, time_ns: int) -> None:
        """Lower the columns that hold any of the cells by one miss, except occupied ones.

        Cells of the floor and below have no effect: the floor is taken to be everywhere.
        """
        self.advance(time_ns)
        low = cells.first[:2]
        above = max(FLOOR_LAYER + 1 - int(cells.first[2]), 0)
        columns = np.asarray(cells.inside[:, :, above:].any(axis=2))
        if state != FREE or not columns.any():
            return
        tile, marks, inside = self._open(low, low + columns.shape)
        (x0, y0), (x1, y1) = inside
        (i0, j0), (i1, j1) = inside + tile * TILE - low
        marks[x0:x1, y0:y1] = kernels.CROSSED * columns[i0:i1, j0:j1]
        self._update(tile, marks, True, time_ns)

    def probability_at(self, points: ArrayLike) -> NDArray[np.float64]:
        """Return the probability that something stands in the columns of points (n, 3): (n,).

        It is that of the column at any height; 0.5 where unknown.
        """
        cells, inside = cells_at(points, self.resolution)
        return self.units.probability(np.where(inside, self._log_odds(cells[:, :2]), 0))

    def columns(
        self, low_cell: ArrayLike, shape: tuple[int, int, int]
    ) -> tuple[NDArray[np.uint64], NDArray[np.uint64]]:
        """Return the states of a window of cells, a bit each, as `VoxelMap.columns` returns them.

        Raises:
            ValueError: The window does not hold the floor's layer.
        """
        nx, ny, words = shape
        x, y, z = (int(cell) for cell in np.ravel(low_cell))
        layers = WORD_BITS * words
        floor = FLOOR_LAYER - z
        if not 0 <= floor < layers:
            raise ValueError(_no_heights("a window without the floor"))
        values = self._log_odds_in(x, y, nx, ny)[:, :, None]
        above = layer_bits(floor + 1, layers, layers)
        standing = layer_bits(floor, floor + 1, layers)
        return above * (values > 0) | standing * (values != 0), above * (values < 0)

    def changed(self, since: int) -> tuple[NDArray[np.int64], int]:
        """Return where states changed since an earlier call; a box for each tile, floor to sky."""
        boxes, now = super().changed(since)
        boxes[:, 2], boxes[:, 5] = FLOOR_LAYER, TOP
        return boxes, now

    def _trace(
        self, starts: NDArray[np.int64], ends: BeamEndpoints, time_ns: int, spared: Spared
    ) -> int:
        del spared  # it has no floor
        cells = np.concatenate([starts, ends.points])[:, :2] >> beams.SUBCELL_BITS
        tile, marks, inside = self._open(cells.min(axis=0), cells.max(axis=0) + 1)
        self.advance(time_ns)
        shift = np.array([*(tile * TILE), 0]) << beams.SUBCELL_BITS
        first, last = 2 * (starts - shift) + 1, 2 * (ends.points - shift) + 1
        kernels.trace_all(first, last, ends.returned, self._band, inside, marks)
        self._update(tile, marks, False, time_ns)
        return int(np.count_nonzero(marks))

    def _units(self) -> bytes:
        return b"grid2d" + struct.pack("<3q", self.units.units, *self._band)

    def _held_cells(self, cells: NDArray[np.int64]) -> NDArray[np.int64]:
        flat: NDArray[np.int64] = cells * np.array([1, 1, 0])
        return flat

    def _states_of(self, cells: NDArray[np.int64]) -> NDArray[np.uint8]:
        values, z = self._log_odds(cells[:, :2]), cells[:, 2]
        states = states_of(values)
        states[(z == FLOOR_LAYER) & (values != 0)] = OCCUPIED
        states[z < FLOOR_LAYER] = UNKNOWN
        return states

    def _held_states(self, slot: int) -> NDArray[np.uint8]:
        values = self._blocks.layers["log_odds"][slot]
        return states_of(values)

    def _log_odds(self, cells: NDArray[np.int64]) -> NDArray[np.int8]:
        """Return log-odds (n,) of cells (n, 2) of the floor, units; 0 where unknown."""
        slots, places = self._blocks.locate(np.pad(cells, ((0, 0), (0, 1))))
        values: NDArray[np.int8] = self._blocks.layers["log_odds"][slots, places]
        values[slots < 0] = 0
        return values

    def _log_odds_in(self, x: int, y: int, nx: int, ny: int) -> NDArray[np.int8]:
        """Return log-odds (nx, ny) of the cells of a rectangle of floor from (x, y) on, units."""
        values = np.zeros((nx, ny), np.int8)
        for slot in self._blocks.live():
            low_x, low_y = (int(k) * TILE for k in self._blocks.keys[slot, :2])
            x0, x1 = max(low_x, x), min(low_x + TILE, x + nx)
            y0, y1 = max(low_y, y), min(low_y + TILE, y + ny)
            if x0 < x1 and y0 < y1:
                tile = self._blocks.layers["log_odds"][slot].reshape(TILE, TILE)
                held = tile[x0 - low_x : x1 - low_x, y0 - low_y : y1 - low_y]
                values[x0 - x : x1 - x, y0 - y : y1 - y] = held
        return values

    def _open(
        self, first: NDArray[np.int64], end: NDArray[np.int64]
    ) -> tuple[NDArray[np.int64], NDArray[np.uint8], NDArray[np.int64]]:
        """Return a window of whole tiles around a rectangle of cells.

        Returns:
            Its first tile (2,), empty marks (nx, ny), and the part of the rectangle that
            lies in the region of interest, (2, 2) counted from the window's corner.
        """
        if self._region is not None:
            first = np.maximum(first, self._region[0][:2])
            end = np.minimum(end, self._region[1][:2])
        end = np.maximum(first, end)
        tile = first // TILE
        nx, ny = (int(n) * TILE for n in -(-end // TILE) - tile)
        if nx * ny > MAX_WINDOW_CELLS:
            raise ValueError(
                f"beams: got {nx * ny} cells of floor around them, "
                f"expected at most {MAX_WINDOW_CELLS}: a shorter range or coarser cells"
            )
        marks = np.zeros((nx, ny), np.uint8)
        return tile, marks, np.stack([first, end]) - tile * TILE

    def _update(
        self, tile: NDArray[np.int64], marks: NDArray[np.uint8], spare: bool, time_ns: int
    ) -> None:
        """Raise the cells that were hit, and lower those that were crossed, once each.

        Args:
            tile: (2,) first tile of the window.
            marks: (nx, ny) of its cells.
            spare: Whether occupied cells stay as they are.
            time_ns: Simulated time, ns.
        """
        blocks = self._blocks
        self._stamp += 1
        across, along = (n // TILE for n in marks.shape)
        tiles = marks.reshape(across, TILE, along, TILE).swapaxes(1, 2).reshape(-1, TILE * TILE)
        touched = np.flatnonzero(tiles.any(axis=1))
        x, y = np.divmod(touched, max(along, 1))
        keys = np.stack([x + tile[0], y + tile[1], np.zeros_like(x)], axis=1)
        slots = blocks.reserve(keys, self._stamp).slots
        touched, slots = touched[slots >= 0], slots[slots >= 0]  # the others found no room
        updates = tiles[touched]
        before = blocks.layers["log_odds"][slots].astype(np.int64)
        if spare:
            updates[before > 0] = 0
        steps = np.where(updates & kernels.HIT > 0, self.units.hit, -self.units.miss)
        after = np.clip(before + steps, self.units.low, self.units.high)
        after = np.where(updates > 0, after, before)
        blocks.layers["log_odds"][slots] = after
        blocks.layers["fresh"][slots] |= updates > 0
        blocks.observed_ns[slots] = np.maximum(blocks.observed_ns[slots], time_ns)
        blocks.dirty[slots[(after != before).any(axis=1)]] = True
        blocks.stamps[slots[(np.sign(after) != np.sign(before)).any(axis=1)]] = self._stamp


def _no_heights(use: str) -> str:
    return f"map.kind: got 'grid2d' for {use}, expected a kind with heights, such as 'voxel'"
