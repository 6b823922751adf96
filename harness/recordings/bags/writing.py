"""Writer of bags: a recording as a bag of ROS 1, or of ROS 2 in MCAP or SQLite."""

from __future__ import annotations

import contextlib
import shutil
import tempfile
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any, Literal, NamedTuple, get_args

import numpy as np

from wayproof.harness.errors import InputError
from wayproof.harness.outputs import check_target
from wayproof.harness.recordings.bags.building import Builder
from wayproof.harness.recordings.bags.choose import BODIES, FOOTPRINT, LIMITS, SILENT, UNSURE
from wayproof.harness.recordings.bags.messages import (
    CLOUD,
    ODOMETRY,
    RANGE,
    SCAN,
    TRANSFORMS,
    typestore,
)
from wayproof.harness.recordings.recording import Recording
from wayproof.harness.recordings.transform import IDENTITY, Transform
from wayproof.harness.recordings.types import RecordedSensor, RecordedSweep

BagKind = Literal["ros1", "mcap", "sqlite"]
"""A `.bag` of ROS 1, or a folder of ROS 2 with an `.mcap` or a `.db3`."""

WORLD, BODY = "odom", BODIES[0]
"""Frames of the track, REP 105."""


class Stamped(NamedTuple):
    """A message with its topic, the name of its type, and the time at which it is recorded, ns."""

    stamp_ns: int
    topic: str
    type: str
    message: Any  # of a class of rosbags


def write_bag(messages: Iterable[Stamped], out: Path, kind: BagKind) -> int:
    """Write messages in their order as a bag, whole or not at all; return how many.

    Args:
        messages: Built by a `Builder` of the encoding that `encoding_of` the kind gives.
        out: File of ROS 1, or folder of ROS 2; it must not exist.
        kind: Kind of bag.

    Raises:
        InputError: It cannot be written, or `rosbags` is not installed.
    """
    if out.exists() or out.is_symlink():
        raise InputError(f"bag '{out}': exists already, expected a new name")
    check_target(out, "bag")
    store = typestore(encoding_of(kind))
    count = 0
    try:
        with tempfile.TemporaryDirectory(prefix=f".{out.name}.", dir=out.parent) as folder:
            partial = Path(folder) / out.name
            with contextlib.closing(_opened(partial, kind)) as writer:
                topics: dict[str, Any] = {}
                for one in messages:
                    if one.topic not in topics:
                        topics[one.topic] = writer.add_connection(
                            one.topic, one.type, typestore=store
                        )
                    write = store.serialize_ros1 if kind == "ros1" else store.serialize_cdr
                    writer.write(topics[one.topic], one.stamp_ns, write(one.message, one.type))
                    count += 1
            shutil.move(partial, out)
    except OSError as error:
        raise InputError(f"bag '{out}': {error.strerror}") from None
    return count


def encoding_of(kind: BagKind) -> str:
    """Return the encoding of a kind of bag: `ros1` or `cdr`."""
    if kind not in get_args(BagKind):
        raise InputError(f"kind of bag '{kind}', expected {', '.join(get_args(BagKind))}")
    return "ros1" if kind == "ros1" else "cdr"


def _opened(path: Path, kind: BagKind) -> Any:  # a writer of rosbags
    from rosbags import rosbag1, rosbag2

    if kind == "ros1":
        writer: Any = rosbag1.Writer(path)
    else:
        plugin = rosbag2.StoragePlugin.MCAP if kind == "mcap" else rosbag2.StoragePlugin.SQLITE3
        writer = rosbag2.Writer(path, version=8, storage_plugin=plugin)
    writer.open()
    return writer


