"""A bounded voxel map of log-odds: exact in integers, three states, decay and a version."""

from __future__ import annotations

import hashlib
import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from maps import _voxel_kernels as kernels
from maps.config import MapConfig
from maps.grid import Grid, finite_vector
from maps.states import STATE_NAMES, UNKNOWN
from maps.sweep import SweepStatistics, check_beams

UNITS = 1000
"""Fixed point: log-odds are held in thousandths."""

WHOLE = 1 << 16
"""Fixed point of the decay factor: what remains of a cell after one tick, in 1/65536."""


class VoxelMap:
    """A bounded grid of cells, each with the log-odds that it is occupied.

    A cell's update is l += logit P(m|z) - l0 with l0 = 0, clamped (Hornung et al. 2013, "OctoMap",
    eq. 2 and 4), in thousandths as integers: the same sweeps give the same map on every machine.
    The sign of l is the state. Cells lie in blocks of 16 x 16 x 16, which carry the time of their
    last observation and a digest.

    Attributes:
        config: The settings.
        grid: Where the cells lie.
        resolution: Edge of a cell, m.
        origin: (3,) corner of the first cell, m, world.
        shape: (nx, ny, nz) cells.
        log_odds: (nx, ny, nz) int16, thousandths, z contiguous. Others only read it.
    """

    def __init__(self, config: MapConfig, low: ArrayLike, high: ArrayLike) -> None:
        """Make an unknown map.

        Args:
            config: The settings.
            low: (3,) least corner, m, world. In x and y cells start here; in z less than a cell
                below, such that z = 0 lies at 0.75 of its layer's height.
            high: (3,) greatest corner, m, world; the cells reach at least this far.

        Raises:
            ValueError: The bounds are not finite or empty, or hold too many cells.
        """
        self.config = config
        self.grid = Grid.covering(low, high, config.resolution)
        self.resolution = config.resolution
        self.origin = self.grid.origin
        self.shape = self.grid.shape
        self.log_odds = np.zeros(self.shape, np.int16)
        self._marks = np.zeros(self.shape, np.uint8)
        blocks = tuple(-(-cells // kernels.BLOCK) for cells in self.shape)
        self._observed_ns = np.full(blocks, -1, np.int64)
        self._dirty = np.zeros(blocks, np.bool_)
        self._alive = np.zeros(blocks, np.bool_)  # holds a cell that is not unknown
        self._digests = np.zeros((*blocks, 16), np.uint8)  # zeros: nothing but unknown
        self._steps = _steps(config)
        self._remains = _remains(config)
        self._tick_ns = round(config.decay_period * 1e9)
        self._ticks = 0

    def integrate(
        self,
        origins: ArrayLike,
        directions: NDArray[np.float64],
        ranges_mm: NDArray[np.uint16],
        range_limit: float,
        time_ns: int,
        moments: NDArray[np.int32] | None = None,
    ) -> SweepStatistics:
        """Take in one sweep: each cell is updated once, and occupied wins over free.

        Cells before a return decrease and its own cell increases; a beam without return (65535, or
        beyond `range_limit`) decreases every cell up to the limit; a dropped one (0) tells nothing.
        A beam that ends in the floor's layer does not decrease that layer: at grazing angles it
        would take away the floor that it is about to hit. Decay ticks due are applied first.

        Args:
            origins: (3,) or (m, 3) where the beams start, m, world; may lie outside the map.
            directions: (n, 3) unit vectors, world.
            ranges_mm: (n,) measured ranges, mm.
            range_limit: Range up to which a beam without return is evidence of free space, m.
            time_ns: Simulated time of the sweep, ns.
            moments: (n,) which origin each beam leaves from; the first if left out.

        Raises:
            ValueError: A position or direction is not finite, an array has another shape, or the
                range limit is not within 0 to 2047 cells.
        """
        starts = np.stack([finite_vector("origin", o) for o in np.reshape(origins, (-1, 3))])
        starts -= self.origin
        if moments is None:
            moments = np.zeros(len(ranges_mm), np.int32)
        # Copies: to the compiler a read-only array, as a log yields, is another type.
        directions = np.array(directions, np.float64, order="C")
        ranges_mm = np.array(ranges_mm, order="C")
        check_beams(directions, ranges_mm, range_limit, self.resolution)
        self.advance(time_ns)
        ends = np.empty((len(ranges_mm), 3), np.int64)
        fates = np.empty(len(ranges_mm), np.uint8)
        nearest_mm = round(self.config.minimum_range * 1000)
        farthest_mm = round(range_limit * 1000)
        sensor = np.floor(starts * (kernels.SUBCELLS / self.resolution)).astype(np.int64)
        kernels.place_beams(
            starts,
            moments,
            directions,
            ranges_mm,
            nearest_mm,
            farthest_mm,
            self.resolution,
            self._marks,
            ends,
            fates,
        )
        kernels.cross_beams(self._marks, sensor, moments, ends, fates, self.grid.floor_layer)
        told = np.vstack([sensor, ends[fates <= kernels.CLEARED]]) >> kernels.SUBCELL_BITS
        updated = self._apply(told.min(axis=0), told.max(axis=0) + 1, time_ns)
        count = np.bincount(fates, minlength=4)
        return SweepStatistics(int(count[0]), int(count[1]), int(count[2]), int(count[3]), updated)

    def mark_free(self, low: ArrayLike, high: ArrayLike, time_ns: int) -> None:
        """Lower the cells whose centres lie in a box by one miss, except occupied ones.

        For space that a body occupies itself, or a start area that is declared clear: an obstacle
        that was seen stays.

        Args:
            low: (3,) least corner, m, world.
            high: (3,) greatest corner, m, world.
            time_ns: Simulated time, ns.

        Raises:
            ValueError: A corner is not finite.
        """
        first, end = self.grid.box(low, high)
        self._mark(first, end, np.True_, kernels.CROSSED, time_ns)

    def mark_free_sphere(self, centre: ArrayLike, radius: float, time_ns: int) -> None:
        """Lower the cells whose centres lie in a sphere by one miss, except occupied ones.

        Args:
            centre: (3,) m, world.
            radius: m.
            time_ns: Simulated time, ns.

        Raises:
            ValueError: The sphere is not finite.
        """
        middle = finite_vector("centre", centre)
        first, end = self.grid.box(middle - radius, middle + radius)
        x, y, z = np.ix_(*self.grid.centres(first, end))
        squared = (x - middle[0]) ** 2 + (y - middle[1]) ** 2 + (z - middle[2]) ** 2
        self._mark(first, end, squared <= radius * radius, kernels.CROSSED, time_ns)

    def mark_floor(self, low: ArrayLike, high: ArrayLike, time_ns: int) -> None:
        """Raise the floor's cells whose centres lie in a rectangle by one hit, except free ones.

        What a standing body knows of the ground that none of its beams reach: it is held.

        Args:
            low: (2,) least corner, m, world.
            high: (2,) greatest corner, m, world.
            time_ns: Simulated time, ns.

        Raises:
            ValueError: A corner is not finite.
        """
        middle = self.origin[2] + (self.grid.floor_layer + 0.5) * self.resolution
        half = 0.25 * self.resolution  # the floor's layer and no other
        first, end = self.grid.box(
            [*np.ravel(low), middle - half], [*np.ravel(high), middle + half]
        )
        self._mark(first, end, np.True_, kernels.HIT, time_ns)

    def advance(self, time_ns: int) -> None:
        """Apply every decay tick due up to and at `time_ns`.

        The schedule is fixed: one tick at each multiple of the decay period since time 0. A tick
        leaves what was updated since the one before, and moves the rest toward unknown by the
        half-life, rounded toward zero. A time before the latest does nothing.

        Args:
            time_ns: Simulated time, ns.

        Raises:
            ValueError: The time is negative.
        """
        if time_ns < 0:
            raise ValueError(f"time_ns: got {time_ns}, expected 0 or more")
        due = time_ns // self._tick_ns
        while self._ticks < due and self._remains < WHOLE and self._alive.any():
            kernels.decay_cells(self.log_odds, self._marks, self._remains, self._dirty, self._alive)
            self._ticks += 1
        self._ticks = max(self._ticks, due)

    def states(self) -> NDArray[np.uint8]:
        """The state of every cell, (nx, ny, nz): 0 unknown, 1 free, 2 occupied."""
        states = np.empty(self.shape, np.uint8)
        kernels.cell_states(self.log_odds.reshape(-1), states.reshape(-1))
        return states

    def state_at(self, points: ArrayLike) -> NDArray[np.uint8]:
        """The state at points (n, 3), m, world: (n,); unknown outside the bounds."""
        cells, inside = self.grid.indices(points)
        states = np.empty(len(cells), np.uint8)
        kernels.cell_states(self.log_odds[tuple(cells.T)], states)
        return np.where(inside, states, np.uint8(UNKNOWN))

    def probability_at(self, points: ArrayLike) -> NDArray[np.float64]:
        """The probability of occupancy at points (n, 3), m, world: (n,); 0.5 outside."""
        cells, inside = self.grid.indices(points)
        log_odds = self.log_odds[tuple(cells.T)] / UNITS
        return np.where(inside, 1.0 / (1.0 + np.exp(-log_odds)), 0.5)

    def observed_ns_at(self, points: ArrayLike) -> NDArray[np.int64]:
        """When the blocks of points (n, 3), m, world, were last observed: (n,) ns; -1 never."""
        cells, inside = self.grid.indices(points)
        return np.where(inside, self._observed_ns[tuple(cells.T // kernels.BLOCK)], -1)

    def version(self) -> str:
        """Digest of geometry and log-odds, 32 hex digits: maps of equal content share it."""
        self._digests[self._dirty & ~self._alive] = 0
        blocks = np.ascontiguousarray(np.argwhere(self._dirty & self._alive))  # (k, 3)
        packed = np.empty(len(blocks) * (kernels.BLOCK + 1) * kernels.BLOCK**2, np.int16)
        ends = np.empty(len(blocks), np.int64)
        kernels.pack_blocks(self.log_odds, blocks, packed, ends)
        content = packed.astype("<i2", copy=False)  # the same bytes on every machine
        start = 0
        for block, end in zip(blocks.tolist(), ends.tolist(), strict=True):
            digest = hashlib.blake2b(content[start:end].data, digest_size=16).digest()
            self._digests[tuple(block)] = np.frombuffer(digest, np.uint8)
            start = end
        self._dirty[:] = False
        whole = self.grid.header() + self._digests.tobytes()
        return hashlib.blake2b(whole, digest_size=16).hexdigest()

    def counts(self) -> dict[str, int]:
        """Number of cells by the name of their state."""
        count = np.bincount(self.states().reshape(-1), minlength=len(STATE_NAMES))
        return {name: int(count[state]) for state, name in STATE_NAMES.items()}

    def memory_bytes(self) -> int:
        """Bytes that the map's arrays hold."""
        return sum(value.nbytes for value in vars(self).values() if isinstance(value, np.ndarray))

    def _mark(
        self,
        first: NDArray[np.int64],
        end: NDArray[np.int64],
        where: Any,  # booleans that broadcast to the box
        mark: int,
        time_ns: int,
    ) -> None:
        """Mark cells of a box, but none whose state contradicts the mark, and update them."""
        self.advance(time_ns)
        box = tuple(slice(a, b) for a, b in zip(first, end, strict=True))
        log_odds = self.log_odds[box]
        agrees = log_odds <= 0 if mark == kernels.CROSSED else log_odds >= 0
        self._marks[box][where & agrees] |= np.uint8(mark)
        self._apply(first, end, time_ns)

    def _apply(self, first: NDArray[np.int64], end: NDArray[np.int64], time_ns: int) -> int:
        """Update the marked cells, all within a box of cells; return their number."""
        low = np.clip(first, 0, self.shape) // kernels.BLOCK
        high = -(-np.clip(end, 0, self.shape) // kernels.BLOCK)
        updated = kernels.apply_marks(
            self.log_odds,
            self._marks,
            self._steps,
            np.stack([low, high]),
            time_ns,
            self._observed_ns,
            self._dirty,
            self._alive,
        )
        return int(updated)


def _steps(config: MapConfig) -> NDArray[np.int32]:
    """(hit, miss, low, high) in thousandths."""
    low, high = (np.log(p / (1.0 - p)) for p in (config.clamp_low, config.clamp_high))
    return np.array(
        [round(UNITS * step) for step in (config.hit, config.miss, low, high)], np.int32
    )


def _remains(config: MapConfig) -> int:
    """What one decay tick leaves of a cell: 2^(-period / half-life), in 1/65536."""
    if config.half_life == 0.0:
        return WHOLE
    return round(WHOLE * math.exp2(-config.decay_period / config.half_life))
