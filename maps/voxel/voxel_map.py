"""The voxel map: log-odds in integers over unbounded space, with decay and a version."""

from __future__ import annotations

import hashlib
import struct
from dataclasses import dataclass
from os import PathLike
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wayproof.maps.cell_sets import CellMask, box_mask
from wayproof.maps.columns import WORD_BITS, region_of_interest, unpack
from wayproof.maps.config import MapConfig
from wayproof.maps.elementary import norm
from wayproof.maps.grid import cells_at, finite_vector
from wayproof.maps.kernels import beams, decay
from wayproof.maps.kernels import update as updates
from wayproof.maps.representation import Representation
from wayproof.maps.states import FREE, OCCUPIED
from wayproof.maps.sweep import Ranges, Spared, SweepStatistics, prepare_sweep
from wayproof.maps.voxel import storage
from wayproof.maps.voxel.bricks import Bricks
from wayproof.maps.voxel.log_odds import LogOddsModel, decay_per_tick, states_of
from wayproof.maps.voxel.sweep_endpoints import cell_bounds
from wayproof.maps.voxel.update_mask import SweepRasterizer, UpdateMask


@dataclass(frozen=True)
class RayEnd:
    """End of a ray through the map.

    Attributes:
        state: State of the cell that stopped it: occupied or unknown.
        distance: Distance to where it enters that cell, m.
        point: (3,) that place, m, world.
    """

    state: int
    distance: float
    point: NDArray[np.float64]


