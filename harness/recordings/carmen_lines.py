"""Lines of CARMEN log files: scans and parameters, plain or compressed."""

from __future__ import annotations

import bz2
import gzip
from collections.abc import Callable, Iterator
from decimal import InvalidOperation
from math import pi
from pathlib import Path
from typing import IO, NamedTuple

from wayproof.harness.errors import InputError
from wayproof.harness.recordings.recording import Faults
from wayproof.harness.recordings.text import nanoseconds

LONGEST_LINE = 2**20
"""Maximum length of a line, bytes; a scan of 361 beams takes 2,500."""

GREATEST_RATIO = 64
LEAST_TEXT = 2**24
"""Maximum ratio of the text to a compressed file beyond so many bytes; logs of robots reach 10."""

Plane = tuple[float, float, float]
"""A planar pose: x, y, m, yaw, rad."""


class Scan(NamedTuple):
    """A message with a scan.

    Attributes:
        kind: Name of the message.
        ranges: Ranges, m.
        angle_min: Angle of the first beam from straight ahead to the left, rad.
        angle_increment: Angle from one beam to the next, rad.
        range_max: Maximum range, m; 0 where the message does not say.
        laser: Pose of the laser.
        robot: Pose of the robot.
        stamp_ns: Time of the measurement, ns.
        logged_ns: Time at which the logger wrote it, ns since its start.
    """

    kind: str
    ranges: list[float]
    angle_min: float
    angle_increment: float
    range_max: float
    laser: Plane
    robot: Plane
    stamp_ns: int
    logged_ns: int


def lines(path: Path) -> Iterator[str]:
    """Yield the lines of a log, decompressed.

    Raises:
        InputError: The file cannot be read or decompressed, has a line of over a mebibyte, or
            unpacks to far more than its size.
    """
    most = LEAST_TEXT + GREATEST_RATIO * path.stat().st_size
    size = 0
    try:
        with opened(path) as file:
            while line := file.readline(LONGEST_LINE):
                size += len(line)
                if len(line) == LONGEST_LINE:
                    raise InputError(f"recording '{path}': a line of over {LONGEST_LINE} bytes")
                if size > most:
                    raise InputError(f"recording '{path}': unpacks to over {most} bytes")
                yield line.decode("utf-8", "replace")
    except (OSError, EOFError) as error:
        raise InputError(f"recording '{path}': cannot be read ({error})") from None


def opened(path: Path) -> IO[bytes]:
    """Open a file, decompressing it if it begins like one of bzip2 or gzip."""
    with path.open("rb") as file:
        head = file.read(3)
    if head == b"BZh":
        return bz2.open(path)
    if head[:2] == b"\x1f\x8b":
        return gzip.open(path)  # type: ignore[return-value]  # a stream of bytes as well
    return path.open("rb")


def scans(path: Path, faults: Faults, parameters: dict[str, str]) -> Iterator[Scan]:
    """Yield the scans of a log in its order; take up its parameters and count broken lines.

    Raises:
        InputError: As of `lines`.
    """
    for line in lines(path):
        kind, _, rest = line.partition(" ")
        if kind in PARSERS:
            try:
                yield PARSERS[kind](kind, rest.split())
            except (ValueError, IndexError, InvalidOperation, OverflowError):
                faults["line: not a scan"] += 1
        elif kind == "PARAM":
            words = rest.split()
            if len(words) > 1 and len(parameters) < 10_000:
                parameters[words[0]] = words[1]


def _old_scan(kind: str, words: list[str]) -> Scan:
    """Parse FLASER and RLASER: count, ranges, laser's and robot's pose, two stamps and a host."""
    count = int(words[0])
    tail = words[1 + count :]
    if count < 1 or len(tail) < 9:
        raise ValueError
    angle_min, increment = _usual_angles(count)
    return Scan(
        kind=kind,
        ranges=[float(word) for word in words[1 : 1 + count]],
        angle_min=angle_min,
        angle_increment=increment,
        range_max=0.0,
        laser=_plane(tail[0:3]),
        robot=_plane(tail[3:6]),
        stamp_ns=nanoseconds(tail[6]),
        logged_ns=nanoseconds(tail[8]),
    )


def _new_scan(kind: str, words: list[str]) -> Scan:
    """Parse ROBOTLASER1: the laser's angles and limits, ranges, remissions, poses, speeds, stamps.

    Fields: type, start angle, field of view, resolution, maximum range, accuracy, mode, count,
    ranges, count, remissions, laser's pose, robot's pose, two speeds, three safety distances.
    """
    count = int(words[7])
    remissions = int(words[8 + count])
    tail = words[9 + count + remissions :]
    if count < 1 or remissions < 0 or len(tail) < 14:
        raise ValueError
    return Scan(
        kind=kind,
        ranges=[float(word) for word in words[8 : 8 + count]],
        angle_min=_angle(words[1]),
        angle_increment=_angle(words[3]),
        range_max=max(float(words[4]), 0.0),
        laser=_plane(tail[0:3]),
        robot=_plane(tail[3:6]),
        stamp_ns=nanoseconds(tail[11]),
        logged_ns=nanoseconds(tail[13]),
    )


PARSERS: dict[str, Callable[[str, list[str]], Scan]] = {
    "FLASER": _old_scan,
    "RLASER": _old_scan,
    "ROBOTLASER1": _new_scan,
    "ROBOTLASER2": _new_scan,
}
"""Messages with a scan and the robot's pose: front laser and rear one, of the old logs, and new."""


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


def _angle(word: str) -> float:
    angle = float(word)
    if not abs(angle) <= 4.0 * pi:
        raise ValueError
    return angle


def _plane(words: list[str]) -> Plane:
    x, y, yaw = (float(word) for word in words)
    return x, y, yaw
