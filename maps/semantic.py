"""What things are: votes for classes, cell by cell."""

from __future__ import annotations

import hashlib
import struct

import numpy as np
from numpy.typing import ArrayLike, NDArray

from maps import _label_kernels as kernels
from maps.grid import cells_at

UNLABELLED = 255
"""The label of a cell without votes."""

MEBIBYTE = 1 << 20
BYTES_IN_CELL = 3 * 8 + 2 * 4  # its index, and two entries of the directory


class SemanticLayer:
    """Votes for classes in the cells of a map's lattice.

    A labelled point is one vote in its cell, and a cell's label is the class with the most votes;
    of equally many, the least one. Where a sensor mistakes each class for each other equally often,
    that is the class of maximum likelihood. Votes do not fade: what a thing is does not depend on
    when it was seen, and whether it is still there is for the map to say. After something else has
    taken a place, its votes have to outnumber the old ones first.

    Once the memory is full, votes in cells that have none yet are lost, and counted in `lost`;
    those in known cells still count. A count stays at 2^32 - 1.

    It stands for itself: the sweeps that an episode logs hold ranges and no classes, so no robot
    makes one.

    Attributes:
        resolution: Edge of a cell, m; of the same cells as a map's.
        classes: Number of classes; labels are 0 to classes - 1.
        capacity: Number of cells that fit the memory.
        lost: Votes that found no room.
    """

    def __init__(self, resolution: float, classes: int, memory_mib: int = 64) -> None:
        """Make one without votes.

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
        self.capacity = (memory_mib * MEBIBYTE - 4 * buckets) // (24 + 4 * classes)
        self.lost = 0
        self._directory = np.full(buckets, -1, np.int32)
        self._cells = np.zeros((self.capacity, 3), np.int64)
        self._votes = np.zeros((self.capacity, classes), np.uint32)
        self._used = 0

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
        if len(labels) and labels.max() >= self.classes:
            raise ValueError(
                f"labels: got {labels.max()}, expected 0 to {self.classes - 1}: one of the classes"
            )
        self._used, lost = kernels.vote(
            self._directory,
            self._cells,
            self._votes,
            self._used,
            cells,
            np.require(labels, None, ["C", "W"]),
        )
        self.lost += lost

    def label_at(self, points: ArrayLike) -> NDArray[np.uint8]:
        """The labels at points (n, 3), m, world: (n,) uint8; 255 where there are no votes.

        Raises:
            ValueError: The points have another shape, or one is not finite and within 1000 km.
        """
        votes = self.votes_at(points)
        best = votes.argmax(axis=1).astype(np.uint8)  # the first of equal ones
        labels: NDArray[np.uint8] = np.where(votes.any(axis=1), best, UNLABELLED).astype(np.uint8)
        return labels

    def votes_at(self, points: ArrayLike) -> NDArray[np.uint32]:
        """The votes at points (n, 3), m, world: (n, classes).

        Raises:
            ValueError: As of `label_at`.
        """
        cells = self._cells_of(points)
        rows = np.empty(len(cells), np.int64)
        kernels.look_up(self._directory, self._cells, cells, rows)
        return np.where(rows[:, None] >= 0, self._votes[rows], np.uint32(0))

    def version(self) -> str:
        """Digest of the content, 32 hex digits: equal votes give the same one."""
        cells, votes = self._cells[: self._used], self._votes[: self._used]
        order = np.lexsort(cells.T[::-1])
        whole = hashlib.blake2b(struct.pack("<dq", self.resolution, self.classes), digest_size=16)
        whole.update(cells[order].astype("<i8").tobytes())
        whole.update(votes[order].astype("<u4").tobytes())
        return whole.hexdigest()

    def memory_bytes(self) -> int:
        """Bytes that are reserved; the system gives most of them only as cells are first used."""
        return self._directory.nbytes + self._cells.nbytes + self._votes.nbytes

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
