"""A base class for maps whose cells are updated one by one; a map implements 2 to 5 methods."""

from __future__ import annotations

import hashlib
import struct
from collections.abc import Iterator, Mapping
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray

from wayproof.maps.cell_sets import CellMask
from wayproof.maps.columns import WORD_BITS, pack, region_of_interest, unpack
from wayproof.maps.config import MapConfig
from wayproof.maps.grid import cells_at, centres
from wayproof.maps.representation import Representation, refuse_unsupported
from wayproof.maps.slot_pool import EVERYWHERE, MEBIBYTE, Layer, SlotPool
from wayproof.maps.states import FREE, OCCUPIED, STATE_NAMES, UNKNOWN
from wayproof.maps.sweep import Ranges, Spared, SweepStatistics, check_time, prepare_sweep
from wayproof.maps.voxel.bricks import (
    BRICK_SHAPE,
    brick_boxes,
    brick_cells,
    brick_of,
    place_in_brick,
)
from wayproof.maps.voxel.sweep_endpoints import cell_bounds
from wayproof.maps.voxel.update_mask import SweepRasterizer, UpdateMask

Cells = dict[str, NDArray[np.generic]]
"""Numbers of some cells by name: arrays of one shape."""

CELLS_IN_BRICK = int(np.prod(BRICK_SHAPE))
BATCH = 64
"""Bricks that are worked on at once."""


