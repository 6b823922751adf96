"""An unbounded voxel map of log-odds: exact in integers, three states, decay and a version."""

from __future__ import annotations

import hashlib
import math
import struct
from dataclasses import dataclass
from os import PathLike
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from maps import _beam_kernels as beams
from maps import _brick_kernels as kernels
from maps import _decay_kernels as decay
from maps import _update_kernels as updates
from maps import storage
from maps.bricks import Bricks
from maps.columns import Window
from maps.config import MapConfig
from maps.evidence import Evidence, tick_losses
from maps.grid import FLOOR_LAYER, cell_box, cells_at, centres, finite_vector
from maps.marks import Marks, SweepWindow, brick_cells, unpack_bits
from maps.states import FREE, OCCUPIED, STATE_NAMES, UNKNOWN
from maps.sweep import SweepStatistics, prepare_sweep
from maps.team import Team


@dataclass(frozen=True)
class RayEnd:
    """Where a ray through the map ends.

    Attributes:
        state: Of the cell that stopped it: occupied or unknown.
        distance: To where it enters that cell, m.
        point: (3,) that place, m, world.
    """

    state: int
    distance: float
    point: NDArray[np.float64]


class VoxelMap:
    """Cells over all space, each with the log-odds that it is occupied.

    A cell's update is l += logit P(m|z) - l0 with l0 = 0, clamped (Hornung et al. 2013, "OctoMap",
    eq. 2 and 4), in whole units as integers: the same sweeps give the same map on every machine and
    for any number of threads. The sign of l is the state. A point lies in the cell
    (floor(x / resolution), floor(y / resolution), floor(z / resolution + 0.75)).

    Space is without bounds unless a region of interest is given. In it the cells are those of an
    unbounded map, one by one.

    Cells are held in bricks of 16 x 16 x 64, made where something is observed and given up once all
    of it is forgotten, or when the memory is full: see `Bricks`. What is not held is unknown.

    Attributes:
        config: The settings.
        resolution: Edge of a cell, m.
        evidence: Steps and clamps in units.
    """

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
            threads: Number of threads that share the work of a sweep.
            low: (3,) least corner of the region of interest, m, world; None for all space.
            high: (3,) greatest corner, m, world. The region is the least box of cells that covers
                both. Of a beam only the cells in it are looked at, and what is outside stays
                unknown: that saves the time and the memory of all that does not matter.

        Raises:
            ValueError: Not 1 to 64 threads, only one corner, or a region that is empty, not finite
                or of more cells than a costmap may have.
        """
        self.config = config
        self.resolution = config.resolution
        self.evidence = Evidence.of(config)
        self._team = Team(threads)
        self._window = SweepWindow(self._team, _region(low, high, config.resolution))
        self._bricks = Bricks(config.memory_mib)
        self._losses = tick_losses(config)
        self._tick_ns = round(config.decay_period * 1e9)
        self._ticks = 0
        self._stamp = 1

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
        Beams that end in the same cell count as one. With the surface guard, a beam that ends in
        the floor's layer does not decrease that layer: at grazing angles it would take away the
        floor that it is about to hit. Decay ticks due are applied first.

        Args:
            origins: (3,) where the beams start, m, world; or (m, 3), for a sensor that moves.
            directions: (n, 3) unit vectors, world.
            ranges_mm: (n,) measured ranges, mm.
            range_limit: Range up to which a beam without return is evidence of free space, m.
            time_ns: Simulated time of the sweep, ns.
            moments: (n,) index of each beam's origin, if there are several.

        Raises:
            ValueError: A position or direction is not finite, an array has another shape, the
                range limit is not within 0 to 2047 cells, the beams span more than 2^32 cells, or
                the time is negative. The map is then as before.
        """
        config = self.config
        sweep = prepare_sweep(
            origins,
            moments,
            directions,
            ranges_mm,
            range_limit,
            config.minimum_range,
            self.resolution,
        )
        placed = self._window.place(sweep)
        self.advance(time_ns)
        marks = self._window.carve(sweep, placed, config.surface_guard == "floor")
        updated = self._apply(marks, time_ns)
        hits, clears, dropped, too_near = placed.counts.tolist()
        return SweepStatistics(hits, clears, dropped, too_near, updated)

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
        first, end = cell_box(low, high, self.resolution)
        self._mark(first, np.ones(end - first, np.bool_), OCCUPIED, time_ns)

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
        first, end = cell_box(middle - radius, middle + radius, self.resolution)
        cells = np.moveaxis(np.indices(tuple(end - first)), 0, -1) + first  # (nx, ny, nz, 3)
        squared = ((centres(cells, self.resolution) - middle) ** 2).sum(axis=-1)
        self._mark(first, squared <= radius * radius, OCCUPIED, time_ns)

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
        first, end = cell_box([*np.ravel(low), 0.0], [*np.ravel(high), 0.0], self.resolution)
        first[2], end[2] = FLOOR_LAYER, FLOOR_LAYER + 1
        self._mark(first, np.ones(end - first, np.bool_), FREE, time_ns)

    def hold(self, low: ArrayLike, high: ArrayLike, time_ns: int) -> None:
        """Spare the cells whose centres lie in a box from the next decay tick.

        For what a standing body's sensors cannot see, under it and around it: called between ticks,
        it is not forgotten. Nothing is learnt by it either.

        Args:
            low: (3,) least corner, m, world.
            high: (3,) greatest corner, m, world.
            time_ns: Simulated time, ns.

        Raises:
            ValueError: A corner is not finite.
        """
        first, end = cell_box(low, high, self.resolution)
        self.advance(time_ns)
        if self.config.half_life == 0.0 or np.any(end <= first):
            return
        marks = self._window.fill(first, np.ones(end - first, np.bool_), raised=False)
        bits = marks.take_free()
        slots = self._bricks.find(marks.bricks)
        known = slots[slots >= 0]
        self._fade(known, to_now=True)
        self._bricks.fresh[known] |= bits[slots >= 0]
        self._bricks.dues[known] = self._ticks + 1

    def advance(self, time_ns: int) -> None:
        """Apply every decay tick due up to and at `time_ns`.

        The schedule is fixed: one tick at each multiple of the decay period since time 0. A tick
        leaves what was updated since the one before, and moves the rest toward unknown by the
        half-life. A brick is touched only at ticks that change one of its states; all others are
        made up for when it is updated or asked. A time before the latest does nothing.

        Args:
            time_ns: Simulated time, ns.

        Raises:
            ValueError: The time is negative.
        """
        if time_ns < 0:
            raise ValueError(f"time_ns: got {time_ns}, expected 0 or more")
        if self.config.half_life == 0.0:
            return
        self._ticks = max(self._ticks, time_ns // self._tick_ns)
        live = self._bricks.live()
        due = live[self._bricks.dues[live] <= self._ticks]
        if len(due):
            self._stamp += 1
            self._fade(due, to_now=False)

    def state_at(self, points: ArrayLike) -> NDArray[np.uint8]:
        """The state at points (n, 3), m, world: (n,)."""
        return _states(self._values_at(points)[0])

    def probability_at(self, points: ArrayLike) -> NDArray[np.float64]:
        """The probability of occupancy at points (n, 3), m, world: (n,); 0.5 where unknown."""
        values, slots = self._values_at(points)
        ticks = np.where(slots >= 0, self._bricks.ticks[slots], self._ticks)
        decay.fade_values(values, ticks, self._ticks, self._losses)
        return self.evidence.probability(values)

    def observed_ns_at(self, points: ArrayLike) -> NDArray[np.int64]:
        """When the bricks of points (n, 3), m, world, were last observed: (n,) ns; -1 never."""
        _, slots = self._values_at(points)
        return np.where(slots >= 0, self._bricks.observed_ns[slots], -1)

    def columns(
        self, low_cell: ArrayLike, shape: tuple[int, int, int]
    ) -> tuple[NDArray[np.uint64], NDArray[np.uint64]]:
        """The states of a window of cells, a bit each.

        Args:
            low_cell: (3,) least cell of the window.
            shape: (nx, ny, words) columns and words of 64 cells along z.

        Returns:
            Occupied and free cells, (nx, ny, words) each: bit k of word w is the cell
            low_z + 64 w + k. One that is neither is unknown.
        """
        occupied, free = np.zeros(shape, np.uint64), np.zeros(shape, np.uint64)
        x, y, z = (int(cell) for cell in np.ravel(low_cell))
        bricks = self._bricks

        def write(_: int, rows: tuple[int, int]) -> None:
            part, corner = slice(*rows), (x + rows[0], y, z)
            kernels.write_columns(
                *bricks.directory,
                bricks.eights,
                bricks.settled,
                corner,
                occupied[part],
                free[part],
            )

        if occupied.size:
            self._team.share(write, shape[0], parts_each=1)
        return occupied, free

    def changed(self, since: int) -> tuple[NDArray[np.int64], int]:
        """Where states changed since an earlier call.

        Args:
            since: What that call returned as `now`; 0 for everything that is held.

        Returns:
            Boxes of cells (k, 6) as [x0, y0, z0, x1, y1, z1), one for each brick, and `now`. A box
            may also hold a state that changed and changed back. One box of all space is told if
            since then more bricks were given up than are remembered (65536).
        """
        return self._bricks.changed(since), self._stamp

    def states_in(self, low: ArrayLike, high: ArrayLike) -> NDArray[np.uint8]:
        """States (nx, ny, nz) of the cells whose centres lie in a box, corners (3,) m, world."""
        first, end = cell_box(low, high, self.resolution)
        nx, ny, nz = (int(n) for n in end - first)
        occupied, free = self.columns(first, (nx, ny, -(-nz // 64)))
        states = unpack_bits(free) * np.uint8(FREE) + unpack_bits(occupied) * np.uint8(OCCUPIED)
        return np.ascontiguousarray(states[:, :, :nz])

    def cast_ray(
        self,
        origin: ArrayLike,
        direction: ArrayLike,
        max_range: float,
        stop_at_unknown: bool = False,
    ) -> RayEnd | None:
        """Follow a ray to the first occupied cell, or the first that is unknown as well.

        Args:
            origin: (3,) m, world.
            direction: (3,) of any length but 0, world.
            max_range: m.
            stop_at_unknown: Whether an unknown cell stops it.

        Returns:
            Where it ends; None if nothing stops it within the range.

        Raises:
            ValueError: The ray is not finite, or the range is not more than 0 and at most 1e6 m.
        """
        start, toward = finite_vector("origin", origin), finite_vector("direction", direction)
        length = math.sqrt(float(toward @ toward))
        if length == 0.0 or not 0.0 < max_range <= 1e6:
            raise ValueError(f"ray: got length {length:g} and range {max_range:g}, expected more")
        toward /= length
        scaled = start / self.resolution + [0.0, 0.0, beams.FLOOR_SUBCELLS / beams.SUBCELLS]
        bricks = self._bricks
        reach = max_range / self.resolution
        distance, state = kernels.walk(
            *bricks.directory, bricks.cells, scaled, toward, reach, stop_at_unknown
        )
        if state == FREE:
            return None
        return RayEnd(
            state, distance * self.resolution, start + distance * self.resolution * toward
        )

    def is_free_along(self, start: ArrayLike, end: ArrayLike) -> bool:
        """Whether every cell on the line between two points (3,), m, world, is free."""
        way = finite_vector("end", end) - finite_vector("start", start)
        length = math.sqrt(float(way @ way))
        if length == 0.0:
            return bool(self.state_at(np.reshape(start, (1, 3)))[0] == FREE)
        return self.cast_ray(start, way, length, stop_at_unknown=True) is None

    def occupied_centres(self) -> NDArray[np.float64]:
        """Centres of all occupied cells, (n, 3) m, world, by brick and then by cell."""
        bricks = self._bricks
        live = bricks.live()
        live = live[np.lexsort(bricks.keys[live].T[::-1])]
        parts = [np.empty((0, 3), np.int64)]
        for slot in live:
            column, z = np.nonzero(bricks.cells[slot] > 0)
            cells = np.stack([column >> kernels.EDGE_BITS, column & (kernels.EDGE - 1), z], axis=1)
            parts.append(cells + brick_cells(bricks.keys[slot]))
        return centres(np.concatenate(parts), self.resolution)

    def version(self) -> str:
        """Digest of the content, 32 hex digits: the same sweeps and ticks give the same one.

        Of each brick it holds what the last update or change of a state left, and at which tick;
        what decay made of it since follows from the number of ticks, which is in as well.
        """
        total = self._bricks.digest(self._team)
        ticks = self._ticks if self.config.half_life > 0.0 and total else 0
        head = struct.pack("<dqq", self.resolution, self.evidence.units, ticks)
        whole = hashlib.blake2b(head + total.to_bytes(16, "little"), digest_size=16)
        return whole.hexdigest()

    def counts(self) -> dict[str, int]:
        """Number of free and of occupied cells by the name of their state."""
        live = self._bricks.live()
        cells = self._bricks.cells
        free = sum(int(np.count_nonzero(cells[slot] < 0)) for slot in live)
        occupied = sum(int(np.count_nonzero(cells[slot] > 0)) for slot in live)
        return {STATE_NAMES[FREE]: free, STATE_NAMES[OCCUPIED]: occupied}

    def rounding(self) -> dict[str, tuple[float, float]]:
        """What whole units make of the settings: by name the value asked and the one in effect."""
        return self.evidence.rounding(self.config)

    def memory_bytes(self) -> int:
        """Bytes of the bricks in use and of the masks of a sweep."""
        return self._bricks.nbytes + self._window.nbytes

    def save(self, path: str | PathLike[str]) -> None:
        """Write the map to a file, first under a temporary name.

        Raises:
            OSError: The file cannot be written.
        """
        storage.write(path, self.config, self._ticks, self._bricks)

    @classmethod
    def load(cls, path: str | PathLike[str], threads: int = 1) -> Self:
        """Read a map with its settings from a file that `save` wrote.

        Raises:
            ValueError: The file is not such a one, or was cut or changed.
            OSError: The file cannot be read.
        """
        config, ticks, records = storage.read(path)
        loaded = cls(config, threads)
        loaded._ticks = ticks
        storage.restore(records, loaded._bricks, loaded._stamp)
        return loaded

    def _values_at(self, points: ArrayLike) -> tuple[NDArray[np.int8], NDArray[np.int64]]:
        """Log-odds at points (n, 3) as their bricks hold them, and the slots of these."""
        cells, inside = cells_at(points, self.resolution)
        values, slots = np.empty(len(cells), np.int8), np.empty(len(cells), np.int64)
        kernels.look_up(*self._bricks.directory, self._bricks.cells, cells, slots, values)
        values[~inside], slots[~inside] = 0, -1
        return values, slots

    def _mark(
        self, first: NDArray[np.int64], cells: NDArray[np.bool_], except_for: int, time_ns: int
    ) -> None:
        """Mark cells (nx, ny, nz) of a box, but none whose state is `except_for`, and update."""
        self.advance(time_ns)
        if cells.size == 0:
            return
        nx, ny, nz = cells.shape
        occupied, free = self.columns(first, (nx, ny, -(-nz // 64)))
        spared = unpack_bits(occupied if except_for == OCCUPIED else free)[:, :, :nz]
        marks = self._window.fill(first, cells & ~spared, raised=except_for == FREE)
        self._apply(marks, time_ns)

    def _apply(self, marks: Marks, time_ns: int) -> int:
        """Update the marked cells; return their number."""
        bricks, count = self._bricks, len(marks.bricks)
        self._stamp += 1
        slots = bricks.reserve(marks.bricks, self._ticks, self._stamp)
        known = slots[slots >= 0]
        self._fade(known, to_now=True)
        changes, updated = np.zeros(count, np.uint8), np.zeros(count, np.int64)

        def update(_: int, part: tuple[int, int]) -> None:
            updates.update_bricks(
                slots,
                marks.places,
                part,
                marks.strides,
                marks.hits,
                marks.free,
                self.evidence.steps,
                bricks.cells,
                bricks.eights,
                bricks.fresh,
                bricks.settled,
                changes,
                updated,
            )

        self._team.share(update, count, parts_each=2)
        bricks.observed_ns[known] = np.maximum(bricks.observed_ns[known], time_ns)
        bricks.dirty[slots[(changes & updates.CONTENT_CHANGED > 0) & (slots >= 0)]] = True
        turned = (changes & updates.STATES_CHANGED > 0) & (slots >= 0)
        bricks.stamps[slots[turned]] = self._stamp
        if self.config.half_life > 0.0:
            bricks.dues[known] = self._ticks + 1
        return int(updated[slots >= 0].sum())

    def _fade(self, slots: NDArray[np.int64], to_now: bool) -> None:
        """Bring bricks up to date with the ticks, and give up those that are all unknown."""
        bricks = self._bricks
        behind = slots[bricks.ticks[slots] < self._ticks]
        turned, alive = (np.zeros(len(behind), np.bool_) for _ in range(2))

        def fade(_: int, part: tuple[int, int]) -> None:
            decay.fade_bricks(
                behind,
                part,
                self._ticks,
                to_now,
                bricks.eights,
                bricks.fresh,
                bricks.settled,
                bricks.ticks,
                bricks.dues,
                self._losses,
                turned,
                alive,
                np.empty(decay.EDGE_VALUES, np.bool_),
                np.empty(decay.EDGE_VALUES, np.int8),
            )

        self._team.share(fade, len(behind), parts_each=2)
        bricks.dirty[behind] = True
        bricks.stamps[behind[turned]] = self._stamp
        if not to_now:
            bricks.release(behind[~alive], self._stamp)


def _region(
    low: ArrayLike | None, high: ArrayLike | None, resolution: float
) -> NDArray[np.int64] | None:
    """Least and greatest cell (2, 3) of a region of interest, if there is one."""
    if low is None and high is None:
        return None
    if low is None or high is None:
        raise ValueError(f"low, high: got {low!r} and {high!r}, expected both corners or neither")
    window = Window.covering(low, high, resolution)
    first = np.array(window.first)
    return np.stack([first, first + window.shape - 1])


def _states(values: NDArray[np.int8]) -> NDArray[np.uint8]:
    """The sign of the log-odds is the state: 0 unknown, 1 free, 2 occupied."""
    states: NDArray[np.uint8] = np.where(values < 0, FREE, np.where(values > 0, OCCUPIED, UNKNOWN))
    return states.astype(np.uint8)
