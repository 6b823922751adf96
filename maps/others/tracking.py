"""Tracking and prediction of moving objects: clusters of cells, matched from sweep to sweep."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import pairwise, product

import numpy as np
from numpy.typing import NDArray

from wayproof.maps.kernels import tracking as kernels

POINT_BITS = 10  # positions are in 1/1024 of a cell
POINTS = 1 << POINT_BITS
SECOND_NS = 1_000_000_000

MIN_CELLS = 3
"""Minimum number of cells of a cluster whose motion is predicted: fewer may be noise."""

MAX_EXTENT = 4.0
"""Maximum extent of a moving object, m: a longer one is a wall seen with an error of the pose."""

TOP_SPEED = 5.0
"""Maximum speed of an object, m/s, which bounds the matching: a running person, a forklift."""

MEMORY_NS = SECOND_NS // 2
"""Time over which a velocity is measured, and after which an unseen object is forgotten, ns."""

MIN_SIGHTINGS = 3
MIN_TRAVEL = 2 * POINTS
"""A centroid that came less far may be at rest: as more of a surface comes into view, it wanders.

Slower things than these do not leave their cells within a horizon of 0.2 s either.
"""

NO_CELLS = np.empty((0, 3), np.int64)

Point = tuple[int, int, int]
IsLoose = Callable[[NDArray[np.int64]], bool]


@dataclass(frozen=True)
class Track:
    """One moving object.

    Attributes:
        number: Number of the thing; things are numbered as they appear.
        sightings: Time, ns, and centroid, in 1/1024 of a cell, of each of the last sweeps.
    """

    number: int
    sightings: tuple[tuple[int, Point], ...]

    def shift(self, duration_ns: int) -> Point:
        """Return its displacement in a time at its mean velocity, in 1/1024 of a cell."""
        (start_ns, start), (end_ns, end) = self.sightings[0], self.sightings[-1]
        if start_ns == end_ns:
            return 0, 0, 0
        x, y, z = (
            (b - a) * duration_ns // (end_ns - start_ns) for a, b in zip(start, end, strict=True)
        )
        return x, y, z

    def at(self, time_ns: int) -> Point:
        """Predict its position at a time by a constant velocity."""
        end_ns, (x, y, z) = self.sightings[-1]
        dx, dy, dz = self.shift(time_ns - end_ns)
        return x + dx, y + dy, z + dz

    @property
    def moves(self) -> bool:
        """Whether it went somewhere: far enough, and not to and fro."""
        points = [centroid for _, centroid in self.sightings]
        travel = _apart(points[0], points[-1])
        steps = sum(_apart(a, b) for a, b in pairwise(points))
        return len(points) >= MIN_SIGHTINGS and travel >= MIN_TRAVEL and steps <= 2 * travel

    def seen(self, time_ns: int, centroid: Point) -> Track:
        """Add a sighting to the track; a second one at the same time replaces the first."""
        recent = [s for s in self.sightings if time_ns - MEMORY_NS <= s[0] < time_ns]
        return Track(self.number, (*recent, (time_ns, centroid)))


@dataclass
class Traffic:
    """The objects that move now.

    They are matched by place alone, nearest first, within what `TOP_SPEED` allows. All arithmetic
    is in whole numbers, so that it is the same everywhere.

    Attributes:
        resolution: Edge of a cell, m.
        horizon_ns: Time for which motion is predicted, ns.
        tracks: Tracks in the order of their numbers.
    """

    resolution: float
    horizon_ns: int
    tracks: tuple[Track, ...] = ()
    _next: int = field(default=0, repr=False)

    def follow(
        self, cells: NDArray[np.int64], time_ns: int, is_loose: IsLoose = lambda _: True
    ) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Match the cells that objects occupy now, and predict those that move.

        Args:
            cells: (m, 3) a set, in lexical order.
            time_ns: Simulated time, not before that of the last call, ns.
            is_loose: Whether a cluster (k, 3) stands apart from static surfaces.

        Returns:
            The cells (k, 3) of clusters that move, and the cells (n, 3) on their way up to the
            horizon; some may be repeated.
        """
        clusters = clusters_of(cells)
        centroids = [_centroid(cluster) for cluster in clusters]
        matched = self._match(centroids, time_ns)
        tracks = []
        for i, centroid in enumerate(centroids):
            if i not in matched:
                matched[i] = Track(self._next, ())
                self._next += 1
            matched[i] = matched[i].seen(time_ns, centroid)
            tracks.append(matched[i])
        met = {track.number for track in tracks}
        lost = [t for t in self.tracks if t.number not in met]
        waiting = [t for t in lost if time_ns - t.sightings[-1][0] <= MEMORY_NS]
        self.tracks = tuple(sorted([*tracks, *waiting], key=lambda track: track.number))
        longest = MAX_EXTENT / self.resolution
        moving, ways = [NO_CELLS], [NO_CELLS]
        for i, cluster in enumerate(clusters):
            small = np.ptp(cluster, axis=0).max() < longest
            likely = matched[i].moves and len(cluster) >= MIN_CELLS and small
            if likely and is_loose(cluster):
                moving.append(cluster)
                ways.append(way_ahead(cluster, matched[i].shift(self.horizon_ns)))
        return np.concatenate(moving), np.concatenate(ways)

    def _match(self, centroids: list[Point], time_ns: int) -> dict[int, Track]:
        """Assign tracks to clusters: nearest pairs first, then by number."""
        pairs = []
        for track, (i, centroid) in product(self.tracks, enumerate(centroids)):
            # A cell more, for the steps in which a surface comes into view.
            age = (time_ns - track.sightings[-1][0]) / SECOND_NS
            gate = int((TOP_SPEED * age / self.resolution + 1.0) * POINTS)
            apart = _squared(track.at(time_ns), centroid)
            if apart <= gate * gate:
                pairs.append((apart, track.number, i, track))
        matched: dict[int, Track] = {}
        taken: set[int] = set()
        for _, number, i, track in sorted(pairs, key=lambda pair: pair[:3]):
            if number not in taken and i not in matched:
                taken.add(number)
                matched[i] = track
        return matched


def clusters_of(cells: NDArray[np.int64]) -> list[NDArray[np.int64]]:
    """Return the connected components of cells (m, 3), in the order of their least cells."""
    labels = np.empty(len(cells), np.int64)
    parts = kernels.label_components(cells, labels)
    return [cells[labels == part] for part in range(parts)]


def way_ahead(cells: NDArray[np.int64], shift: Point) -> NDArray[np.int64]:
    """Return the cells that a cluster (m, 3) sweeps on its way: one copy for each cell of it."""
    steps = -(-max(abs(d) for d in shift) // POINTS)
    copies = [
        cells + np.array([(2 * d * k + steps * POINTS) // (2 * steps * POINTS) for d in shift])
        for k in range(1, steps + 1)
    ]
    return np.concatenate([np.empty((0, 3), np.int64), *copies])


def _centroid(cells: NDArray[np.int64]) -> Point:
    x, y, z = (cells.sum(axis=0) * POINTS // len(cells)).tolist()
    return x, y, z


def _squared(a: Point, b: Point) -> int:
    return sum((i - j) * (i - j) for i, j in zip(a, b, strict=True))


def _apart(a: Point, b: Point) -> int:
    return sum(abs(i - j) for i, j in zip(a, b, strict=True))
