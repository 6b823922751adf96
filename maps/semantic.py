"""The semantic layer: votes for classes, cell by cell."""

from __future__ import annotations

import hashlib
import struct

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wayproof.maps.grid import cells_at
from wayproof.maps.kernels import labels as kernels

UNLABELLED = kernels.UNLABELLED
"""The label of a cell without votes, and of a beam that has none."""

MEBIBYTE = 1 << 20
BYTES_IN_CELL = 3 * 8 + 1 + 2 * 4  # its index, its label, and two entries of the directory


class SemanticLayer:
    """Votes for classes in the cells of a map's lattice.

    A labelled point is one vote in its cell, and a cell's label is the class with the most votes;
    of equally many, the least one. Where a sensor mistakes each class for each other equally often,
    that is the class of maximum likelihood. Votes do not decay: the class of an object does not
    depend on when it was seen, and whether it is still there is a matter of the map. Votes of an
    object that takes another's place have to outnumber the old ones first.

    Once the memory is full, votes in cells that have none yet are lost, and counted in `lost`;
    those in known cells still count. A count stays at 2^32 - 1.

    Attributes:
        resolution: Edge of a cell, m; of the same cells as a map's.
        classes: Number of classes; labels are 0 to classes - 1.
        capacity: Number of cells that fit the memory.
        lost: Votes that found no room.
    """

    def __init__(self, resolution: float, classes: int, memory_mib: int = 64) -> None:
        """Make a layer without votes.

        Args:
            resolution: Edge of a cell, m.
            classes: Number of classes.
            memory_mib: Bound on its memory, MiB.

        Raises:
            ValueError: A value is out of its range.
        """
        if not 0.01 <= resolution <= 0.5:
            raise ValueError(f"resolution: got {resolution:g}, expected 0.01 to 0.5 m")
        if not 1 <= classes <= UNLABELLED:
            raise ValueError(f"classes: got {classes}, expected 1 to {UNLABELLED}")
        if not 1 <= memory_mib <= 65536:
            raise ValueError(f"memory_mib: got {memory_mib}, expected 1 to 65536 MiB")
        self.resolution = resolution
        self.classes = classes
        # The directory is a power of two of entries, at least two for each cell.
        size = memory_mib * MEBIBYTE // (BYTES_IN_CELL + 4 * classes)
        buckets = 1 << (2 * size - 1).bit_length()
        self.capacity = (memory_mib * MEBIBYTE - 4 * buckets) // (25 + 4 * classes)
        self.lost = 0
        self._directory = np.full(buckets, -1, np.int32)
        self._cells = np.zeros((self.capacity, 3), np.int64)
        self._votes = np.zeros((self.capacity, classes), np.uint32)
        self._winners = np.full(self.capacity, UNLABELLED, np.uint8)
        self._used = 0
        self._sums = np.zeros(2, np.uint64)
        self._boxes: list[NDArray[np.int64]] = []

    def integrate(self, points: ArrayLike, labels: NDArray[np.uint8]) -> None:
        """Count one vote for each point.

        Args:
            points: (n, 3) m, world.
            labels: (n,) uint8, class of each.

        Raises:
            ValueError: A shape or type differs, a point is not finite and within 1000 km, or a
                label is not one of the classes. No vote is counted then.
        """
        cells = self._cells_of(points)
        if labels.dtype != np.uint8 or labels.shape != (len(cells),):
            raise ValueError(
                f"labels: got {labels.dtype} {labels.shape}, expected uint8 ({len(cells)},)"
            )
        self._check_labels(labels)
        once = np.ones(len(cells), np.uint32)
        self._vote(cells, np.require(labels, None, ["C", "W"]), once)

    def integrate_sweep(
        self,
        origins: ArrayLike,
        directions: NDArray[np.float64],
        ranges_mm: NDArray[np.uint16],
        limits: tuple[float, float],
        labels: NDArray[np.uint8],
        moments: NDArray[np.int32] | None = None,
    ) -> None:
        """Count one vote for each labelled beam that has a return, in the cell that it ends in.

        Args:
            origins: (3,) or (m, 3) where the beams start, m, world.
            directions: (n, 3) unit vectors, world.
            ranges_mm: (n,) measured ranges, mm.
            limits: Nearest and farthest return that counts, m.
            labels: (n,) class of the surface that each beam hit; 255: unknown.
            moments: (n,) index of each beam's origin, if there are several.

        The beams are those of a sweep that a map has integrated: they are not checked again.

        Raises:
            ValueError: The arrays differ in length, or a label is not one of the classes. No vote
                is counted then.
        """
        starts = np.array(origins, np.float64, ndmin=2)
        sources = np.empty(0, np.int32) if moments is None else moments
        count = len(ranges_mm)
        if labels.dtype != np.uint8 or labels.shape != (count,) or len(directions) != count:
            raise ValueError(
                f"labels: got {labels.dtype} {labels.shape} for {len(directions)} directions, "
                f"expected uint8 ({count},)"
            )
        if len(sources) not in (0, count) or sources.max(initial=0) >= len(starts):
            raise ValueError(f"moments: got {sources.shape}, expected ({count},) of the origins")
        self._check_labels(labels[labels != UNLABELLED])
        beams = kernels.LabelledBeams(
            starts,
            np.require(sources, np.int32, ["C", "W"]),
            np.require(directions, np.float64, ["C", "W"]),
            np.require(ranges_mm, np.uint16, ["C", "W"]),
            (round(1000 * limits[0]), round(1000 * limits[1])),
            np.require(labels, None, ["C", "W"]),
            self.resolution,
        )
        cells, classes = np.empty((count, 3), np.int64), np.empty(count, np.uint8)
        counts = np.empty(count, np.uint32)
        count = kernels.list_ballots(beams, kernels.Ballots(cells, classes, counts))
        self._vote(cells[:count], classes[:count], counts[:count])

    def label_at(self, points: ArrayLike) -> NDArray[np.uint8]:
        """Return the labels at points (n, 3), m, world: (n,) uint8; 255 where there are no votes.

        Raises:
            ValueError: The points have another shape, or one is not finite and within 1000 km.
        """
        rows = self._rows_of(points)
        labels: NDArray[np.uint8] = np.where(rows >= 0, self._winners[rows], UNLABELLED)
        return labels.astype(np.uint8)

    def labelled(self, classes: NDArray[np.bool_]) -> tuple[NDArray[np.int64], NDArray[np.uint8]]:
        """Return the cells (k, 3) labelled with any of some classes, and their labels (k,)."""
        labels = self._winners[: self._used]
        rows = np.flatnonzero(classes[labels])
        return self._cells[rows], labels[rows]

    def changed(self, since: int) -> tuple[NDArray[np.int64], int]:
        """Return where labels changed since an earlier call, a box of cells for each sweep.

        Args:
            since: Stamp that an earlier call returned as `now`; 0 for all.

        Returns:
            Boxes of cells (k, 6) as [x0, y0, z0, x1, y1, z1), and `now`.
        """
        return np.array(self._boxes[since:], np.int64).reshape(-1, 6), len(self._boxes)

    def votes_at(self, points: ArrayLike) -> NDArray[np.uint32]:
        """Return the votes at points (n, 3), m, world: (n, classes).

        Raises:
            ValueError: As of `label_at`.
        """
        rows = self._rows_of(points)
        return np.where(rows[:, None] >= 0, self._votes[rows], np.uint32(0))

    def version(self) -> str:
        """Return the digest of the content, 32 hex digits: equal votes give the same one.

        Each vote adds 128 bits, made of its cell and its class, to a sum that is kept up to date,
        as in an incremental hash of a multiset (Clarke et al. 2003, MSet-Add-Hash).
        """
        head = struct.pack("<dq", self.resolution, self.classes)
        sums = self._sums.astype("<u8").tobytes()
        return hashlib.blake2b(head + sums, digest_size=16).hexdigest()

    def memory_bytes(self) -> int:
        """Return the reserved bytes; the system commits most of them as cells are first used."""
        held = self._directory, self._cells, self._votes, self._winners
        return sum(part.nbytes for part in held)

    def _vote(
        self, cells: NDArray[np.int64], labels: NDArray[np.uint8], counts: NDArray[np.uint32]
    ) -> None:
        box = np.array([[1 << 62] * 3, [-(1 << 62)] * 3])
        table = kernels.VoteTable(self._directory, self._cells, self._votes, self._winners)
        ballots = kernels.Ballots(cells, labels, counts)
        self._used, lost = kernels.count_votes(table, self._used, ballots, self._sums, box)
        self.lost += lost
        if box[0, 0] <= box[1, 0]:
            self._boxes.append(np.concatenate([box[0], box[1] + 1]))

    def _check_labels(self, labels: NDArray[np.uint8]) -> None:
        if labels.max(initial=0) >= self.classes:
            raise ValueError(
                f"labels: got {labels.max()}, expected 0 to {self.classes - 1}: one of the classes"
            )

    def _rows_of(self, points: ArrayLike) -> NDArray[np.int64]:
        cells = self._cells_of(points)
        rows = np.empty(len(cells), np.int64)
        kernels.look_up(self._directory, self._cells, cells, rows)
        return rows

    def _cells_of(self, points: ArrayLike) -> NDArray[np.int64]:
        places = np.asarray(points, np.float64)
        if places.ndim != 2 or places.shape[1] != 3:
            raise ValueError(f"points: got shape {places.shape}, expected (n, 3)")
        cells, inside = cells_at(places, self.resolution)
        if not inside.all():
            raise ValueError(
                f"points: got {places[~inside][0].tolist()}, "
                "expected finite coordinates within 1e6 m"
            )
        return cells
