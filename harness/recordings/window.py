"""The part of a recording that is read: where there is a pose, and between two times."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wayproof.harness.recordings.recording import Faults, RecordingOptions
from wayproof.harness.recordings.track import RecordedTrack

NO_POSE = "sweep: no pose at its time"
NO_BEAM = "sweep: nothing measured"
OUT_OF_ORDER = "sweep: stamp out of order"


@dataclass(frozen=True)
class Window:
    """Times of a recording that are read.

    Attributes:
        track: Poses.
        start_ns: Stamp of the first pose, ns.
        first_ns: Time of the first sweep, ns since the first pose.
        last_ns: Time of the last sweep.
    """

    track: RecordedTrack
    start_ns: int
    first_ns: int
    last_ns: int

    def holds(self, stamp_ns: int) -> bool:
        """Return whether a sweep of this stamp is to be read."""
        return self.first_ns <= stamp_ns - self.start_ns <= self.last_ns

    def has_pose(
        self, stamp_ns: int, beam_times_ns: NDArray[np.int64] | None, faults: Faults
    ) -> bool:
        """Return whether there are poses for all beams of a sweep; count it if not."""
        time = stamp_ns - self.start_ns
        ends = [time]
        if beam_times_ns is not None and len(beam_times_ns):
            ends += [time + int(beam_times_ns.min()), time + int(beam_times_ns.max())]
        if all(abs(end) < 2**62 for end in ends):
            if self.track.covers(np.array(ends, np.int64)).all():
                return True
        faults[NO_POSE] += 1
        return False


def window_of(track: RecordedTrack, start_ns: int, options: RecordingOptions) -> Window:
    """Return the window that the options choose."""
    last = int(track.times_ns[-1]) if options.end_s is None else round(options.end_s * 1e9)
    return Window(track, start_ns, round(options.start_s * 1e9), last)
