"""Reader of CARMEN log files: planar laser scans with odometry, plain or compressed.

The logs of the Radish repository and of the Freiburg SLAM benchmark are of this format.
"""

from __future__ import annotations

import bz2
import gzip
from array import array
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import partial
from math import pi
from pathlib import Path
from typing import IO, NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayproof.harness.errors import InputError, unknown_name
from wayproof.harness.recordings.beams import Beams, Limits, float32, scan_beams
from wayproof.harness.recordings.folders import nanoseconds
from wayproof.harness.recordings.options import Faults, RecordingOptions
from wayproof.harness.recordings.order import in_order
from wayproof.harness.recordings.poses import StampedPoses
from wayproof.harness.recordings.recording import Recording, Stream, recording_of, sensor_of
from wayproof.harness.recordings.transform import Transform, compose, inverse, planar

MESSAGES = ("FLASER", "RLASER", "ROBOTLASER1", "ROBOTLASER2")
"""Messages with a scan and the robot's pose: front laser and rear one, of the old logs, and new."""

OFFSETS = {"FLASER": "robot_frontlaser_offset", "RLASER": "robot_rearlaser_offset"}
"""Parameter with the place of a laser ahead of the robot's centre, m."""

FRONT_MAX = "robot_front_laser_max"
"""Parameter with the maximum range of the front laser, m."""

SICK_MAX = 80.0
"""Maximum range of a SICK LMS, m; it writes faults as ranges of 81.83 m and more."""

LEAST_REPEATED = 10
"""Number of readings of the same largest value from which on it means no return."""

LONGEST_LINE = 2**20
"""Maximum length of a line, bytes; a scan of 361 beams takes 2,500."""

GREATEST_RATIO, LEAST_TEXT = 64, 2**24
"""Maximum ratio of the text to a compressed file beyond so many bytes; logs of robots reach 10."""

MOST_SCANS, MOST_BEAMS, MOST_PARAMETERS = 2_000_000, 100_000, 10_000

SAME_PLACE = 1e-4
"""Difference between mounts up to which they are one, m and rad: the digits of a log."""

ODOMETRY, CORRECTED = "odometry", "corrected"
"""Names of the poses of a scan's message: the robot's, and the laser's where a SLAM wrote it."""


class Scan(NamedTuple):
    """A message with a scan.

    Attributes:
        kind: Name of the message.
        ranges: Ranges, m.
        angles: Angle of the first beam from straight ahead to the left, and between two, rad.
        range_max: Maximum range, m; 0 where the message does not say.
        poses: x, y, m, and yaw, rad, of the laser, and of the robot.
        stamp_ns: Time of the measurement, ns.
        logged_ns: Time at which the logger wrote it, ns since its start.
    """

    kind: str
    ranges: list[float]
    angles: tuple[float, float]
    range_max: float
    poses: list[float]
    stamp_ns: int
    logged_ns: int


@dataclass
class _Index:
    """Index of one kind of message, of the first pass over the log."""

    stamps: array[int] = field(default_factory=lambda: array("q"))
    logged: array[int] = field(default_factory=lambda: array("q"))
    poses: array[float] = field(default_factory=lambda: array("d"))
    range_max: float = 0.0
    largest: float = 0.0
    times_largest: int = 0

    def add(self, scan: Scan) -> None:
        self.stamps.append(scan.stamp_ns)
        self.logged.append(scan.logged_ns)
        self.poses.extend(scan.poses)
        self.range_max = max(self.range_max, scan.range_max)
        largest = max((reading for reading in scan.ranges if reading < np.inf), default=0.0)
        if largest > self.largest:
            self.largest, self.times_largest = largest, 0
        if largest == self.largest:
            self.times_largest += scan.ranges.count(largest)


def looks_like(path: Path) -> bool:
    """Return whether a file begins like a CARMEN log."""
    if not path.is_file():
        return False
    try:
        with _opened(path) as file:
            head = file.read(4096).splitlines()
    except (OSError, EOFError):
        return ".clf" in path.suffixes
    words = {bytes(line).split(b" ", 1)[0].decode("ascii", "replace") for line in head}
    return not words.isdisjoint({*MESSAGES, "ODOM", "PARAM", "SYNC", "RAWLASER1"})


