"""A voxel map for dynamic scenes: moving objects are detected, cleared and predicted."""

from __future__ import annotations

import hashlib
import json
import struct
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wayproof.maps.cell_sets import as_set, member, slabs
from wayproof.maps.config import MapConfig
from wayproof.maps.elementary import norm
from wayproof.maps.grid import cells_at, centres, finite_vector
from wayproof.maps.kernels import beams
from wayproof.maps.kernels import tracking as kernels
from wayproof.maps.others.ever_free import EverFreeSpace
from wayproof.maps.others.tracking import NO_CELLS, Traffic
from wayproof.maps.slot_pool import EVERYWHERE, ChangeLog
from wayproof.maps.states import FREE, OCCUPIED, STATE_NAMES
from wayproof.maps.sweep import Ranges, Spared, SweepStatistics, prepare_sweep
from wayproof.maps.voxel.bricks import brick_boxes, brick_cells, brick_of
from wayproof.maps.voxel.endpoints import BeamEndpoints
from wayproof.maps.voxel.voxel_map import RayEnd, VoxelMap

BRICK_SHAPE = (16, 16, 1)  # columns and words
RECENT_NS = 100_000_000
"""Age of hits that show where an object is now, ns: a sweep or two of each sensor."""

AROUND = np.stack(np.meshgrid(*[range(-2, 3)] * 3, indexing="ij"), axis=-1).reshape(1, -1, 3)
"""Offsets from a cell to those near it: at most one cell between them, as in a cluster."""

BEYOND = 1e-6  # m: past a cell's face, so that the next ray starts in the next cell


@dataclass(frozen=True)
class Sightings:
    """Ever-free cells in which something was hit: the short-term evidence.

    Attributes:
        cells: (m, 3) in lexical order.
        since_ns: (m,) time of the first hit, ns.
        hit_ns: (m,) time of the last hit, ns.
        crossings: (m,) sweeps that crossed it since it was last hit.
        moves: (m,) whether it was ever part of a moving object.
    """

    cells: NDArray[np.int64]
    since_ns: NDArray[np.int64]
    hit_ns: NDArray[np.int64]
    crossings: NDArray[np.int64]
    moves: NDArray[np.bool_]

    def part(self, chosen: NDArray[np.bool_] | NDArray[np.int64]) -> Sightings:
        """Return those chosen by a mask or by indices."""
        return Sightings(
            self.cells[chosen],
            self.since_ns[chosen],
            self.hit_ns[chosen],
            self.crossings[chosen],
            self.moves[chosen],
        )


class Overlay(NamedTuple):
    """Differences of the map from its static evidence; each a set of cells (n, 3).

    Attributes:
        claimed: Occupied: a moving object is there, or is predicted to be.
        vacated: Free, where the static evidence is still occupied.
    """

    claimed: NDArray[np.int64]
    vacated: NDArray[np.int64]


