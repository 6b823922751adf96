"""Recordings that are folders: a file for each sweep, read one by one."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from wayproof.harness.errors import InputError
from wayproof.harness.recordings.beams import FARTHEST, Beams, Limits, float32
from wayproof.harness.recordings.digest import digest_of
from wayproof.harness.recordings.matrices import of_body
from wayproof.harness.recordings.order import in_order
from wayproof.harness.recordings.poses import StampedPoses, compose, track_of
from wayproof.harness.recordings.recording import Faults, Recording, RecordingOptions
from wayproof.harness.recordings.types import (
    RecordedSensor,
    RecordedSweep,
    SensorKind,
    Transform,
)
from wayproof.harness.recordings.window import NO_BEAM, OUT_OF_ORDER, Window, window_of

UNREADABLE = "file: cannot be read"

MOST_SWEEPS = 1_000_000


class Unreadable(Exception):
    """A file of a recording cannot be read."""


class SweepFile(NamedTuple):
    """A file with one sweep, and its stamp, ns."""

    stamp_ns: int
    path: Path


ReadBeams = Callable[[Path, Limits, Faults], Beams]
"""Reads the beams of a file; raises `Unreadable` if it cannot."""


@dataclass(frozen=True)
class FolderContents:
    """Contents of a folder.

    Attributes:
        format: Name of the format.
        sensor: Name of the sensor.
        kind: Kind of the sensor.
        files: Sweeps, in order of their stamps.
        poses: T_world_body.
        mount: T_body_sensor.
        source: Source of the poses, in words.
        chosen: Further choices and assumptions, in words.
        others: Further files that were read.
        read: Reader of a sweep's file.
    """

    format: str
    sensor: str
    kind: SensorKind
    files: Sequence[SweepFile]
    poses: StampedPoses
    mount: Transform
    source: str
    chosen: str
    others: Sequence[Path]
    read: ReadBeams


def open_folder(
    path: Path, contents: FolderContents, options: RecordingOptions, faults: Faults
) -> Recording:
    """Open a folder as a recording.

    Raises:
        InputError: No sweep, no pose, or another sensor was requested.
    """
    if not contents.files:
        raise InputError(f"recording '{path}': no sweep in it")
    if len(contents.files) > MOST_SWEEPS:
        raise InputError(f"recording '{path}': more than {MOST_SWEEPS} sweeps")
    if options.sensors not in ((), (contents.sensor,)):
        raise InputError(
            f"recording '{path}': no sensor '{options.sensors[0]}', there is '{contents.sensor}'"
        )
    if options.mount is not None:
        contents = _on_body(contents, options.mount)
    track, start = track_of(path, contents.poses, contents.source, options, faults)
    sensor = RecordedSensor(
        name=contents.sensor,
        frame=contents.sensor,
        kind=contents.kind,
        range_min=0.0,
        range_max=float32(options.range_max or np.inf),
        missing_returns_known=bool(options.missing_returns_free),
    )
    paths = [*contents.others, *(one.path for one in contents.files)]
    more = f"; {contents.chosen}" if contents.chosen else ""
    return Recording(
        name=path.resolve().name,
        format=contents.format,
        sha256=digest_of([one for one in paths if one.is_file()]),
        start_ns=start,
        sensors=(sensor,),
        track=track,
        chosen=f"{len(contents.files)} sweeps, poses: {contents.source}{more}",
        opening=faults,
        read=_Sweeps(
            contents=contents,
            sensor=sensor,
            window=window_of(track, start, options),
        ),
    )


def _on_body(contents: FolderContents, T_body_sensor: Transform) -> FolderContents:
    """Return contents with the poses of the body that carries the sensor, x ahead and z up."""
    return replace(
        contents,
        poses=of_body(contents.poses, T_body_sensor, turn_world=False),
        mount=compose(T_body_sensor, contents.mount),
        source=f"{contents.source}, moved to the body",
    )


@dataclass(frozen=True)
class _Sweeps:
    """The sweeps of a folder, as often as they are read."""

    contents: FolderContents
    sensor: RecordedSensor
    window: Window

    def __call__(self, faults: Faults) -> Iterator[RecordedSweep]:
        """Yield the sweeps; count what is left out.

        Raises:
            InputError: No file can be read, with the reason of the first.
        """
        reasons, is_one_read = [], False
        limits = Limits(0.0, FARTHEST, self.sensor.range_max, beyond_is_none=False)
        files = self.contents.files
        kept = set(in_order(np.array([one.stamp_ns for one in files], np.int64)).tolist())
        for place, (stamp, path) in enumerate(files):
            if not self.window.holds(stamp):
                continue
            if place not in kept:
                faults[OUT_OF_ORDER] += 1
            elif self.window.has_pose(stamp, None, faults):
                try:
                    beams = self.contents.read(path, limits, faults)
                except (Unreadable, OSError) as error:
                    faults[UNREADABLE] += 1
                    reasons.append(str(error))
                    continue
                is_one_read = True
                if not len(beams.ranges):
                    faults[NO_BEAM] += 1
                    continue
                yield RecordedSweep(
                    time_ns=stamp - self.window.start_ns,
                    sensor=self.sensor.name,
                    directions=beams.directions,
                    ranges=beams.ranges,
                    beam_times_ns=beams.times_ns,
                    T_body_sensor=self.contents.mount,
                    points=beams.points,
                )
        if reasons and not is_one_read:
            raise InputError(f"none of {len(reasons)} files can be read: {reasons[0]}")


def new_faults() -> Faults:
    """Return a count of faults without any."""
    return Counter()