def open_log(path: Path, options: RecordingOptions) -> Recording:
    """Open a CARMEN log.

    Its poses are the robot's own (`odometry`), or, where the laser's differ from them by more than
    a mount, those of the laser, which a SLAM has written (`corrected`).

    Raises:
        InputError: It has no scan, has several lasers and none was chosen, or is damaged.
    """
    faults: Faults = Counter()
    parameters: dict[str, str] = {}
    found: dict[str, _Index] = {}
    for scan in _scans(path, faults, parameters):
        index = found.setdefault(scan.kind, _Index())
        index.add(scan)
        if len(index.stamps) > MOST_SCANS or len(scan.ranges) > MOST_BEAMS:
            raise InputError(f"more than {MOST_SCANS} scans or {MOST_BEAMS} beams")
    kind = _chosen(found, options)
    index = found[kind]
    # The logger's times are taken where those of the measurement do not advance.
    clocks = np.array(index.stamps, np.int64), np.array(index.logged, np.int64)
    stamps = max(clocks, key=lambda one: len(in_order(one)))
    robots, source, mount = _poses(index, _number(parameters, OFFSETS.get(kind, "")), options)
    limits = _limits(index, _number(parameters, FRONT_MAX) if kind == "FLASER" else None)
    sensor = sensor_of(kind, "laser", options, ranges=(0.0, limits.range_max))
    stream = Stream(
        sensor=sensor,
        stamps=stamps,
        payloads=partial(_scans_of, path, kind),
        read=partial(_beams, limits._replace(cut=sensor.range_max)),
        mount=options.T_body_sensor or mount,
    )
    poses = StampedPoses(stamps, *robots)
    said = f"scans {kind} up to {sensor.range_max:g} m"
    return recording_of(path, "carmen", [path], [stream], poses, source, options, faults, said)


def _chosen(found: Mapping[str, _Index], options: RecordingOptions) -> str:
    if not found:
        raise InputError(f"no scan in it, expected {', '.join(MESSAGES)}")
    if len(options.sensors) > 1:
        raise InputError(f"got {len(options.sensors)} lasers, expected one")
    if options.sensors and options.sensors[0] not in found:
        raise unknown_name("laser of the recording", options.sensors[0], found)
    if not options.sensors and len(found) > 1:
        listed = ", ".join(f"{kind} ({len(one.stamps)})" for kind, one in found.items())
        raise InputError(f"several lasers, choose one: {listed}")
    return options.sensors[0] if options.sensors else next(iter(found))


def _number(parameters: Mapping[str, str], name: str) -> float | None:
    try:
        return float(parameters[name])
    except (KeyError, ValueError):
        return None


def _poses(
    index: _Index, offset: float | None, options: RecordingOptions
) -> tuple[Transform, str, Transform]:
    """Return the poses of the robot, their name, and the laser's mount.

    A mount differs from a correction: it is the same at all scans.
    """
    table = np.array(index.poses).reshape(-1, 6)
    lasers, robots = _placed(table[:, :3]), _placed(table[:, 3:])
    turned = table[:, 2] - table[:, 5]
    with np.errstate(invalid="ignore"):
        turned -= 2.0 * np.pi * np.round(turned / (2.0 * np.pi))
        seen = compose(inverse(robots), lasers).position[:, :2]
    steps = np.column_stack([seen, turned])
    steps = steps[np.isfinite(steps).all(axis=1)]
    usual = np.median(steps, axis=0) if len(steps) else np.zeros(3)
    same = np.abs(steps - usual) < SAME_PLACE
    is_one = not len(steps) or bool(same.mean() > 0.99)
    source = options.pose or (ODOMETRY if is_one else CORRECTED)
    if source not in (ODOMETRY, CORRECTED):
        raise unknown_name("poses of the recording", source, (ODOMETRY, CORRECTED))
    offset = offset if offset is not None and abs(offset) < 100.0 else None
    plane = np.array([offset or 0.0, 0.0, 0.0])
    if is_one:
        plane = np.round(usual, 6)
        if offset is not None and abs(offset - plane[0]) < SAME_PLACE:
            plane[0] = offset
    mount = planar(plane[None]).row(0)
    return (compose(lasers, inverse(mount)) if source == CORRECTED else robots), source, mount


def _placed(planes: NDArray[np.float64]) -> Transform:
    """Return planar poses (n, 3); without a yaw that is a number they are nowhere."""
    wrong = ~(np.abs(planes[:, 2]) < 1e5)
    planes = planes.copy()
    planes[wrong] = np.nan, np.nan, 0.0
    return planar(planes)


