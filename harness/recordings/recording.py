"""A recording that is open for reading, and the options that select its parts."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, fields
from pathlib import Path

from wayproof.harness.mission import Mission
from wayproof.harness.recordings.track import RecordedTrack
from wayproof.harness.recordings.types import OwnMap, RecordedSensor, RecordedSweep, Transform

Faults = Counter[str]
"""Kind of fault -> how many were met."""

UNREADABLE = "message: cannot be read"


class Broken(Exception):
    """A message, or a part of a file, cannot be read."""


def unreadable(faults: Faults, error: Broken) -> str:
    """Return the kind of fault of messages that cannot be read, with the text of the first one."""
    first = next((kind for kind in faults if kind.startswith(UNREADABLE)), None)
    return first or f"{UNREADABLE}, the first: {error}"


@dataclass(frozen=True)
class RecordingOptions:
    """Selection of a recording, and settings to read it. Times are counted from its first pose.

    Attributes:
        format: Name of the format; None finds it.
        sensors: Topics of the sensors; empty takes the only one.
        pose: Topic of the poses, or the fixed frame of the transforms; None takes the only one.
        body: Frame of the body; None takes the one that the poses are of.
        mount: T_body_sensor of the sensor as it stands on the body, x ahead and z up also of a
            camera, where the recording lacks it. A folder's poses are then the sensor's.
        start_s: Time of the first sweep, s.
        end_s: Time of the last sweep, s; None reads to the end.
        range_max: Maximum range, m, where the recording lacks it, or a shorter one.
        missing_returns_free: Whether a beam without return was free, as `missing_returns_known`;
            None takes the format's convention.
        intrinsics: fx, fy, cx, cy of the depth images, pixels, where the recording lacks them.
        depth_scale: Units of an integer depth image in a metre; None takes the format's.
        pixel_stride: Step between the pixels of a depth image that are read, along each axis.
        max_gap_s: Maximum time between two poses between which one is interpolated, s.
    """

    format: str | None = None
    sensors: tuple[str, ...] = ()
    pose: str | None = None
    body: str | None = None
    mount: Transform | None = None
    start_s: float = 0.0
    end_s: float | None = None
    range_max: float | None = None
    missing_returns_free: bool | None = None
    intrinsics: tuple[float, float, float, float] | None = None
    depth_scale: float | None = None
    pixel_stride: int = 4
    max_gap_s: float = 1.0

    def changed(self) -> tuple[str, ...]:
        """Return `name=value` of each option that is not the default."""
        values = ((one.name, getattr(self, one.name), one.default) for one in fields(self))
        return tuple(f"{name}={_text(value)}" for name, value, usual in values if value != usual)


def _text(value: object) -> str:
    """Return the value of an option in words, numbers bit by bit."""
    if isinstance(value, Transform):
        value = (*value.position.tolist(), *value.quaternion.tolist())
    if isinstance(value, tuple):
        return ",".join(map(str, value))
    return str(value)


@dataclass(frozen=True)
class Recording:
    """Sensors and track of a recording, and its sweeps.

    Attributes:
        name: Name of the file or folder.
        format: Name of its format.
        sha256: Hash of the bytes of all files that are read, hexadecimal.
        start_ns: Stamp of the first pose, ns since the epoch of the recording's clock.
        sensors: Sensors in the order of their names, or of an episode's sensors.
        track: Poses of the body.
        chosen: The topics and frames that were chosen, in words.
        opening: Faults met while the recording was opened.
        read: Reads the sweeps in order of time and counts faults.
        body_height: Height of the body's origin above the floor at the first pose, m; None where
            the recording does not say.
        options: Options that it was opened with.
        mission: Mission of the episode that was recorded, in its world frame, which is the
            recording's; None where the recording does not say.
        own_maps: Maps that the robot itself had, in order of time.
    """

    name: str
    format: str
    sha256: str
    start_ns: int
    sensors: tuple[RecordedSensor, ...]
    track: RecordedTrack
    chosen: str
    opening: Faults
    read: Callable[[Faults], Iterator[RecordedSweep]]
    body_height: float | None = None
    options: RecordingOptions = field(default_factory=RecordingOptions)
    mission: Mission | None = None
    own_maps: tuple[OwnMap, ...] = ()
    _met: Faults = field(default_factory=Counter, init=False)

    def sweeps(self) -> Iterator[RecordedSweep]:
        """Yield the sweeps in order of time, then of sensors' names; few are in memory at a time.

        Raises:
            InputError: The recording is damaged from some place on.
        """
        self._met.clear()
        yield from self.read(self._met)

    @property
    def faults(self) -> dict[str, int]:
        """Faults by kind: those of the opening, and those of the sweeps read so far."""
        return dict(sorted((self.opening + self._met).items()))


@dataclass(frozen=True)
class Format:
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
