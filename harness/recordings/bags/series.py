"""Numbers of the messages of a bag, kept in the order of the file by its first pass."""

from __future__ import annotations

from array import array
from bisect import bisect_left
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from wayproof.harness.recordings.bags.parts import StampedTransform
from wayproof.harness.recordings.poses import StampedPoses


@dataclass
class Series:
    """Messages of one stream.

    Attributes:
        places: Their places in the file.
        stamps: Stamps, ns.
        numbers: `width` for each: of a pose its position and quaternion, of a sweep the time at
            which it was recorded, ns, and its bytes.
        width: See `numbers`.
    """

    numbers: array[float] | array[int]
    width: int
    places: array[int] = field(default_factory=lambda: array("q"))
    stamps: array[int] = field(default_factory=lambda: array("q"))

    @classmethod
    def of_poses(cls) -> Series:
        """Return one for poses."""
        return cls(array("d"), 7)

    @classmethod
    def of_sweeps(cls) -> Series:
        """Return one for sweeps."""
        return cls(array("q"), 2)

    def add(self, place: int, stamp_ns: int, *numbers: float) -> None:
        """Take up a message."""
        self.places.append(place)
        self.stamps.append(stamp_ns)
        self.numbers.extend(numbers)  # type: ignore[arg-type]  # integers for those of sweeps

    def add_pose(self, place: int, pose: StampedTransform) -> None:
        """Take up the pose of a message."""
        self.add(place, pose.stamp_ns, *pose.numbers)

    def between(self, first: int, last: int) -> Series:
        """Return those of messages at places in the file from the first up to, not with, a last."""
        part = slice(self.before(first), self.before(last))
        rows = slice(self.width * part.start, self.width * part.stop)
        return Series(self.numbers[rows], self.width, self.places[part], self.stamps[part])

    def before(self, place: int) -> int:
        """Return the number of messages before a place in the file."""
        return bisect_left(self.places, place)

    @property
    def times(self) -> NDArray[np.int64]:  # (n,)
        """Stamps; where no sweep has one, the times at which they were recorded, ns."""
        stamps = np.array(self.stamps, np.int64)
        return stamps if self.width != 2 or stamps.any() else self.table[:, 0].astype(np.int64)

    @property
    def table(self) -> NDArray[np.float64] | NDArray[np.int64]:  # (n, width)
        """The numbers."""
        return np.array(self.numbers, self.numbers.typecode).reshape(-1, self.width)

    @property
    def poses(self) -> StampedPoses:
        """The poses."""
        rows = self.table.astype(np.float64)
        return StampedPoses(self.times, rows[:, :3], rows[:, 3:])
