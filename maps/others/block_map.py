"""Base of the maps stored in blocks: decay, queries, changes and the version."""

from __future__ import annotations

import hashlib
import struct
from collections.abc import Iterator, Mapping

import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray

from wayproof.maps.columns import Window, region_of_interest
from wayproof.maps.config import MapConfig
from wayproof.maps.grid import cells_at
from wayproof.maps.kernels import decay, update
from wayproof.maps.kernels.blocks import FadedBlocks, fade_blocks
from wayproof.maps.representation import Representation, refuse_unsupported
from wayproof.maps.slot_pool import EVERYWHERE, MEBIBYTE, Layer, SlotPool
from wayproof.maps.states import FREE, OCCUPIED, STATE_NAMES
from wayproof.maps.sweep import Ranges, Spared, Sweep, SweepStatistics, check_time, prepare_sweep
from wayproof.maps.voxel.endpoints import BeamEndpoints
from wayproof.maps.voxel.log_odds import MAX_UNITS, decay_per_tick

CellBox = tuple[NDArray[np.int64], NDArray[np.int64]]
"""Least cell (3,) of a box, and one past the greatest."""


class BlockMap(Representation):
    """A map that stores its cells in `Blocks`.

    One layer holds the evidence of each cell, which decays; where it is 0 the cell is
    unknown. Decay follows the schedule and the law of VoxelMap, tick by tick for all blocks.

    Attributes:
        config: The settings.
        resolution: Edge of a cell, m.
    """

    evidence: str  # the layer that decay takes of
    content: tuple[str, ...]  # layers that the version covers

    def __init__(
        self,
        config: MapConfig,
        low: ArrayLike | None,
        high: ArrayLike | None,
        shape: tuple[int, int, int],
        layers: Mapping[str, DTypeLike],
    ) -> None:
        """Make an unknown map of blocks of a shape, with these layers besides `fresh`."""
        refuse_unsupported(type(self), config)
        self.config = config
        self.resolution = config.resolution
        self._region = _box_of(region_of_interest(low, high, config.resolution))
        self._blocks = Blocks(config.memory_mib, shape, {**layers, "fresh": np.bool_})
        self._losses = decay_per_tick(config)
        self._tick_ns = round(config.decay_period * 1e9)
        self._ticks = 0
        self._stamp = 1

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
        """Take in one sweep; the arguments are those of `VoxelMap.integrate`.

        Raises:
            ValueError: As there, or the beams span too many cells. The map is then as before.
        """
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
        ends = self._ends_of(sweep)
        if len(ends.points) == 0:
            self.advance(time_ns)
            return ends.statistics(0)
        return ends.statistics(self._trace(sweep.sensors[ends.moments], ends, time_ns, spared))

    def advance(self, time_ns: int) -> None:
        """Apply every decay tick due up to and at `time_ns`, as `VoxelMap.advance` does."""
        check_time(time_ns)
        if self.config.half_life == 0.0 or time_ns // self._tick_ns <= self._ticks:
            return
        until = time_ns // self._tick_ns
        rest, spared = (np.arange(MAX_UNITS + 1).astype(np.int8) for _ in range(2))
        for values, seen in ((rest, self._ticks), (spared, self._ticks + 1)):
            decay.fade_values(values, np.full(MAX_UNITS + 1, seen), until, self._losses)
        self._ticks = until
        self._fade(rest, spared)

    def state_at(self, points: ArrayLike) -> NDArray[np.uint8]:
        """Return the state at points (n, 3), m, world: (n,)."""
        cells, inside = cells_at(points, self.resolution)
        return np.where(inside, self._states_of(cells), 0).astype(np.uint8)

    def observed_ns_at(self, points: ArrayLike) -> NDArray[np.int64]:
        """Return when the blocks of points (n, 3), m, were last observed: (n,) ns; -1 never."""
        cells, inside = cells_at(points, self.resolution)
        slots, _ = self._blocks.locate(self._held_cells(cells))
        return np.where(inside & (slots >= 0), self._blocks.observed_ns[slots], -1)

    def changed(self, since: int) -> tuple[NDArray[np.int64], int]:
        """Return where states changed since a stamp, as `VoxelMap.changed` does."""
        return self._blocks.changed_boxes(since), self._stamp

    def counts(self) -> dict[str, int]:
        """Return the number of free and of occupied cells by the name of their state."""
        states = [self._held_states(slot) for slot in self._blocks.live()]
        return {
            STATE_NAMES[state]: sum(int(np.count_nonzero(s == state)) for s in states)
            for state in (FREE, OCCUPIED)
        }

    def version(self) -> str:
        """Return the digest of content and tick, 32 hex digits: equal content, equal version."""
        total = self._blocks.digest_layers(self.content)
        ticks = self._ticks if self.config.half_life > 0.0 and total else 0
        head = struct.pack("<dq", self.resolution, ticks) + self._units()
        return hashlib.blake2b(head + total.to_bytes(16, "little"), digest_size=16).hexdigest()

    def memory_bytes(self) -> int:
        """Return the bytes of the blocks in use."""
        return self._blocks.nbytes

    def _ends_of(self, sweep: Sweep) -> BeamEndpoints:
        """Return the endpoints of a sweep's beams."""
        return BeamEndpoints.of_sweep(sweep)

    def _trace(
        self, starts: NDArray[np.int64], ends: BeamEndpoints, time_ns: int, spared: Spared
    ) -> int:
        """Update the cells along rays from sub-cells (k, 3); return how many were updated."""
        raise NotImplementedError

    def _units(self) -> bytes:
        """Return the units of the content, as bytes for the version."""
        raise NotImplementedError

    def _held_cells(self, cells: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return the cells (n, 3) in which evidence of cells (n, 3) of space is held."""
        return cells

    def _states_of(self, cells: NDArray[np.int64]) -> NDArray[np.uint8]:
        """Return states (n,) of cells (n, 3) of space."""
        raise NotImplementedError

    def _held_states(self, slot: int) -> NDArray[np.uint8]:
        """Return states (cells,) of all cells of a block."""
        raise NotImplementedError

    def _forget(self, slots: NDArray[np.int64]) -> None:
        """Clear the other layers of cells of blocks (k,) that became unknown."""

    def _fade(self, rest: NDArray[np.int8], spared: NDArray[np.int8]) -> None:
        """Replace the evidence of all blocks, and release those that are all unknown."""
        blocks, live = self._blocks, self._blocks.live()
        evidence, fresh = blocks.layers[self.evidence], blocks.layers["fresh"]
        changed, forgotten, alive = (np.zeros(len(live), np.bool_) for _ in range(3))
        faded = FadedBlocks(changed, forgotten, alive)
        fade_blocks(live, rest, spared, evidence, fresh, faded)
        self._stamp += 1
        blocks.dirty[live[changed]] = True
        blocks.stamps[live[forgotten]] = self._stamp
        self._forget(live[forgotten])
        blocks.release(live[~alive], self._stamp)


def _box_of(region: Window | None) -> CellBox | None:
    """Return the least cell (3,) of a region of interest and one past the greatest, if any."""
    if region is None:
        return None
    first = np.array(region.first, np.int64)
    return first, first + np.array(region.shape, np.int64)


HEAD_BYTES = 128
"""Bytes of a block besides its cells, as the capacity counts them."""


class Blocks(SlotPool):
    """A pool of blocks of one shape; each cell has one value in every layer, 0 where unknown.

    Attributes:
        shape: Cells of a block along x, y and z.
    """

    def __init__(
        self, memory_mib: int, shape: tuple[int, int, int], layers: Mapping[str, DTypeLike]
    ) -> None:
        """Reserve a pool that takes at most `memory_mib`."""
        self.shape = shape
        cells = int(np.prod(shape))
        each = cells * sum(np.dtype(kind).itemsize for kind in layers.values())
        super().__init__(
            max(memory_mib * MEBIBYTE // (each + HEAD_BYTES), 1),
            {name: Layer(kind, (cells,)) for name, kind in layers.items()},
        )

    def locate(self, cells: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Return slots (n,) of the blocks of cells (n, 3), -1 for none, and places in them."""
        x, y, z = (cells % self.shape).T
        _, ny, nz = self.shape
        return self.find(cells // self.shape), (x * ny + y) * nz + z

    def changed_boxes(self, since: int) -> NDArray[np.int64]:
        """Return boxes of cells (k, 6) of the blocks whose states changed after a stamp."""
        keys = self.changed(since)
        if keys is None:
            return EVERYWHERE.copy()
        return np.hstack([keys * self.shape, (keys + 1) * self.shape])

    def digest_layers(self, names: tuple[str, ...]) -> int:
        """Return the digest of some layers of all blocks."""

        def contents(slots: NDArray[np.int64]) -> Iterator[bytes]:
            lanes = np.empty((len(names), len(slots), 8), np.uint64)
            known = np.empty((len(names), len(slots)), np.bool_)
            words = [self.layers[n].view(np.uint64).reshape(len(self.keys), -1, 8) for n in names]
            for layer, sums, any_known in zip(words, lanes, known, strict=True):
                update.digest_bricks(slots, layer, sums, any_known)
            for i, key in enumerate(self.keys[slots].tolist()):
                content = struct.pack("<3q", *key) + lanes[:, i].astype("<u8").tobytes()
                yield content if known[:, i].any() else b""

        return self.digest(contents)
