"""A recording that is open for reading: its sensors, its track, and its sweeps in order of time."""

from __future__ import annotations

import hashlib
import heapq
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayproof.harness.mission import Mission
from wayproof.harness.recordings.beams import Beams, float32, from_first_beam
from wayproof.harness.recordings.options import Broken, Faults, RecordingOptions, unreadable
from wayproof.harness.recordings.order import nearly_sorted, order_of
from wayproof.harness.recordings.poses import StampedPoses, track_of
from wayproof.harness.recordings.track import RecordedTrack
from wayproof.harness.recordings.transform import IDENTITY, Transform
from wayproof.harness.recordings.types import OwnMap, RecordedSensor, RecordedSweep, SensorKind
from wayproof.harness.schema import wayproof_pb2 as pb

NO_POSE = "sweep: no pose at its time"
NO_BEAM = "sweep: nothing measured"
NO_MOUNT = "sweep: no transform at its time"
OUT_OF_ORDER = "sweep: stamp out of order"


class Stream(NamedTuple):
    """The sweeps of one sensor, still encoded, in the order of their file.

    Attributes:
        sensor: The sensor.
        stamps: (n,) of the recording's clock, ns.
        payloads: Reads them one by one, as often as it is called.
        read: Beams of one; raises `Broken` if it cannot be read.
        mount: T_body_sensor, or its value by stamps, ns; None where it is not known.
        sizes: (n,) bytes; None if they do not matter.
    """

    sensor: RecordedSensor
    stamps: NDArray[np.int64]
    payloads: Callable[[], Iterator[Any]]
    read: Callable[[Any, Faults], Beams]
    mount: Transform | Callable[[int], Transform | None] = IDENTITY
    sizes: NDArray[np.int64] | None = None


@dataclass(frozen=True)
class Recording:
    """Sensors and track of a recording, and its sweeps.

    Attributes:
        name: Name of the file or folder.
        format: Name of its format.
        sha256: Hash of the bytes of all files that are read, hexadecimal.
        start_ns: Stamp of the first pose, ns since the epoch of the recording's clock.
        streams: Sweeps of each sensor.
        track: Poses of the body.
        chosen: The topics and frames that were chosen, in words.
        opening: Faults met while the recording was opened.
        options: Options that it was opened with.
        begin_ns: Time of the first sweep that is read, ns since the first pose; None of all.
        body_height: Height of the body's origin above the floor at the first pose, m; None where
            the recording does not say.
        mission: Mission of the episode that was recorded, in its world frame, which is the
            recording's; None where the recording does not say.
        own_maps: Maps that the robot itself had, in order of time.
    """

    name: str
    format: str
    sha256: str
    start_ns: int
    streams: tuple[Stream, ...]
    track: RecordedTrack
    chosen: str
    opening: Faults
    options: RecordingOptions
    begin_ns: int | None = None
    body_height: float | None = None
    mission: Mission | None = None
    own_maps: tuple[OwnMap, ...] = ()
    _met: Faults = field(default_factory=Counter, init=False)

    @property
    def sensors(self) -> tuple[RecordedSensor, ...]:
        """Sensors in the order of their names, or of an episode's sensors."""
        return tuple(stream.sensor for stream in self.streams)

    def sweeps(self) -> Iterator[RecordedSweep]:
        """Yield the sweeps in order of time, then of sensors' names; few are in memory at a time.

        Raises:
            InputError: The recording is damaged from some place on.
        """
        self._met.clear()
        each = [self._of_stream(one) for one in self.streams]
        yield from heapq.merge(*each, key=lambda sweep: (sweep.time_ns, sweep.sensor))

    @property
    def faults(self) -> dict[str, int]:
        """Faults by kind: those of the opening, and those of the sweeps read so far."""
        return dict(sorted((self.opening + self._met).items()))

    def _of_stream(self, stream: Stream) -> Iterator[RecordedSweep]:
        """Yield the sweeps of a sensor, each from its first beam on; count what is left out."""
        faults = self._met
        for stamp, payload in self._in_order(stream):
            if not self._has_pose(stamp, None):
                continue
            try:
                beams = stream.read(payload, faults)
            except Broken as error:
                faults[unreadable(faults, error)] += 1
                continue
            mount = stream.mount(stamp) if callable(stream.mount) else stream.mount
            # An episode's first sweep began before its first pose: the body stood there.
            times = None if beams.measured is not None else beams.times_ns
            if mount is None:
                faults[NO_MOUNT] += 1
                continue
            if not self._has_pose(stamp, times):
                continue
            if not len(beams.ranges):
                faults[NO_BEAM] += 1
                continue
            early, times = from_first_beam(beams)
            yield RecordedSweep(
                time_ns=stamp - self.start_ns + early,
                sensor=stream.sensor.name,
                directions=beams.directions,
                ranges=beams.ranges,
                beam_times_ns=times,
                T_body_sensor=mount,
                grid=beams.grid,
                points=beams.points,
                measured=beams.measured,
            )

    def _in_order(self, stream: Stream) -> Iterator[tuple[int, Any]]:
        """Yield stamp and payload of the sweeps between the times chosen, in order of time."""
        sizes = np.zeros(len(stream.stamps), np.int64) if stream.sizes is None else stream.sizes
        order = order_of(stream.stamps, sizes)
        items = (
            (stamp, size, (place, payload))
            for place, (stamp, size, payload) in enumerate(
                zip(stream.stamps.tolist(), sizes.tolist(), stream.payloads(), strict=False)
            )
        )
        begin = -(2**63) if self.begin_ns is None else self.begin_ns
        end = 2**63 if self.options.end is None else round(self.options.end * 1e9)
        for stamp, _, (place, payload) in items if order.is_sorted else nearly_sorted(items):
            if not begin <= stamp - self.start_ns <= end:
                continue
            if order.kept[place]:
                yield stamp, payload
            else:
                self._met[OUT_OF_ORDER] += 1

    def _has_pose(self, stamp_ns: int, beam_times_ns: NDArray[np.int64] | None) -> bool:
        """Return whether there are poses for all beams of a sweep; count it if not."""
        time = stamp_ns - self.start_ns
        ends = [time]
        if beam_times_ns is not None and len(beam_times_ns):
            ends += [time + int(beam_times_ns.min()), time + int(beam_times_ns.max())]
        if all(abs(end) < 2**62 for end in ends):
            if self.track.covers(np.array(ends, np.int64)).all():
                return True
        self._met[NO_POSE] += 1
        return False