class VoxelMap(Representation):
    """Cells over all space, each with the log-odds that it is occupied.

    A cell's update is l += logit P(m|z) - l0 with l0 = 0, clamped (Hornung et al. 2013, "OctoMap",
    eq. 2 and 4), in whole units as integers: the same sweeps give the same map on every machine.
    The sign of l is the state. A point lies in the cell
    (floor(x / resolution), floor(y / resolution), floor(z / resolution + 0.75)).

    Space is without bounds unless a region of interest is given. In it the cells are those of an
    unbounded map, one by one.

    Cells are held in bricks of 16 x 16 x 64, made where something is observed and given up once all
    of it is forgotten, or when the memory is full: see `Bricks`. All other cells are unknown.

    Attributes:
        config: The settings.
        resolution: Edge of a cell, m.
        evidence: Steps and clamps in units.
    """

    exempts = True

    def __init__(
        self,
        config: MapConfig,
        low: ArrayLike | None = None,
        high: ArrayLike | None = None,
    ) -> None:
        """Make an unknown map.

        Args:
            config: The settings.
            low: (3,) least corner of the region of interest, m, world; None for all space.
            high: (3,) greatest corner, m, world. The region is the least box of cells that covers
                both. Beams update only the cells in it; outside, all stays unknown, which
                saves time and memory.

        Raises:
            ValueError: Only one corner, or a region that is empty, not finite or of more cells than
                a costmap may have.
        """
        self.config = config
        self.resolution = config.resolution
        self.evidence = LogOddsModel.from_config(config)
        self._rasterizer = SweepRasterizer(
            cell_bounds(region_of_interest(low, high, config.resolution))
        )
        self._bricks = Bricks(config.memory_mib)
        self._losses = decay_per_tick(config)
        self._tick_ns = round(config.decay_period * 1e9)
        self._ticks = 0
        self._looked = -1  # tick at which all bricks were last looked at
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
        """Take in one sweep: each cell is updated once, and occupied wins over free.

        Cells before a return decrease and its own cell increases; a beam without return (65535, or
        beyond `range_limit`) decreases every cell up to the limit; a dropped one (0) has no effect.
        Beams that end in the same cell count as one, and none decreases cells of the layer that is
        spared. Decay ticks due are applied first.

        Args:
            origins: (3,) where the beams start, m, world; or (m, 3), for a sensor that moves.
            directions: (n, 3) unit vectors, world.
            ranges_mm: (n,) measured ranges, mm.
            range_limit: Range up to which a beam without return is evidence of free space, m.
            time_ns: Simulated time of the sweep, ns.
            moments: (n,) index of each beam's origin, if there are several.
            spared: Layer that beams which end in it do not decrease.

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
        endpoints = self._rasterizer.endpoints(sweep)
        self.advance(time_ns)
        mask = self._rasterizer.trace(sweep, endpoints, spared)
        updated = self._apply(mask, time_ns)
        hits, clears, dropped, too_near = endpoints.counts
        return SweepStatistics(hits, clears, dropped, too_near, updated)

    def mark(self, cells: CellMask, state: int, time_ns: int) -> None:
        """Lower cells by one miss, or raise them by one hit, except those of the contrary state.

        Args:
            cells: Which of them.
            state: Target state: free or occupied.
            time_ns: Simulated time, ns.

        Raises:
            ValueError: The time is negative.
        """
        self.advance(time_ns)
        if cells.inside.size == 0:
            return
        nx, ny, nz = cells.inside.shape
        occupied, free = self.columns(cells.first, (nx, ny, -(-nz // WORD_BITS)))
        contrary = unpack(occupied if state == FREE else free, nz).view(np.bool_)
        mask = self._rasterizer.fill(
            cells.first, cells.inside & ~contrary, raised=state == OCCUPIED
        )
        self._apply(mask, time_ns)

    def exempt_from_decay(self, low: ArrayLike, high: ArrayLike, time_ns: int) -> None:
        """Exempt the cells whose centres lie in a box from the next decay tick.

        For cells that a standing body's sensors cannot see, under it and around it. Their log-odds
        do not change.

        Args:
            low: (3,) least corner, m, world.
            high: (3,) greatest corner, m, world.
            time_ns: Simulated time, ns.

        Raises:
            ValueError: A corner is not finite, or the time is negative.
        """
        cells = box_mask(low, high, self.resolution)
        self.advance(time_ns)
        if self.config.half_life == 0.0 or cells.inside.size == 0:
            return
        mask = self._rasterizer.fill(cells.first, cells.inside, raised=False)
        _, bits = mask.take()
        slots = self._bricks.find(mask.bricks)
        known = slots[slots >= 0]
        self._fade(known, to_now=True)
        self._bricks.fresh[known] |= bits[slots >= 0]
        self._bricks.dues[known] = self._ticks + 1

    def advance(self, time_ns: int) -> None:
        """Apply every decay tick due up to and at `time_ns`.

        The schedule is fixed: one tick at each multiple of the decay period since time 0. A tick
        leaves what was updated since the one before, and moves the rest toward unknown by the
        half-life. A brick is touched only at ticks that change one of its states; all others are
        brought up to date when they are updated or read. A time before the latest does nothing.

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
        if self._ticks == self._looked:
            return
        self._looked = self._ticks
        live = self._bricks.live()
        due = live[self._bricks.dues[live] <= self._ticks]
        if len(due):
            self._stamp += 1
            self._fade(due, to_now=False)

    def state_at(self, points: ArrayLike) -> NDArray[np.uint8]:
        """Return the state at points (n, 3), m, world: (n,)."""
        return states_of(self._values_at(points)[0])

    def probability_at(self, points: ArrayLike) -> NDArray[np.float64]:
        """Return the probability of occupancy (n,) at points (n, 3), m, world; 0.5 if unknown."""
        values, slots = self._values_at(points)
        ticks = np.where(slots >= 0, self._bricks.ticks[slots], self._ticks)
        decay.fade_values(values, ticks, self._ticks, self._losses)
        return self.evidence.probability(values)

    def observed_ns_at(self, points: ArrayLike) -> NDArray[np.int64]:
        """Return when the bricks of points (n, 3), m, were last observed: (n,) ns; -1 never."""
        _, slots = self._values_at(points)
        return np.where(slots >= 0, self._bricks.observed_ns[slots], -1)

    def columns(
        self, low_cell: ArrayLike, shape: tuple[int, int, int]
    ) -> tuple[NDArray[np.uint64], NDArray[np.uint64]]:
        """Return the states of a window of cells, a bit each.

        Args:
            low_cell: (3,) least cell of the window.
            shape: (nx, ny, words) columns and words of 64 cells along z.

        Returns:
            Occupied and free cells, (nx, ny, words) each: bit k of word w is the cell
            low_z + 64 w + k. One that is neither is unknown.
        """
        occupied, free = np.empty(shape, np.uint64), np.empty(shape, np.uint64)
        x, y, z = (int(cell) for cell in np.ravel(low_cell))
        if occupied.size:
            whole = np.array([[x, y, z, x + shape[0], y + shape[1], z + 64 * shape[2]]])
            # Not a subclass's, which may lay something over them.
            VoxelMap.rewrite_columns(self, (x, y, z), whole, occupied, free)
        return occupied, free

    def rewrite_columns(
        self,
        low_cell: tuple[int, int, int],
        boxes: NDArray[np.int64],
        occupied: NDArray[np.uint64],
        free: NDArray[np.uint64],
    ) -> None:
        """Write the states of a window of cells again where they changed.

        Args:
            low_cell: Least cell of the window.
            boxes: (k, 6) cells that changed, as `changed` returns them; whole columns of
                bricks above and below are written.
            occupied: (nx, ny, words) bits as `columns` returned them before; brought up to date.
            free: (nx, ny, words) likewise.
        """
        self._bricks.rewrite_columns(low_cell, boxes, occupied, free)

    def changed(self, since: int) -> tuple[NDArray[np.int64], int]:
        """Return where states changed since an earlier call.

        Args:
            since: Stamp that an earlier call returned as `now`; 0 for all that is held.

        Returns:
            Boxes of cells (k, 6) as [x0, y0, z0, x1, y1, z1), one for each brick, and `now`. A box
            may also hold a state that changed and changed back. One box of all space if
            since then more bricks were released than are remembered (65536).
        """
        return self._bricks.changed_boxes(since), self._stamp

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
        length = norm(toward)
        if length == 0.0 or not 0.0 < max_range <= 1e6:
            raise ValueError(f"ray: got length {length:g} and range {max_range:g}, expected more")
        toward /= length
        scaled = start / self.resolution + [0.0, 0.0, beams.FLOOR_SUBCELLS / beams.SUBCELLS]
        distance, state = self._bricks.cast_ray(
            scaled, toward, max_range / self.resolution, stop_at_unknown
        )
        if state == FREE:
            return None
        return RayEnd(
            state, distance * self.resolution, start + distance * self.resolution * toward
        )

    def counts(self) -> dict[str, int]:
        """Return the number of free and of occupied cells by the name of their state."""
        return self._bricks.counts()

    def version(self) -> str:
        """Return the digest of the content, 32 hex digits: equal sweeps and ticks give it again.

        It covers each brick as the last update or change of a state left it, and at which tick; the
        decay since then follows from the number of ticks, which is covered as well.
        """
        total = self._bricks.digest_cells()
        ticks = self._ticks if self.config.half_life > 0.0 and total else 0
        head = struct.pack("<dqq", self.resolution, self.evidence.units, ticks)
        whole = hashlib.blake2b(head + total.to_bytes(16, "little"), digest_size=16)
        return whole.hexdigest()

    def memory_bytes(self) -> int:
        """Return the bytes of the bricks in use and of the masks of a sweep."""
        return self._bricks.nbytes + self._rasterizer.nbytes

    def save(self, path: str | PathLike[str]) -> None:
        """Write the map to a file, first under a temporary name.

        Raises:
            OSError: The file cannot be written.
        """
        storage.write(path, self.config, self._ticks, self._bricks)

    @classmethod
    def load(
        cls,
        path: str | PathLike[str],
        low: ArrayLike | None = None,
        high: ArrayLike | None = None,
    ) -> Self:
        """Read a map with its settings from a file that `save` wrote.

        Args:
            path: Path of the file.
            low: (3,) least corner of the region in which sweeps to come are looked at, m, world;
                None for all space. The content of the file is kept wherever it lies.
            high: (3,) greatest corner, m, world.

        Raises:
            ValueError: The file is not such a one, or was cut or changed; a region as of a new
                map.
            OSError: The file cannot be read.
        """
        config, content = storage.read(path)
        loaded = cls(config, low, high)
        loaded.restore(content)
        return loaded

    def content(self) -> storage.VoxelContent:
        """Copy all that the map holds; equal maps have equal contents."""
        return storage.content_of(self._bricks, self._ticks)

    def restore(self, content: storage.VoxelContent) -> None:
        """Hold a content in place of the own one, and go on from it bit by bit.

        Args:
            content: Content of a map with the same settings.

        Raises:
            ValueError: It is more than the memory of this map holds.
        """
        self._stamp += 1
        storage.restore(content, self._bricks, self._stamp, self.evidence.low)
        self._ticks = content.ticks
        self._looked = -1  # all bricks are looked at again, and none is due

    def check(self, content: storage.VoxelContent, time_ns: int) -> None:
        """Check that a content of unknown origin is one that this map can have at a time, ns.

        Raises:
            ValueError: It is not.
        """
        ticks = time_ns // self._tick_ns if self.config.half_life > 0.0 else 0
        content.check(ticks, time_ns, self.evidence.low, self.evidence.high)

    @property
    def most_bricks(self) -> int:
        """Number of bricks that its memory holds."""
        return self._bricks.capacity

    def _values_at(self, points: ArrayLike) -> tuple[NDArray[np.int8], NDArray[np.int64]]:
        """Return log-odds at points (n, 3) as their bricks hold them, and the slots of these."""
        cells, inside = cells_at(points, self.resolution)
        values, slots = self._bricks.values_at(cells)
        values[~inside], slots[~inside] = 0, -1
        return values, slots

    def _apply(self, mask: UpdateMask, time_ns: int) -> int:
        """Update the marked cells; return their number."""
        bricks = self._bricks
        self._stamp += 1
        slots = bricks.obtain(mask.bricks, self._ticks, self._stamp)
        self._fade(slots[slots >= 0], to_now=True)
        due = self._ticks + 1 if self.config.half_life > 0.0 else decay.NEVER
        marks = updates.WindowMarks(mask.strides, mask.hits, mask.misses)
        now = updates.UpdateTime(time_ns, self._stamp, due)
        return updates.update_bricks(
            slots, mask.offsets, marks, self.evidence.steps, bricks.arrays, now
        )

    def _fade(self, slots: NDArray[np.int64], to_now: bool) -> None:
        """Bring bricks up to date with the ticks, and give up those that are all unknown."""
        bricks = self._bricks
        behind = slots[bricks.ticks[slots] < self._ticks]
        if len(behind) == 0:
            return
        turned, alive = (np.zeros(len(behind), np.bool_) for _ in range(2))
        faded = decay.FadedBricks(turned, alive)
        eights = np.empty(8, np.uint64)
        scratch = decay.FadeScratch(
            steps=np.empty(decay.MAGNITUDES, np.uint8),
            magnitudes=np.empty(64, np.uint8),
            losses=eights.view(np.uint8),
            loss_words=eights,
        )
        decay.fade_bricks(behind, self._ticks, to_now, bricks.arrays, self._losses, faded, scratch)
        bricks.dirty[behind] = True
        bricks.stamps[behind[turned]] = self._stamp
        if not to_now:
            bricks.release(behind[~alive], self._stamp)
