"""Reader of CARMEN log files: planar laser scans with odometry.

The logs of the Radish repository and of the Freiburg SLAM benchmark are of this format.
"""

from __future__ import annotations

from array import array
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayproof.harness.errors import InputError, unknown_name
from wayproof.harness.recordings.beams import Limits, float32, scan_beams
from wayproof.harness.recordings.carmen_lines import PARSERS, Scan, opened, scans
from wayproof.harness.recordings.digest import digest_of
from wayproof.harness.recordings.order import in_order
from wayproof.harness.recordings.poses import StampedPoses, compose, inverse, planar, track_of
from wayproof.harness.recordings.recording import Faults, Recording, RecordingOptions
from wayproof.harness.recordings.types import RecordedSensor, RecordedSweep, Transform
from wayproof.harness.recordings.window import NO_BEAM, OUT_OF_ORDER, Window, window_of

OFFSETS = {"FLASER": "robot_frontlaser_offset", "RLASER": "robot_rearlaser_offset"}
"""Parameter with the place of a laser ahead of the robot's centre, m."""

FRONT_MAX = "robot_front_laser_max"
"""Parameter with the maximum range of the front laser, m."""

SICK_MAX = 80.0
"""Maximum range of a SICK LMS, m; it writes faults as ranges of 81.83 m and more."""

LEAST_REPEATED = 10
"""Number of readings of the same largest value from which on it means no return."""

MOST_SCANS = 2_000_000
MOST_BEAMS = 100_000

SAME_PLACE = 1e-4
"""Difference between mounts up to which they are one, m and rad: the digits of a log."""

ODOMETRY, CORRECTED = "odometry", "corrected"
"""Names of the poses of a scan's message: the robot's, and the laser's where a SLAM wrote it."""


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
        self.poses.extend((*scan.laser, *scan.robot))
        self.range_max = max(self.range_max, scan.range_max)
        largest = max((reading for reading in scan.ranges if reading < np.inf), default=0.0)
        if largest > self.largest:
            self.largest, self.times_largest = largest, 0
        if largest == self.largest:
            self.times_largest += scan.ranges.count(largest)


class _Poses(NamedTuple):
    """Planar poses of the robot (n, 3) under their name, and the laser's mount."""

    robots: NDArray[np.float64]
    source: str
    mount: Transform


@dataclass(frozen=True)
class _Sweeps:
    """The sweeps of a log, as often as they are read."""

    path: Path
    sensor: RecordedSensor
    limits: Limits
    mount: Transform
    window: Window
    stamps: NDArray[np.int64]

    def __call__(self, faults: Faults) -> Iterator[RecordedSweep]:
        ordered = np.zeros(len(self.stamps), bool)
        ordered[in_order(self.stamps)] = True
        counted: Faults = Counter()  # broken lines were counted when the log was opened
        chosen = (one for one in scans(self.path, counted, {}) if one.kind == self.sensor.name)
        for place, scan in enumerate(chosen):
            stamp = int(self.stamps[place])
            if not self.window.holds(stamp):
                continue
            if not ordered[place]:
                faults[OUT_OF_ORDER] += 1
            elif self.window.has_pose(stamp, None, faults):
                sweep = self._sweep(scan, stamp, faults)
                if len(sweep.ranges):
                    yield sweep
                else:
                    faults[NO_BEAM] += 1

    def _sweep(self, scan: Scan, stamp_ns: int, faults: Faults) -> RecordedSweep:
        angles = float32(scan.angle_min), float32(scan.angle_increment)
        with np.errstate(over="ignore"):
            written = np.array(scan.ranges).astype(np.float32)
        beams = scan_beams(angles, written, self.limits, faults)
        return RecordedSweep(
            time_ns=stamp_ns - self.window.start_ns,
            sensor=self.sensor.name,
            directions=beams.directions,
            ranges=beams.ranges,
            beam_times_ns=None,
            T_body_sensor=self.mount,
            grid=beams.grid,
        )


def looks_like(path: Path) -> bool:
    """Return whether a file begins like a CARMEN log."""
    if not path.is_file():
        return False
    try:
        with opened(path) as file:
            head = file.read(4096).splitlines()
    except (OSError, EOFError):
        return ".clf" in path.suffixes
    words = {bytes(line).split(b" ", 1)[0].decode("ascii", "replace") for line in head}
    return not words.isdisjoint({*PARSERS, "ODOM", "PARAM", "SYNC", "RAWLASER1"})


def open_log(path: Path, options: RecordingOptions) -> Recording:
    """Open a CARMEN log, plain or compressed by bzip2 or gzip.

    Its poses are the robot's own (`odometry`), or, where the laser's differ from them by more than
    a mount, those of the laser, which a SLAM has written (`corrected`).

    Raises:
        InputError: It has no scan, has several lasers of which none was chosen, or is damaged.
    """
    faults: Faults = Counter()
    parameters: dict[str, str] = {}
    found: dict[str, _Index] = {}
    for scan in scans(path, faults, parameters):
        index = found.setdefault(scan.kind, _Index())
        index.add(scan)
        if len(index.stamps) > MOST_SCANS or len(scan.ranges) > MOST_BEAMS:
            raise InputError(
                f"recording '{path}': more than {MOST_SCANS} scans or {MOST_BEAMS} beams"
            )
    kind = _chosen(path, found, options)
    index = found[kind]
    stamps = _clock(index)
    poses = _poses(np.array(index.poses).reshape(-1, 6), _offset(kind, parameters), options)
    placed = StampedPoses(stamps, *planar(_finite_yaws(poses.robots)))
    track, start = track_of(
        path, poses=placed, source=f"{kind} {poses.source}", options=options, faults=faults
    )
    limits = _limits(kind, index, parameters)
    limits = limits._replace(cut=min(limits.range_max, float32(options.range_max or np.inf)))
    sensor = RecordedSensor(
        name=kind,
        frame=kind,
        kind="laser",
        range_min=0.0,
        range_max=limits.cut,
        missing_returns_known=bool(options.missing_returns_free),
    )
    mount = options.mount or poses.mount
    window = window_of(track, start, options)
    return Recording(
        name=path.name,
        format="carmen",
        sha256=digest_of([path]),
        start_ns=start,
        sensors=(sensor,),
        track=track,
        chosen=f"scans {kind} up to {sensor.range_max:g} m, poses: {poses.source}",
        opening=faults,
        read=_Sweeps(path, sensor, limits, mount, window, stamps),
    )