class Format(NamedTuple):
    """A format of recordings.

    Attributes:
        help: The format in a few words.
        matches: Whether a path looks like it. Never raises for a path that exists.
        open: Opens a recording.
        without: Options that have no meaning for it.
    """

    help: str
    matches: Callable[[Path], bool]
    open: Callable[[Path, RecordingOptions], Recording]
    without: tuple[str, ...] = ()


def recording_of(
    path: Path,
    format: str,
    files: Sequence[Path],
    streams: Sequence[Stream],
    poses: StampedPoses,
    source: str,
    options: RecordingOptions,
    faults: Faults,
    chosen: str | None = None,
) -> Recording:
    """Make a recording of what a format's reader found.

    Args:
        path: Path of it.
        format: Name of the format.
        files: All files that are read.
        streams: Sweeps of each sensor.
        poses: T_world_body.
        source: Where they come from, in words.
        options: Options that it was opened with.
        faults: Those met so far.
        chosen: What was chosen, in words; by default the sensors.

    Raises:
        InputError: No pose is sound.
    """
    track, start = track_of(poses, source, options, faults)
    named = chosen or ", ".join(stream.sensor.name for stream in streams)
    return Recording(
        name=path.resolve().name,
        format=format,
        sha256=digest_of(files),
        start_ns=start,
        streams=tuple(streams),
        track=track,
        chosen=f"{named}; poses: {source}",
        opening=faults,
        options=options,
        begin_ns=round(options.begin * 1e9) if options.begin != 0.0 else None,
    )


def sensor_of(
    name: str,
    kind: SensorKind,
    options: RecordingOptions,
    *,
    frame: str = "",
    ranges: tuple[float, float] = (0.0, np.inf),
    silence_known: bool = False,
    declared: pb.SensorInfo | None = None,
    mount_is_fixed: bool = True,
) -> RecordedSensor:
    """Return a sensor whose limits the options may change; `RecordedSensor` has the arguments."""
    free = options.no_return_is_free
    return RecordedSensor(
        name=name,
        frame=frame or name,
        kind=kind,
        range_min=ranges[0],
        range_max=float32(min(ranges[1], options.range_max or np.inf)),
        missing_returns_known=silence_known if free is None else free,
        declared=declared,
        mount_is_fixed=mount_is_fixed,
    )


def digest_of(files: Sequence[Path]) -> str:
    """Return the SHA-256 of a file, or of the names and contents of several, hexadecimal.

    The hash of one file is the one that `sha256sum` prints. Of several, each is hashed, and then
    the lines of `sha256sum`: hash, two spaces, name.
    """
    digests = []
    for path in files:
        with path.open("rb") as file:
            digests.append(hashlib.file_digest(file, "sha256").hexdigest())
    if len(files) == 1:
        return digests[0]
    lines = [f"{digest}  {path.name}\n" for digest, path in zip(digests, files, strict=True)]
    return hashlib.sha256("".join(lines).encode("utf-8", "surrogateescape")).hexdigest()