class DynamicMap(VoxelMap):
    """A voxel map with evidence on two time scales, and a prediction.

    The static evidence is that of `VoxelMap`, update for update. On top, each cell that was
    ever-free for `burn_in` (see `EverFreeSpace`) and is hit is *dynamic*: occupied with that hit,
    and free again once `free_after_misses` sweeps in a row cross it. The clamp, which keeps a wall
    from flickering, makes a voxel map slower at both. A dynamic cell that is not left for
    `static_after` is a static one from then on.

    Dynamic cells that touch are a cluster, and clusters of successive sweeps are matched by place.
    Each moves on at constant velocity, and the cells that it crosses within `prediction_horizon`
    are occupied. So only surfaces that were seen are predicted; a hidden back is not.

    `state_at`, `columns`, `changed`, `version` and all that derives from them include all of this;
    `probability_at` and a saved file hold the static evidence alone.
    """

    def __init__(
        self,
        config: MapConfig,
        low: ArrayLike | None = None,
        high: ArrayLike | None = None,
    ) -> None:
        """Make an unknown map, as `Representation` says."""
        super().__init__(config, low, high)
        self._ever_free = EverFreeSpace()
        self._traffic = Traffic(config.resolution, round(config.dynamic.prediction_horizon * 1e9))
        none = np.empty(0, np.int64)
        self._sightings = Sightings(NO_CELLS, none, none, none, np.empty(0, np.bool_))
        self._overlay = Overlay(NO_CELLS, NO_CELLS)
        self._overlay_changes = ChangeLog()  # by brick
        self._period_ns = round(config.dynamic.burn_in * 1e9)
        self._period = 0
        self._seen = 0  # stamp up to which the ever-free space follows the map
        self._now_ns = 0

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
        """Take in one sweep as `VoxelMap.integrate` does, and track what moves in it."""
        sweep = prepare_sweep(
            origins,
            moments,
            directions,
            ranges_mm,
            range_limit,
            self.config.minimum_range,
            self.resolution,
        )
        ends = BeamEndpoints.of_sweep(sweep)
        self.advance(time_ns)
        before = self._evidence()
        statistics = super().integrate(
            origins, directions, ranges_mm, range_limit, time_ns, moments, spared
        )
        crossed = self._evidence() < before
        self._now_ns = max(self._now_ns, time_ns)
        met = self._learn_free(ends.points[ends.returned] >> beams.SUBCELL_BITS)
        self._sightings = self._retire(self._meet(met, crossed))
        self._close_period()
        self._predict()
        return statistics

    def state_at(self, points: ArrayLike) -> NDArray[np.uint8]:
        """Return the state at points (n, 3), m, world: (n,)."""
        states = super().state_at(points)
        cells, inside = cells_at(points, self.resolution)
        claimed, vacated = (member(part, cells) & inside for part in self._overlay)
        states[vacated & (states == OCCUPIED)] = FREE
        states[claimed] = OCCUPIED
        return states

    def columns(
        self, low_cell: ArrayLike, shape: tuple[int, int, int]
    ) -> tuple[NDArray[np.uint64], NDArray[np.uint64]]:
        """Return the states of a window of cells, a bit each, as `VoxelMap.columns` does."""
        occupied, free = super().columns(low_cell, shape)
        x, y, z = (int(cell) for cell in np.ravel(low_cell))
        self._lay_over((x, y, z), occupied, free)
        return occupied, free

    def rewrite_columns(
        self,
        low_cell: tuple[int, int, int],
        boxes: NDArray[np.int64],
        occupied: NDArray[np.uint64],
        free: NDArray[np.uint64],
    ) -> None:
        """Write the states of a window of cells again, as `VoxelMap.rewrite_columns` does."""
        super().rewrite_columns(low_cell, boxes, occupied, free)
        # Where nothing changed it lies over them already, and once more changes nothing.
        self._lay_over(low_cell, occupied, free)

    def changed(self, since: int) -> tuple[NDArray[np.int64], int]:
        """Return where states changed since a stamp, as `VoxelMap.changed` does."""
        boxes, now = super().changed(since)
        keys = self._overlay_changes.after(since)
        if keys is None:
            return EVERYWHERE.copy(), now
        return np.concatenate([boxes, brick_boxes(keys)]), now

    def cast_ray(
        self,
        origin: ArrayLike,
        direction: ArrayLike,
        max_range: float,
        stop_at_unknown: bool = False,
    ) -> RayEnd | None:
        """Follow a ray to the first occupied cell, or the first that is unknown as well.

        See `VoxelMap.cast_ray`.
        """
        end = super().cast_ray(origin, direction, max_range, stop_at_unknown)
        start, toward = finite_vector("origin", origin), finite_vector("direction", direction)
        toward /= norm(toward)
        while end is not None and end.state == OCCUPIED:
            inside = end.point + BEYOND * toward
            if self.state_at(inside[None])[0] == OCCUPIED:
                break
            _, exits = slabs(
                cells_at(inside[None], self.resolution)[0], start, toward, self.resolution
            )
            travelled = float(exits[0]) + BEYOND
            if travelled >= max_range:
                end = None
                break
            left = max_range - travelled
            end = super().cast_ray(start + travelled * toward, toward, left, stop_at_unknown)
            if end is not None:
                end = RayEnd(end.state, end.distance + travelled, end.point)
        entries, exits = slabs(self._overlay.claimed, start, toward, self.resolution)
        entries = np.maximum(entries[(entries < exits) & (exits > 0.0)], 0.0)
        nearest = float(entries.min(initial=np.inf))
        if nearest <= max_range and (end is None or nearest < end.distance):
            return RayEnd(OCCUPIED, nearest, start + nearest * toward)
        return end

    def counts(self) -> dict[str, int]:
        """Return the number of free and of occupied cells by the name of their state."""
        counts = super().counts()
        middles = centres(as_set(np.concatenate(self._overlay)), self.resolution)
        static, states = super().state_at(middles), self.state_at(middles)
        for state in (FREE, OCCUPIED):
            more = np.count_nonzero(states == state) - np.count_nonzero(static == state)
            counts[STATE_NAMES[state]] += int(more)
        return counts

    def version(self) -> str:
        """Return the digest of the content, 32 hex digits: equal sweeps and ticks give it again.

        It covers the static evidence, the ever-free space, the dynamic cells, the tracks, and the
        predicted cells.
        """
        whole = hashlib.blake2b(super().version().encode(), digest_size=16)
        whole.update(self._ever_free.digest().to_bytes(16, "little"))
        whole.update(struct.pack("<q", self._period))
        sightings = self._sightings
        times = sightings.since_ns, sightings.hit_ns
        for part in (*self._overlay, sightings.cells, *times, sightings.crossings, sightings.moves):
            whole.update(struct.pack("<q", len(part)))
            whole.update(part.astype("<i8").tobytes())
        tracks = [(track.number, track.sightings) for track in self._traffic.tracks]
        whole.update(json.dumps(tracks).encode())
        return whole.hexdigest()

    def memory_bytes(self) -> int:
        """Return the bytes of the bricks in use, the masks of a sweep and the ever-free space."""
        return super().memory_bytes() + self._ever_free.nbytes

    def dynamic_centres(self) -> NDArray[np.float64]:
        """Return the centres (n, 3) of the cells that moving objects occupy now, m, world."""
        sightings = self._sightings
        left = sightings.crossings >= self.config.dynamic.free_after_misses
        return centres(sightings.cells[sightings.moves & ~left], self.resolution)

    def _lay_over(
        self,
        low_cell: tuple[int, int, int],
        occupied: NDArray[np.uint64],
        free: NDArray[np.uint64],
    ) -> None:
        """Lay vacated and claimed cells over the states of a window of cells."""
        kernels.move_bits(low_cell, self._overlay.vacated, True, occupied, free)
        kernels.move_bits(low_cell, self._overlay.claimed, False, free, occupied)

    def _evidence(self) -> NDArray[np.float64]:
        """Return the evidence of the sighted cells (m,): a sweep that crosses one lowers it."""
        return self.probability_at(centres(self._sightings.cells, self.resolution))

    def _read_free(self, keys: NDArray[np.int64]) -> NDArray[np.uint64]:
        """Return the free cells (k, 256) of bricks (k, 3) by the static evidence."""
        free = np.empty((len(keys), BRICK_SHAPE[0] * BRICK_SHAPE[1]), np.uint64)
        for i, corner in enumerate(brick_cells(keys)):
            free[i] = super().columns(corner, BRICK_SHAPE)[1].reshape(-1)
        return free

    def _learn_free(self, hits: NDArray[np.int64]) -> NDArray[np.int64]:
        """Bring the ever-free space up to date; return the set of its cells (n, 3) that were hit.

        Where one return makes a free cell occupied, the hits (k, 3) come first: what they make
        occupied would be no ever-free space any more, and nothing would ever be seen to move. Where
        it takes more returns, they come after.
        """
        at_once = self.evidence.low + self.evidence.hit > 0
        met = self._met(hits) if at_once else NO_CELLS
        self._follow_evidence(np.concatenate([self._sightings.cells, met]))
        return met if at_once else self._met(hits)

    def _met(self, hits: NDArray[np.int64]) -> NDArray[np.int64]:
        """Record hits (k, 3); return the set of ever-free cells (n, 3) among them."""
        return as_set(hits[self._ever_free.record_hits(hits)])

    def _follow_evidence(self, kept: NDArray[np.int64]) -> None:
        """Take what is not free any more out of the ever-free space, but for the cells kept."""
        boxes, now = super().changed(self._seen)
        keys = brick_of(boxes[:, :3])
        if np.any(boxes[:, 3] - boxes[:, 0] > BRICK_SHAPE[0]):  # all of space
            keys = np.concatenate([brick_of(super().changed(0)[0][:, :3]), self._ever_free.keys()])
        self._ever_free.keep_free(keys, self._read_free(keys), kept)
        self._seen = now

    def _meet(self, met: NDArray[np.int64], crossed: NDArray[np.bool_]) -> Sightings:
        """Take in the ever-free cells (n, 3) that were hit, and which known ones were crossed."""
        known = self._sightings
        places = np.empty(len(met), np.int64)
        kernels.find_indices(known.cells, met, places)
        again, fresh = places[places >= 0], met[places < 0]
        cells = np.concatenate([known.cells, fresh])
        since, hit = (
            np.concatenate([times, np.full(len(fresh), self._now_ns)])
            for times in (known.since_ns, known.hit_ns)
        )
        crossings = np.concatenate([known.crossings + crossed, np.zeros(len(fresh), np.int64)])
        moves = np.concatenate(
            [known.moves, np.full(len(fresh), self.config.dynamic.flag_on_first_hit)]
        )
        hit[again], crossings[again] = self._now_ns, 0
        order = np.lexsort(cells.T[::-1])
        return Sightings(cells, since, hit, crossings, moves).part(order)

    def _retire(self, sightings: Sightings) -> Sightings:
        """Drop sightings that stayed, and those left that are free by the static evidence."""
        left = sightings.crossings >= self.config.dynamic.free_after_misses
        static = super().state_at(centres(sightings.cells, self.resolution))
        age_ns = self._now_ns - sightings.since_ns
        old = age_ns >= round(self.config.dynamic.static_after * 1e9)
        done = (left & (static == FREE)) | (old & ~(left & (static == OCCUPIED)))
        kept, surfaces = sightings.part(~done), sightings.cells[done & (static != FREE)]
        self._ever_free.remove(surfaces, kept.cells)
        return kept

    def _close_period(self) -> None:
        period = self._now_ns // self._period_ns
        if period > self._period:
            self._period = period
            self._ever_free.close_period(self._read_free)

    def _is_loose(self, cells: NDArray[np.int64]) -> bool:
        """Return whether most of the cells (k, 3) lie apart from static surfaces.

        A surface that beams hit here and there for the first time lies beside a known part of it;
        of an object on the floor only the lowest cells are near anything.
        """
        near = (cells[:, None] + AROUND).reshape(-1, 3)
        static = super().state_at(centres(near, self.resolution)) == OCCUPIED
        static &= ~member(self._sightings.cells, near)
        attached = static.reshape(len(cells), -1).any(axis=1)
        return 2 * int(np.count_nonzero(attached)) < len(cells)

    def _predict(self) -> None:
        """Predict the clusters, and log where that changed states of the map."""
        sightings = self._sightings
        left = sightings.crossings >= self.config.dynamic.free_after_misses
        # Without the cells behind an object, which it hides: they would hold its centroid back.
        recent = ~left & (self._now_ns - sightings.hit_ns <= RECENT_NS)
        moving, ahead = self._traffic.follow(sightings.cells[recent], self._now_ns, self._is_loose)
        moves = sightings.moves | member(as_set(moving), sightings.cells)
        self._sightings = sightings = replace(sightings, moves=moves)
        present = sightings.cells[moves & ~left]
        overlay = Overlay(as_set(np.concatenate([present, ahead])), sightings.cells[moves & left])
        changes = [
            part[~member(other, part)]
            for old, new in zip(self._overlay, overlay, strict=True)
            for part, other in ((old, new), (new, old))
        ]
        self._overlay = overlay
        keys = as_set(brick_of(np.concatenate(changes)))
        if len(keys) == 0:
            return
        self._stamp += 1
        self._overlay_changes.note(keys, self._stamp)