class DenseMap(Representation):
    """A map of cells that hits and misses update one by one: slow but exact.

    A subclass names the numbers that it holds of each cell in `layers`, all 0 where the cell is
    unknown, and defines `update` and `states`; where it has them, also `probabilities` and `decay`.
    Each of these works on arrays of any shape, one entry for each cell. All else follows: rays are
    traced as in `VoxelMap`, and cells are held in bricks within a bound on the memory.

    Attributes:
        layers: Type of each number by its name.
        config: The settings.
        resolution: Edge of a cell, m.
    """

    layers: ClassVar[Mapping[str, DTypeLike]]

    def __init_subclass__(cls) -> None:
        """Note whether the subclass decays."""
        cls.decays = cls.decay is not DenseMap.decay

    def __init__(
        self,
        config: MapConfig,
        low: ArrayLike | None = None,
        high: ArrayLike | None = None,
    ) -> None:
        """Make an unknown map, as `Representation` says."""
        refuse_unsupported(type(self), config)
        self.config = config
        self.resolution = config.resolution
        region = region_of_interest(low, high, config.resolution)
        self._rasterizer = SweepRasterizer(cell_bounds(region))
        kinds = {**self.layers, "_fresh": np.bool_}
        each = CELLS_IN_BRICK * sum(np.dtype(kind).itemsize for kind in kinds.values())
        capacity = max(config.memory_mib * MEBIBYTE // each, 1)
        layers = {name: Layer(kind, (CELLS_IN_BRICK,)) for name, kind in kinds.items()}
        self._pool = SlotPool(capacity, layers)
        self._tick_ns = round(config.decay_period * 1e9)
        self._ticks = 0
        self._stamp = 1

    def update(self, cells: Cells, hits: NDArray[np.bool_], misses: NDArray[np.bool_]) -> None:
        """Update cells in place: those with a hit, and those that only beams crossed.

        No cell has both, and what is written to a cell with neither is lost.
        """
        raise NotImplementedError

    def states(self, cells: Cells) -> NDArray[np.uint8]:
        """Return the states of cells: `UNKNOWN`, `FREE` or `OCCUPIED`."""
        raise NotImplementedError

    def probabilities(self, cells: Cells) -> NDArray[np.float64]:
        """Return the probabilities of occupancy; by default the clamping one of each state."""
        by_state = np.array([0.5, self.config.prob_min, self.config.prob_max])
        return by_state[self.states(cells)]

    def decay(self, cells: Cells, ticks: int) -> None:
        """Move cells in place toward unknown by some decay ticks, by default not at all."""

    def integrate(
        self,
        origins: ArrayLike,
        directions: NDArray[np.float64],
        ranges_mm: Ranges,
        range_limit: float,
        time_ns: int,
        moments: NDArray[np.int32] | None = None,
        spared: Spared = "floor",
    ) -> SweepStatistics:
        """Take in one sweep; arguments and errors are those of `VoxelMap.integrate`."""
        check_time(time_ns)
        sweep = prepare_sweep(
            origins,
            moments,
            directions,
            ranges_mm,
            range_limit,
            self.config.minimum_range,
            self.resolution,
        )
        endpoints = self._rasterizer.endpoints(sweep)
        self.advance(time_ns)
        mask = self._rasterizer.trace(sweep, endpoints, spared)
        updated = self._apply(mask, time_ns)
        hits, clears, dropped, too_near = endpoints.counts
        return SweepStatistics(hits, clears, dropped, too_near, updated)

    def mark(self, cells: CellMask, state: int, time_ns: int) -> None:
        """Update cells by a miss to make them free, or by a hit to make them occupied.

        Those of the contrary state are left as they are.
        """
        self.advance(time_ns)
        contrary = OCCUPIED if state == FREE else FREE
        chosen = cells.cells()
        chosen = chosen[self.state_at(centres(chosen, self.resolution)) != contrary]
        if len(chosen) == 0:
            return
        inside = np.zeros(cells.inside.shape, np.bool_)
        inside[tuple((chosen - cells.first).T)] = True
        mask = self._rasterizer.fill(cells.first, inside, raised=state == OCCUPIED)
        self._apply(mask, time_ns)

    def advance(self, time_ns: int) -> None:
        """Apply every decay tick due; a tick spares cells updated since the one before."""
        check_time(time_ns)
        ticks = time_ns // self._tick_ns - self._ticks
        if self.config.half_life == 0.0 or ticks <= 0:
            return
        self._ticks += ticks
        self._stamp += 1
        for slots in self._batches(self._pool.live()):
            fresh = self._pool.layers["_fresh"][slots]
            before, stale, recent = (self._cells(slots) for _ in range(3))
            self.decay(stale, ticks)
            self.decay(recent, ticks - 1)
            for name in before:
                stale[name][fresh] = recent[name][fresh]
            self._pool.layers["_fresh"][slots] = False
            self._write(slots, before, stale)
            known = (self.states(stale) != UNKNOWN).any(axis=1)
            self._pool.release(slots[~known], self._stamp)

    def columns(
        self, low_cell: ArrayLike, shape: tuple[int, int, int]
    ) -> tuple[NDArray[np.uint64], NDArray[np.uint64]]:
        """Return the occupied and the free cells of a box, as `VoxelMap.columns` does."""
        low = np.array(low_cell, np.int64).ravel()
        states = np.zeros((shape[0], shape[1], WORD_BITS * shape[2]), np.uint8)
        for slots in self._batches(self._pool.live()):
            held = self.states(self._cells(slots)).reshape(-1, *BRICK_SHAPE)
            for first, brick in zip(brick_cells(self._pool.keys[slots]) - low, held, strict=True):
                _copy(brick, first, states)
        return pack(states == OCCUPIED), pack(states == FREE)

    def changed(self, since: int) -> tuple[NDArray[np.int64], int]:
        """Return where states changed since an earlier call, as `VoxelMap.changed` does."""
        keys = self._pool.changed(since)
        return (EVERYWHERE.copy() if keys is None else brick_boxes(keys)), self._stamp

    def state_at(self, points: ArrayLike) -> NDArray[np.uint8]:
        """Return the states at points (n, 3), m, world: (n,)."""
        cells, known = self._at(points)
        return np.where(known, self.states(cells), UNKNOWN).astype(np.uint8)

    def probability_at(self, points: ArrayLike) -> NDArray[np.float64]:
        """Return the probabilities of occupancy at points (n, 3), m, world: (n,)."""
        cells, known = self._at(points)
        return np.where(known, self.probabilities(cells), 0.5)

    def observed_ns_at(self, points: ArrayLike) -> NDArray[np.int64]:
        """Return when the bricks of points (n, 3), m, were last observed: (n,) ns; -1 never."""
        cells, inside = cells_at(points, self.resolution)
        slots = self._pool.find(brick_of(cells))
        return np.where(inside & (slots >= 0), self._pool.observed_ns[slots], -1)

    def version(self) -> str:
        """Return a digest of the content and the tick, 32 hex digits."""

        def contents(slots: NDArray[np.int64]) -> Iterator[bytes]:
            for slot in slots:
                cells = [self._pool.layers[name][slot] for name in self.layers]
                whole = self._pool.keys[slot].tobytes() + b"".join(c.tobytes() for c in cells)
                yield whole if any(c.any() for c in cells) else b""

        total = self._pool.digest(contents)
        ticks = self._ticks if self.config.half_life > 0.0 and total else 0
        head = struct.pack("<dq", self.resolution, ticks) + type(self).__name__.encode()
        return hashlib.blake2b(head + total.to_bytes(16, "little"), digest_size=16).hexdigest()

    def counts(self) -> dict[str, int]:
        """Return the number of free and of occupied cells by the name of their state."""
        counts = np.zeros(len(STATE_NAMES), np.int64)
        for slots in self._batches(self._pool.live()):
            states = self.states(self._cells(slots))
            counts += np.bincount(states.ravel(), minlength=len(counts))
        return {STATE_NAMES[state]: int(counts[state]) for state in (FREE, OCCUPIED)}

    def memory_bytes(self) -> int:
        """Return the bytes of the bricks in use and of the masks of a sweep."""
        return self._pool.nbytes + self._rasterizer.nbytes

    def _batches(self, slots: NDArray[np.int64]) -> Iterator[NDArray[np.int64]]:
        """Split slots (k,) into some that are worked on at once."""
        return (slots[i : i + BATCH] for i in range(0, len(slots), BATCH))

    def _cells(self, slots: NDArray[np.int64]) -> Cells:
        """Return a copy of the cells of bricks, each array (k, cells)."""
        return {name: self._pool.layers[name][slots] for name in self.layers}

    def _at(self, points: ArrayLike) -> tuple[Cells, NDArray[np.bool_]]:
        """Return the cells at points (n, 3), and whether their bricks are held (n,)."""
        cells, inside = cells_at(points, self.resolution)
        slots, places = self._pool.find(brick_of(cells)), place_in_brick(cells)
        held = {name: self._pool.layers[name][slots, places] for name in self.layers}
        return held, inside & (slots >= 0)

    def _apply(self, mask: UpdateMask, time_ns: int) -> int:
        """Update the marked cells; return how many there were."""
        self._stamp += 1
        words, updated = mask.take(), 0
        found = self._pool.reserve(mask.bricks, self._stamp).slots
        for rows in self._batches(np.flatnonzero(found >= 0)):
            slots = found[rows]
            hits, misses = (
                unpack(bits[rows].reshape(len(rows), -1, 1), WORD_BITS).view(np.bool_)
                for bits in words
            )
            hits, misses = hits.reshape(len(rows), -1), misses.reshape(len(rows), -1)
            touched = hits | misses
            before, after = self._cells(slots), self._cells(slots)
            self.update(after, hits, misses & ~hits)
            for name in before:
                after[name][~touched] = before[name][~touched]
            self._pool.layers["_fresh"][slots] |= touched
            self._pool.observed_ns[slots] = np.maximum(self._pool.observed_ns[slots], time_ns)
            self._write(slots, before, after)
            updated += int(np.count_nonzero(touched))
        return updated

    def _write(self, slots: NDArray[np.int64], before: Cells, after: Cells) -> None:
        """Write the cells of bricks, and note which contents and states that changes."""
        differs = np.zeros(len(slots), np.bool_)
        for name, values in after.items():
            differs |= (values != before[name]).any(axis=1)
            self._pool.layers[name][slots] = values
        turned = (self.states(after) != self.states(before)).any(axis=1)
        self._pool.dirty[slots[differs]] = True
        self._pool.stamps[slots[turned]] = self._stamp


def _copy(brick: NDArray[np.uint8], first: NDArray[np.int64], window: NDArray[np.uint8]) -> None:
    """Copy a brick, whose least cell is `first` of a window, into the window where it meets it."""
    low = np.maximum(first, 0)
    high = np.minimum(first + brick.shape, window.shape)
    if (low < high).all():
        to = tuple(slice(int(a), int(b)) for a, b in zip(low, high, strict=True))
        of = tuple(slice(int(a), int(b)) for a, b in zip(low - first, high - first, strict=True))
        window[to] = brick[of]