def recording_messages(recording: Recording, kind: BagKind) -> Iterator[Stamped]:
    """Yield a recording's track and sweeps as messages of ROS, in order of time.

    The poses go to `/odom` and `/tf`, the mounts to `/tf_static` with the body's projection on the
    floor where it is known, a planar laser's sweeps to a LaserScan and others to a PointCloud2,
    each on the topic of the sensor's name. Beside points lie
    their sensor's limits, and the directions of beams without return, which tools pass over.
    Read back, it is the same recording bit by bit.

    Raises:
        InputError: A sensor is not fixed to the body, or a stamp is none of ROS.
    """
    build = Builder(encoding_of(kind))
    sensors = {sensor.name: sensor for sensor in recording.sensors}
    mounts: dict[str, Transform] = {}
    poses = _Poses(recording, build)
    if recording.body_height is not None:
        below = IDENTITY._replace(position=np.array([0.0, 0.0, -recording.body_height]))
        footprint = build.transforms(recording.start_ns, BODY, FOOTPRINT, below)
        yield Stamped(recording.start_ns, "/tf_static", TRANSFORMS[0], footprint)
    for sweep in recording.sweeps():
        sensor, frame = sensors[sweep.sensor], _frame(sensors[sweep.sensor])
        stamp = recording.start_ns + sweep.time_ns
        if sweep.sensor not in mounts:
            mounts[sweep.sensor] = sweep.T_body_sensor
            yield from _mounted(recording.start_ns, frame, sensor, sweep, build)
        elif not _same(mounts[sweep.sensor], sweep.T_body_sensor):
            raise InputError(f"sensor '{sweep.sensor}': moves on the body, expected a fixed mount")
        yield from poses.until(sweep.time_ns)
        yield from _sweep(stamp, frame, sensor, sweep, build)
    yield from poses.until(int(recording.track.times_ns[-1]))


class _Poses:
    """The track as messages, written as far as the sweeps are."""

    def __init__(self, recording: Recording, build: Builder) -> None:
        self._start_ns, self._track, self._build = recording.start_ns, recording.track, build
        self._next = 0

    def until(self, time_ns: int) -> Iterator[Stamped]:
        track = self._track
        while self._next < len(track.times_ns) and track.times_ns[self._next] <= time_ns:
            k = self._next
            stamp = self._start_ns + int(track.times_ns[k])
            pose = Transform(track.positions[k], track.quaternions[k])
            moved = self._build.transforms(stamp, WORLD, BODY, pose)
            yield Stamped(stamp, "/tf", TRANSFORMS[0], moved)
            odometry = self._build.odometry(stamp, WORLD, BODY, pose)
            yield Stamped(stamp, "/odom", ODOMETRY, odometry)
            self._next += 1


def _mounted(
    stamp: int, frame: str, sensor: RecordedSensor, sweep: RecordedSweep, build: Builder
) -> Iterator[Stamped]:
    """Yield the constants of a sensor: its mount, and its limits beside points."""
    mounted = build.transforms(stamp, BODY, frame, sweep.T_body_sensor)
    yield Stamped(stamp, "/tf_static", TRANSFORMS[0], mounted)
    if sweep.grid is None:
        limits = build.limits(stamp, frame, sensor)
        yield Stamped(stamp, _topic(sensor) + LIMITS, RANGE, limits)


def _sweep(
    stamp: int, frame: str, sensor: RecordedSensor, sweep: RecordedSweep, build: Builder
) -> Iterator[Stamped]:
    topic = _topic(sensor)
    if sweep.grid is not None:
        yield Stamped(stamp, topic, SCAN, build.scan(stamp, frame, sensor, sweep))
        return
    points = sweep.points
    if points is None:
        raise InputError(f"sensor '{sensor.name}': a sweep without points, expected them")
    times, met = sweep.beam_times_ns, len(points)
    if sensor.missing_returns_known or met < len(sweep.ranges):
        silent = build.cloud(
            stamp, frame, sweep.directions[met:], None if times is None else times[met:]
        )
        beside = topic + (SILENT if sensor.missing_returns_known else UNSURE)
        yield Stamped(stamp, beside, CLOUD, silent)
    cloud = build.cloud(stamp, frame, points, None if times is None else times[:met])
    yield Stamped(stamp, topic, CLOUD, cloud)


def _topic(sensor: RecordedSensor) -> str:
    return "/" + sensor.name.lstrip("/")


def _frame(sensor: RecordedSensor) -> str:
    """Return the sensor's frame, another name if it is one of the body or the world."""
    if sensor.frame and sensor.frame not in (WORLD, BODY):
        return sensor.frame
    return sensor.name.replace("/", "_") + "_frame"


def _same(first: Transform, second: Transform) -> bool:
    pairs = zip(first, second, strict=True)
    return all(np.array_equal(one, other) for one, other in pairs)
