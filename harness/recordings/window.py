"""The part of a recording that is read: between the times that the options choose."""

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
        first_ns: Time of the first sweep, ns since the first pose; None if none was chosen.
        last_ns: Time of the last sweep; None if none was chosen.
    """

    track: RecordedTrack
    start_ns: int
    first_ns: int | None
    last_ns: int | None

    def holds(self, stamp_ns: int) -> bool:
        """Return whether a sweep of this stamp is to be read, be there a pose or not."""
        time = stamp_ns - self.start_ns
        is_before = self.first_ns is not None and time < self.first_ns
        return not is_before and (self.last_ns is None or time <= self.last_ns)

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
    """Return the window that the options choose; from 0 s, the default, it has no begin."""
    first = round(options.start_s * 1e9) if options.start_s != 0.0 else None
    last = None if options.end_s is None else round(options.end_s * 1e9)
    return Window(track, start_ns, first, last)
