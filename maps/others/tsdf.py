"""A truncated signed distance field: averaged distances to surfaces instead of log-odds."""

from __future__ import annotations

import struct

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wayproof.maps.cell_sets import CellMask
from wayproof.maps.config import MapConfig
from wayproof.maps.grid import FLOOR_LAYER, cells_at
from wayproof.maps.kernels import beams
from wayproof.maps.kernels import tsdf as kernels
from wayproof.maps.others.block_map import BlockMap, CellBox
from wayproof.maps.states import FREE, OCCUPIED
from wayproof.maps.sweep import Spared, Sweep, check_time
from wayproof.maps.voxel.endpoints import BeamEndpoints

MAX_WINDOW_CELLS = 1 << 29
NO_GUARD = -1


class TsdfMap(BlockMap):
    """Cells over all space, each with the signed distance to the nearest surface and a weight.

    Each sweep gives each cell one distance, at most 4 cells long, that is averaged with the one
    held by weight (Curless & Levoy 1996, "A volumetric method for building complex models from
    range images"). Beams are merged by the cell that they end in and clear all of their way, and
    the weight falls off behind a surface (Oleynikova et al. 2017, "Voxblox"). All is counted in
    whole 1/256 of a cell: see `maps.kernels.tsdf`.

    A cell is occupied where the distance is at most half a cell's diagonal, so that the surface may
    touch it, or negative; free where it is more; unknown where the weight is 0. So what is seen
    from one side only is up to 4 cells thick, and a surface is a cell thicker than VoxelMap's.

    Unless no layer is spared, a beam that ends in the floor's layer does not clear that layer, at
    grazing angles, and the cells above it are free however near the floor is.

    Hits, misses and clamps of the configuration have no meaning here. A standing body's marks weigh
    as one sweep.
    """

    evidence = "weight"
    content = ("distance", "weight")

    def __init__(
        self,
        config: MapConfig,
        low: ArrayLike | None = None,
        high: ArrayLike | None = None,
    ) -> None:
        """Make an unknown map, as `Representation` says."""
        layers = {"distance": np.int16, "weight": np.int8}
        super().__init__(config, low, high, (kernels.EDGE,) * 3, layers)
        self._scores = np.zeros(0, np.uint16)

    def mark(self, cells: CellMask, state: int, time_ns: int) -> None:
        """Average the truncation into cells that are not occupied, or 0 into those not free.

        Raises:
            ValueError: The time is negative.
        """
        check_time(time_ns)
        marked = cells.cells()
        if self._region is not None:
            low, high = self._region
            marked = marked[np.all((marked >= low) & (marked < high), axis=1)]
        if len(marked) == 0:
            self.advance(time_ns)
            return
        corner, blocks = self._open((marked.min(axis=0), marked.max(axis=0) + 1))
        self.advance(time_ns)
        marked = marked[self._states_of(marked) != (OCCUPIED if state == FREE else FREE)]
        block = np.ravel_multi_index(tuple((marked // kernels.EDGE - corner).T), blocks)
        place = np.ravel_multi_index(tuple((marked % kernels.EDGE).T), (kernels.EDGE,) * 3)
        score = kernels.score_of(kernels.TRUNCATION if state == FREE else 0)
        self._scores[(block << kernels.CELLS_BITS) + place] = score
        touched = np.zeros(int(np.prod(blocks)), np.bool_)
        touched[block] = True
        self._update(corner, blocks, touched, time_ns)

    def distance_at(self, points: ArrayLike) -> NDArray[np.float64]:
        """Return the signed distance (n,), m, to the surface at the cells of points (n, 3), m.

        At most 4 cells, negative behind the surface; NaN where unknown.
        """
        cells, inside = cells_at(points, self.resolution)
        distances, weights = self._held_at(cells)
        metres = distances * (self.resolution / kernels.UNITS)
        return np.where(inside & (weights > 0), metres, np.nan)

    def probability_at(self, points: ArrayLike) -> NDArray[np.float64]:
        """Return the confidence of the state at points (n, 3), as probabilities of occupancy (n,).

        A distance field keeps none. It is 1/2 where unknown, 1/2 (1 + w / (w + 1)) where occupied
        and 1/2 (1 - w / (w + 1)) where free, with w the weight in sweeps.
        """
        cells, inside = cells_at(points, self.resolution)
        _, weights = self._held_at(cells)
        sweeps = weights / kernels.FULL_WEIGHT
        sure = 0.5 * sweeps / (sweeps + 1.0)
        sign = np.where(self._states_of(cells) == OCCUPIED, 1.0, -1.0)
        return np.where(inside, 0.5 + sign * sure, 0.5)

    def columns(
        self, low_cell: ArrayLike, shape: tuple[int, int, int]
    ) -> tuple[NDArray[np.uint64], NDArray[np.uint64]]:
        """Return the states of a window of cells, a bit each, as `VoxelMap.columns` does."""
        occupied, free = np.zeros(shape, np.uint64), np.zeros(shape, np.uint64)
        low = np.array(np.ravel(low_cell), np.int64)
        if occupied.size:
            blocks = self._blocks
            live = blocks.live()
            firsts = blocks.keys[live] * kernels.EDGE - low
            size = np.array([shape[0], shape[1], 64 * shape[2]])
            near = np.all((firsts > -kernels.EDGE) & (firsts < size), axis=1)
            kernels.write_columns(live[near], firsts[near], self._layers(), occupied, free)
        return occupied, free

    def memory_bytes(self) -> int:
        """Return the bytes of the blocks in use and of the scores of a sweep.

        The system commits memory only for scores that a sweep ever wrote.
        """
        return super().memory_bytes() + self._scores.nbytes

    def _ends_of(self, sweep: Sweep) -> BeamEndpoints:
        return BeamEndpoints.of_sweep(sweep).merged()

    def _trace(
        self, starts: NDArray[np.int64], ends: BeamEndpoints, time_ns: int, spared: Spared
    ) -> int:
        cells = np.concatenate([starts, ends.points]) >> beams.SUBCELL_BITS
        reach = kernels.TRUNCATION_CELLS
        box = self._clip(cells.min(axis=0) - reach, cells.max(axis=0) + reach + 1)
        corner, shape = self._open(box)
        self.advance(time_ns)
        touched = np.zeros(int(np.prod(shape)), np.bool_)
        low = corner * kernels.EDGE  # cells
        guard = NO_GUARD if spared == "none" else FLOOR_LAYER - int(low[2])
        shift = low << beams.SUBCELL_BITS
        first, last = 2 * (starts - shift) + 1, 2 * (ends.points - shift) + 1
        window = kernels.TraceWindow(shape, np.stack(box) - low, guard)
        kernels.trace_all(first, last, ends.returned, window, self._scores, touched)
        return self._update(corner, shape, touched, time_ns)

    def _units(self) -> bytes:
        return b"tsdf" + struct.pack("<2q", kernels.UNITS, kernels.FULL_WEIGHT)

    def _states_of(self, cells: NDArray[np.int64]) -> NDArray[np.uint8]:
        distances, weights = self._held_at(cells)
        states = np.empty(len(cells), np.uint8)
        kernels.states_of(distances, weights, states)
        return states

    def _held_states(self, slot: int) -> NDArray[np.uint8]:
        layers = self._blocks.layers
        states = np.empty(1 << kernels.CELLS_BITS, np.uint8)
        kernels.states_of(layers["distance"][slot], layers["weight"][slot], states)
        return states

    def _held_at(self, cells: NDArray[np.int64]) -> tuple[NDArray[np.int16], NDArray[np.int8]]:
        """Return distances and weights (n,) of cells (n, 3); 0 where nothing is held."""
        slots, places = self._blocks.locate(cells)
        distances, weights = (self._blocks.layers[n][slots, places] for n in self.content)
        distances[slots < 0] = weights[slots < 0] = 0
        return distances, weights

    def _layers(self) -> kernels.TsdfLayers:
        """Return the cells of all blocks."""
        layers = self._blocks.layers
        return kernels.TsdfLayers(layers["distance"], layers["weight"], layers["fresh"])

    def _forget(self, slots: NDArray[np.int64]) -> None:
        layers = self._blocks.layers
        for slot in slots:
            layers["distance"][slot][layers["weight"][slot] == 0] = 0

    def _clip(self, first: NDArray[np.int64], end: NDArray[np.int64]) -> CellBox:
        """Return the part of a box of cells that lies in the region of interest; may be empty."""
        if self._region is not None:
            first, end = np.maximum(first, self._region[0]), np.minimum(end, self._region[1])
        return first, np.maximum(first, end)

    def _open(self, box: CellBox) -> tuple[NDArray[np.int64], tuple[int, int, int]]:
        """Make room for the scores of a box: its first block, and the number of blocks."""
        first, end = box
        corner = first // kernels.EDGE
        nx, ny, nz = (int(n) for n in -(-end // kernels.EDGE) - corner)
        cells = nx * ny * nz << kernels.CELLS_BITS
        if cells > MAX_WINDOW_CELLS:
            raise ValueError(
                f"beams: got {cells} cells around them, expected at most {MAX_WINDOW_CELLS}: "
                "a shorter range or coarser cells"
            )
        if len(self._scores) < cells:
            self._scores = np.zeros(cells, np.uint16)
        return corner, (nx, ny, nz)

    def _update(
        self,
        corner: NDArray[np.int64],
        shape: tuple[int, int, int],
        touched: NDArray[np.bool_],  # (blocks,)
        time_ns: int,
    ) -> int:
        """Average the scores into the cells; return the number of cells updated."""
        blocks = self._blocks
        self._stamp += 1
        places = np.flatnonzero(touched)
        keys = np.stack(np.unravel_index(places, shape), axis=1) + corner
        slots = blocks.reserve(keys, self._stamp).slots
        changes, updated = np.zeros(len(places), np.uint8), np.zeros(len(places), np.int64)
        layers = self._layers()
        kernels.update_blocks(slots, places, self._scores, layers, changes, updated)
        known = slots >= 0
        held = slots[known]
        blocks.observed_ns[held] = np.maximum(blocks.observed_ns[held], time_ns)
        blocks.dirty[held[changes[known] & kernels.CONTENT_CHANGED > 0]] = True
        blocks.stamps[held[changes[known] & kernels.STATES_CHANGED > 0]] = self._stamp
        return int(updated.sum())
