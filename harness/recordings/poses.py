"""Poses of a recording checked, put in order, and made a track."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayproof.harness.errors import InputError
from wayproof.harness.recordings.options import Faults, RecordingOptions
from wayproof.harness.recordings.order import in_order
from wayproof.harness.recordings.track import RecordedTrack

MAX_COORDINATE = 1e5
"""Maximum distance from the origin along an axis, m: that of the inputs of a decision."""

UNIT_EXACT, UNIT_CLOSE = 1e-14, 0.1
"""Squared length of a quaternion less 1: up to the first it is kept bit by bit, up to the second it
is scaled to unit length; beyond it is no orientation."""

RESET = "pose: jump of the estimator"
"""Fault of poses whose estimator says that it has moved them at once."""


class StampedPoses(NamedTuple):
    """Poses as they were read.

    Attributes:
        stamps_ns: (n,) int64, ns of the recording's clock.
        positions: (n, 3) m.
        quaternions: (n, 4) w x y z.
    """

    stamps_ns: NDArray[np.int64]
    positions: NDArray[np.float64]
    quaternions: NDArray[np.float64]

    def at(self, places: NDArray[np.int64] | NDArray[np.bool_]) -> StampedPoses:
        """Return those at places (k,), or of a mask (n,)."""
        return StampedPoses(
            self.stamps_ns[places], self.positions[places], self.quaternions[places]
        )


def sound(poses: StampedPoses, faults: Faults, what: str = "pose") -> StampedPoses:
    """Return the poses that are finite and within bounds, in order of their stamps.

    Quaternions off unit length are normalised and counted; those far off are left out, and
    counted, with those that are not finite. Faults are counted as those of `what`.
    """
    with np.errstate(over="ignore", invalid="ignore"):
        squares = (poses.quaternions * poses.quaternions).sum(axis=1)
    near = np.abs(poses.positions).max(axis=1, initial=0.0) <= MAX_COORDINATE  # false for NaN
    finite = np.isfinite(poses.positions).all(axis=1) & np.isfinite(squares)
    unit = np.abs(squares - 1.0) <= UNIT_CLOSE  # false for NaN
    faults[f"{what}: not finite"] += int((~finite).sum())
    faults[f"{what}: beyond {MAX_COORDINATE:g} m"] += int((finite & ~near).sum())
    faults[f"{what}: quaternion far from unit length"] += int((finite & near & ~unit).sum())
    kept = poses.at(finite & near & unit)
    squares = squares[finite & near & unit]
    rough = np.abs(squares - 1.0) > 1e-6
    faults[f"{what}: quaternion normalised"] += int(rough.sum())
    inexact = np.abs(squares - 1.0) > UNIT_EXACT
    scaled = kept.quaternions.copy()
    scaled[inexact] /= np.sqrt(squares[inexact])[:, None]
    places = in_order(kept.stamps_ns)
    repeated = int((np.diff(kept.stamps_ns) == 0).sum())
    faults[f"{what}: repeated stamp"] += repeated
    faults[f"{what}: stamp out of order"] += max(len(kept.stamps_ns) - len(places) - repeated, 0)
    return kept._replace(quaternions=scaled).at(places)


def track_of(
    poses: StampedPoses, source: str, options: RecordingOptions, faults: Faults
) -> tuple[RecordedTrack, int]:
    """Make a track of poses, and return it with the stamp of its first, ns.

    Raises:
        InputError: No pose is sound.
    """
    good = sound(poses, faults)
    if len(good.stamps_ns) == 0:
        raise InputError(f"no pose of {len(poses.stamps_ns)} from {source} can be used")
    start = int(good.stamps_ns[0])
    if int(good.stamps_ns[-1]) - start >= 2**62:
        raise InputError(f"stamps of {source} span over 100 years")
    max_gap_ns = round(options.max_gap * 1e9)
    times = good.stamps_ns - start
    faults[f"pose: gap of more than {options.max_gap:g} s"] += int(
        (np.diff(times) > max_gap_ns).sum()
    )
    track = RecordedTrack(times, good.positions, good.quaternions, source, max_gap_ns)
    return track, start