def _chosen(path: Path, found: dict[str, _Index], options: RecordingOptions) -> str:
    if not found:
        raise InputError(f"recording '{path}': no scan in it, expected {', '.join(PARSERS)}")
    if not options.sensors:
        if len(found) > 1:
            listed = ", ".join(f"{kind} ({len(one.stamps)})" for kind, one in found.items())
            raise InputError(f"recording '{path}': several lasers, choose one: {listed}")
        return next(iter(found))
    if len(options.sensors) > 1:
        raise InputError(f"recording '{path}': got {len(options.sensors)} lasers, expected one")
    if options.sensors[0] not in found:
        raise unknown_name("laser of the recording", options.sensors[0], found)
    return options.sensors[0]


def _clock(index: _Index) -> NDArray[np.int64]:
    """Return the stamps of the measurement, or the logger's where those do not advance."""
    stamps, logged = np.array(index.stamps, np.int64), np.array(index.logged, np.int64)
    return stamps if len(in_order(stamps)) >= len(in_order(logged)) else logged


def _offset(kind: str, parameters: dict[str, str]) -> float | None:
    try:
        offset = float(parameters[OFFSETS[kind]])
    except (KeyError, ValueError):
        return None
    return offset if abs(offset) < 100.0 else None


def _poses(planes: NDArray[np.float64], offset: float | None, options: RecordingOptions) -> _Poses:
    """Distinguish a mount from a correction, by poses (n, 6) of laser and robot."""
    lasers, robots = planes[:, :3], planes[:, 3:]
    steps = _mounts(lasers, _finite_yaws(robots))
    usual = np.median(steps, axis=0)
    one = bool((np.abs(steps - usual) < SAME_PLACE).mean() > 0.99)
    source = options.pose or (ODOMETRY if one else CORRECTED)
    if source not in (ODOMETRY, CORRECTED):
        raise unknown_name("poses of the recording", source, (ODOMETRY, CORRECTED))
    plane = np.array([offset or 0.0, 0.0, 0.0])
    if one:
        plane = np.round(usual, 6)
        if offset is not None and abs(offset - plane[0]) < SAME_PLACE:
            plane[0] = offset
    positions, quaternions = planar(plane[None])
    mount = Transform(positions[0], quaternions[0])
    if source == CORRECTED:
        robots = _robots_of(lasers, plane)
    return _Poses(robots, source, mount)


def _mounts(lasers: NDArray[np.float64], robots: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return planar poses (n, 3) of lasers in the robot's frame; the finite ones."""
    finite = np.isfinite(lasers).all(axis=1) & np.isfinite(robots).all(axis=1)
    lasers, robots = _finite_yaws(lasers[finite]), robots[finite]
    if not len(lasers):
        return np.zeros((1, 3))
    seen = compose(inverse(Transform(*planar(robots))), Transform(*planar(lasers)))
    turned = lasers[:, 2] - robots[:, 2]
    turned -= 2.0 * np.pi * np.round(turned / (2.0 * np.pi))
    return np.column_stack([seen.position[:, :2], turned])


def _robots_of(lasers: NDArray[np.float64], mount: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return planar poses (n, 3) of the robot that carries lasers at a planar mount (3,)."""
    yaws = _finite_yaws(lasers)[:, 2] - mount[2]
    positions, quaternions = planar(np.column_stack([lasers[:, :2], yaws]))
    back = inverse(Transform(*(one[0] for one in planar(mount[None] * [1.0, 1.0, 0.0]))))
    robots = compose(Transform(positions, quaternions), back).position
    return np.column_stack([robots[:, :2], yaws])


def _finite_yaws(planes: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return planar poses (n, 3), with a position that is not finite where the yaw is not."""
    wrong = ~(np.abs(planes[:, 2]) < 1e5)
    planes = planes.copy()
    planes[wrong] = np.nan, np.nan, 0.0
    return planes


def _limits(kind: str, index: _Index, parameters: dict[str, str]) -> Limits:
    """Return the limits of the readings, of which the largest may mean no return.

    The maximum is what the message or the parameters state; else 80 m if there are readings beyond;
    else the largest reading, which stands for no return if there are at least `LEAST_REPEATED`.
    """
    try:
        stated = float(parameters[FRONT_MAX]) if kind == "FLASER" else 0.0
    except (KeyError, ValueError):
        stated = 0.0
    if index.range_max or 0.0 < stated < np.inf:
        most = float32(index.range_max or stated)
        return Limits(0.0, most, most, beyond_is_none=True)
    most = float32(min(index.largest, SICK_MAX))
    none = index.largest >= SICK_MAX or index.times_largest >= LEAST_REPEATED
    return Limits(0.0, most, most, beyond_is_none=none)
