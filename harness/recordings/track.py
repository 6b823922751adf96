"""Track of a recorded robot: poses in time, and those between them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wayproof.maps.elementary import arc_tangent, sines_cosines

LEAST_SINE = 1e-6
"""Sine of the half angle between two poses below which turning at constant speed is linear."""


@dataclass(frozen=True)
class RecordedTrack:
    """Poses T_world_body in order of time.

    Attributes:
        times_ns: (n,) int64 strictly increasing, ns since the first.
        positions: (n, 3) m.
        quaternions: (n, 4) w x y z, unit length.
        source: Topic, frames or file that the poses come from.
        max_gap_ns: Maximum time between two poses between which one is interpolated, ns.
    """

    times_ns: NDArray[np.int64]
    positions: NDArray[np.float64]
    quaternions: NDArray[np.float64]
    source: str
    max_gap_ns: int

    def __post_init__(self) -> None:
        """Refuse tracks without a pose, of unequal arrays, or that do not advance."""
        count = len(self.times_ns)
        shapes = self.positions.shape, self.quaternions.shape
        if count == 0 or shapes != ((count, 3), (count, 4)):
            raise ValueError(f"track: got shapes {shapes}, expected (n, 3) and (n, 4), n >= 1")
        if not (np.diff(self.times_ns) > 0).all():
            raise ValueError("track: got times that do not increase strictly")

    def covers(self, times_ns: NDArray[np.int64]) -> NDArray[np.bool_]:
        """Return whether there is a pose at each time (m,): at a sample, or between close ones."""
        late = np.searchsorted(self.times_ns, times_ns)
        inside = late < len(self.times_ns)
        late = np.minimum(late, len(self.times_ns) - 1)
        exact = inside & (self.times_ns[late] == times_ns)
        early = np.maximum(late - 1, 0)
        close = self.times_ns[late] - self.times_ns[early] <= self.max_gap_ns
        between = inside & (self.times_ns[early] < times_ns) & close
        covered: NDArray[np.bool_] = exact | between
        return covered

    def has_gap(self, begin_ns: int, end_ns: int) -> bool:
        """Return whether two poses that are too far apart lie around some time of an interval."""
        first = max(int(np.searchsorted(self.times_ns, begin_ns, side="right")) - 1, 0)
        last = int(np.searchsorted(self.times_ns, end_ns))
        return bool((np.diff(self.times_ns[first : last + 1]) > self.max_gap_ns).any())

    def at(
        self, times_ns: NDArray[np.int64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:  # (m, 3), (m, 4)
        """Return positions and quaternions at times (m,), ns.

        Positions are interpolated linearly, orientations at constant angular speed (slerp:
        Shoemake, "Animating rotation with quaternion curves", 1985). At a sample it is the sample,
        bit by bit. Only times that the track `covers` have a meaning.
        """
        last = len(self.times_ns) - 1
        late = np.minimum(np.searchsorted(self.times_ns, times_ns), last)
        early = np.maximum(late - 1, 0)
        span = np.maximum(self.times_ns[late] - self.times_ns[early], 1)
        share = np.clip((times_ns - self.times_ns[early]) / span, 0.0, 1.0)
        exact = (self.times_ns[late] == times_ns) | (early == late)
        first, second = self.positions[early], self.positions[late]
        positions = first + share[:, None] * (second - first)
        quaternions = slerp(self.quaternions[early], self.quaternions[late], share)
        positions[exact] = self.positions[late[exact]]
        quaternions[exact] = self.quaternions[late[exact]]
        return positions, quaternions


def slerp(
    first: NDArray[np.float64], second: NDArray[np.float64], share: NDArray[np.float64]
) -> NDArray[np.float64]:  # (m, 4)
    """Interpolate between quaternions (m, 4) at constant angular speed, the short way round."""
    cosines = (first * second).sum(axis=1)
    second = np.where(cosines[:, None] < 0.0, -second, second)
    chord = second - np.abs(cosines)[:, None] * first
    sines = np.sqrt((chord * chord).sum(axis=1))
    angles = np.array([arc_tangent(s, abs(c)) for s, c in zip(sines, cosines, strict=True)])
    turned, _ = sines_cosines(np.concatenate([(1.0 - share) * angles, share * angles]))
    count = len(share)
    small = sines < LEAST_SINE
    divisor = np.where(small, 1.0, sines)
    of_first = np.where(small, 1.0 - share, turned[:count] / divisor)
    of_second = np.where(small, share, turned[count:] / divisor)
    between = of_first[:, None] * first + of_second[:, None] * second
    normalised: NDArray[np.float64] = between / np.sqrt((between * between).sum(axis=1))[:, None]
    return normalised