def _limits(index: _Index, stated: float | None) -> Limits:
    """Return the limits of the readings; the largest may mean no return.

    The maximum is what the message or the parameters state; else 80 m if there are readings beyond;
    else the largest reading, which stands for no return if there are at least `LEAST_REPEATED`.
    """
    if index.range_max or 0.0 < (stated or 0.0) < np.inf:
        most = float32(index.range_max or stated or 0.0)
        return Limits(0.0, most, most, beyond_is_none=True)
    most = float32(min(index.largest, SICK_MAX))
    none = index.largest >= SICK_MAX or index.times_largest >= LEAST_REPEATED
    return Limits(0.0, most, most, beyond_is_none=none)


def _beams(limits: Limits, scan: Scan, faults: Faults) -> Beams:
    angles = float32(scan.angles[0]), float32(scan.angles[1])
    with np.errstate(over="ignore"):
        written = np.array(scan.ranges).astype(np.float32)
    return scan_beams(angles, written, limits, faults)


def _opened(path: Path) -> IO[bytes]:
    """Open a file, decompressing it if it begins like one of bzip2 or gzip."""
    with path.open("rb") as file:
        head = file.read(3)
    if head == b"BZh":
        return bz2.open(path)
    if head[:2] == b"\x1f\x8b":
        return gzip.open(path)  # type: ignore[return-value]  # a stream of bytes as well
    return path.open("rb")


def _lines(path: Path) -> Iterator[str]:
    """Yield the lines of a log, decompressed.

    Raises:
        InputError: The file cannot be read or decompressed, has a line of over a mebibyte, or
            unpacks to far more than its size.
    """
    most = LEAST_TEXT + GREATEST_RATIO * path.stat().st_size
    size = 0
    try:
        with _opened(path) as file:
            while line := file.readline(LONGEST_LINE):
                size += len(line)
                if len(line) == LONGEST_LINE:
                    raise InputError(f"a line of over {LONGEST_LINE} bytes")
                if size > most:
                    raise InputError(f"unpacks to over {most} bytes")
                yield line.decode("utf-8", "replace")
    except (OSError, EOFError) as error:
        raise InputError(f"cannot be read ({error})") from None


def _scans_of(path: Path, kind: str) -> Iterator[Scan]:
    """Yield the scans of one kind; broken lines were counted when the log was opened."""
    return (scan for scan in _scans(path, Counter(), {}) if scan.kind == kind)


def _scans(path: Path, faults: Faults, parameters: dict[str, str]) -> Iterator[Scan]:
    """Yield the scans of a log in its order; take up its parameters and count broken lines."""
    for line in _lines(path):
        kind, _, rest = line.partition(" ")
        if kind in MESSAGES:
            try:
                yield _scan(kind, rest.split())
            except (ValueError, IndexError, ArithmeticError):
                faults["line: not a scan"] += 1
        elif kind == "PARAM":
            words = rest.split()
            if len(words) > 1 and len(parameters) < MOST_PARAMETERS:
                parameters[words[0]] = words[1]


def _scan(kind: str, words: list[str]) -> Scan:
    """Parse a message.

    The old ones have a count, ranges, the laser's and the robot's pose, stamp, host, logger's
    stamp; the new ones type, start angle, field of view, resolution, maximum range, accuracy, mode,
    count, ranges, count, remissions, the two poses, two speeds, three safety distances, and those.
    """
    is_old = not kind.startswith("ROBOT")
    first = 1 if is_old else 8
    count = int(words[first - 1])
    end = first + count
    tail = words[end:] if is_old else words[end + 1 + max(int(words[end]), 0) :]
    times = tail[6:9] if is_old else tail[11:14]
    if count < 1 or len(times) < 3:
        raise ValueError(kind)
    angles = _usual_angles(count) if is_old else (float(words[1]), float(words[3]))
    if not all(abs(angle) <= 4.0 * pi for angle in angles):
        raise ValueError(kind)
    return Scan(
        kind=kind,
        ranges=[float(word) for word in words[first:end]],
        angles=angles,
        range_max=0.0 if is_old else max(float(words[4]), 0.0),
        poses=[float(word) for word in tail[:6]],
        stamp_ns=nanoseconds(times[0]),
        logged_ns=nanoseconds(times[2]),
    )


def _usual_angles(count: int) -> tuple[float, float]:
    """Return the first angle and the step of an old scan, rad, which its message leaves out.

    Those of a SICK LMS by the number of readings, as CARMEN takes them; the last beam of an even
    number is left out by the driver.
    """
    if count in (180, 181, 360, 361):
        return -pi / 2.0, pi / 180.0 if count < 360 else pi / 360.0
    if count in (400, 401):
        return -pi * 50.0 / 180.0, pi / 720.0
    return -pi / 2.0, pi / max(count - 1, 1)
