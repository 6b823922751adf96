"""Reader of ULog, the log of PX4 on board: pose and distance sensors, by `pyulog`.

The format: https://docs.px4.io/main/en/dev_log/ulog_file_format.html. Times are counted from the
start of the autopilot.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wayproof.harness.errors import InputError, unknown_name
from wayproof.harness.recordings.bags.container import Broken
from wayproof.harness.recordings.bags.vendors import px4
from wayproof.harness.recordings.beams import FARTHEST, Limits, float32, point_beams
from wayproof.harness.recordings.digest import digest_of
from wayproof.harness.recordings.order import in_order
from wayproof.harness.recordings.poses import RESET, StampedPoses, track_of
from wayproof.harness.recordings.recording import Faults, Recording, RecordingOptions
from wayproof.harness.recordings.types import (
    IDENTITY,
    RecordedSensor,
    RecordedSweep,
    Transform,
)
from wayproof.harness.recordings.window import NO_BEAM, OUT_OF_ORDER, Window, window_of

MAGIC = b"ULog\x01\x12\x35"

ODOMETRY, LOCAL, ATTITUDE = "vehicle_odometry", "vehicle_local_position", "vehicle_attitude"
DISTANCE = "distance_sensor"

Fields = dict[str, NDArray[Any]]
"""Columns of a topic, by the names of ULog."""


def looks_like(path: Path) -> bool:
    """Return whether a file begins like a ULog."""
    if not path.is_file():
        return False
    with path.open("rb") as file:
        return file.read(len(MAGIC)) == MAGIC


def open_ulog(path: Path, options: RecordingOptions) -> Recording:
    """Open a ULog: its odometry, or its local position with the attitude, and distance sensors.

    Raises:
        InputError: It has no pose, no distance sensor, or not the ones that were chosen.
    """
    faults: Faults = Counter()
    topics = _topics(path, faults)
    sensors = _sensors(path, topics, options)
    poses, source = _poses(path, topics, options, faults)
    track, start = track_of(path, poses, source, options, faults)
    cut = float32(options.range_max or np.inf)
    return Recording(
        name=path.resolve().name,
        format="ulog",
        sha256=digest_of([path]),
        start_ns=start,
        sensors=tuple(
            RecordedSensor(
                name=name,
                frame=px4.BODY,
                kind="points",
                range_min=0.0,
                range_max=cut,
                missing_returns_known=bool(options.missing_returns_free),
            )
            for name in sensors
        ),
        track=track,
        chosen=f"{', '.join(sensors)}; poses: {source}",
        opening=faults,
        read=_Sweeps(
            readings={name: topics[name] for name in sensors},
            window=window_of(track, start, options),
            mount=options.mount or IDENTITY,
            limits=Limits(0.0, FARTHEST, cut, beyond_is_none=False),
        ),
    )


@dataclass(frozen=True)
class _Sweeps:
    """The readings of the distance sensors, each a sweep of one beam.

    Attributes:
        readings: Columns by the name of the sensor.
        window: Times that are read.
        mount: T_body_sensor of all of them; a reading has its direction.
        limits: Limits of the ranges.
    """

    readings: dict[str, Fields]
    window: Window
    mount: Transform
    limits: Limits

    def __call__(self, faults: Faults) -> Iterator[RecordedSweep]:
        """Yield the sweeps in order of time."""
        listed = []
        for name, fields in self.readings.items():
            stamps = fields["timestamp"].astype(np.int64) * 1000
            kept = in_order(stamps)
            faults[OUT_OF_ORDER] += len(stamps) - len(kept)
            listed += [(int(stamps[k]), name, k) for k in kept.tolist()]
        for stamp, name, k in sorted(listed):
            if not self.window.holds(stamp) or not self.window.has_pose(stamp, None, faults):
                continue
            try:
                points = _points(self.readings[name], k)
            except Broken as error:
                faults[f"message: cannot be read, {error}"] += 1
                continue
            beams = point_beams(points, None, self.limits, faults)
            if not len(beams.ranges):
                faults[NO_BEAM] += 1
                continue
            yield RecordedSweep(
                time_ns=stamp - self.window.start_ns,
                sensor=name,
                directions=beams.directions,
                ranges=beams.ranges,
                beam_times_ns=None,
                T_body_sensor=self.mount,
                points=beams.points,
            )


def _points(fields: Fields, k: int) -> NDArray[np.float32]:
    """Return the point of a reading, (1, 3), or none, (0, 3)."""
    quality = fields.get("signal_quality")
    q = np.array([fields[f"q[{axis}]"][k] if f"q[{axis}]" in fields else 0.0 for axis in range(4)])
    points = px4.met_points(
        np.array([fields["current_distance"][k]], np.float64),
        px4.direction(int(fields["orientation"][k]), q),
        (float(fields["min_distance"][k]), float(fields["max_distance"][k])),
        np.array([-1 if quality is None else quality[k]]),
    )
    return points[np.isfinite(points[:, 0])]


def _topics(path: Path, faults: Faults) -> dict[str, Fields]:
    """Return the columns of the topics that are read, by name; a second instance ends on `_1`.

    Raises:
        InputError: `pyulog` is not installed, or it cannot read the file.
    """
    try:
        from pyulog import ULog
    except ImportError:
        raise InputError(
            "ULog: pyulog is not installed: pip install pyulog (the extra 'recordings')"
        ) from None
    try:
        log = ULog(str(path), [ODOMETRY, LOCAL, ATTITUDE, DISTANCE])
    except Exception as error:  # it fails in many ways on bytes of no ULog
        raise InputError(
            f"recording '{path}': cannot be read as ULog ({type(error).__name__}: "
            f"{' '.join(str(error).split())[:100]})"
        ) from None
    faults["bag: dropout while it was logged"] += len(log.dropouts)
    if log.file_corruption:
        faults["bag: damaged chunk or record"] += 1
    return {
        one.name + f"_{one.multi_id}" * (one.multi_id > 0): one.data
        for one in log.data_list
        if len(one.data["timestamp"])
    }


def _sensors(path: Path, topics: dict[str, Fields], options: RecordingOptions) -> list[str]:
    known = sorted(name for name in topics if name.startswith(DISTANCE))
    if not known:
        raise InputError(
            f"recording '{path}': no {DISTANCE} in it (topics that are read: "
            f"{', '.join(sorted(topics)) or 'none'})"
        )
    for given in options.sensors:
        if given not in known:
            raise unknown_name("sensor of the recording", given, known)
    if len(known) > 1 and not options.sensors:
        raise InputError(f"recording '{path}': several sensors, choose: {', '.join(known)}")
    return list(options.sensors) or known


def _poses(
    path: Path, topics: dict[str, Fields], options: RecordingOptions, faults: Faults
) -> tuple[StampedPoses, str]:
    """Return the poses of the body in our frames, and their source."""
    known = [name for name in (ODOMETRY, LOCAL) if name in topics]
    if not known:
        raise InputError(f"recording '{path}': no {ODOMETRY} and no {LOCAL} in it")
    if options.pose is not None and options.pose not in known:
        raise unknown_name("poses of the recording", options.pose, known)
    name = options.pose or known[0]
    fields = topics[name]
    stamps = _stamps(fields)
    for counter in ("reset_counter", "xy_reset_counter", "z_reset_counter"):
        if counter in fields:
            faults[RESET] += int((np.diff(fields[counter].astype(np.int64)) != 0).sum())
    if name == ODOMETRY:
        is_new = "pose_frame" in fields
        frames = fields["pose_frame"] if is_new else fields["local_frame"].astype(int) + 1
        if len(set(frames.tolist())) > 1 or frames[0] not in (px4.NED, px4.FRD):
            raise InputError(
                f"recording '{path}': {name} in the frames {sorted(set(frames.tolist()))}, "
                f"expected one, NED ({px4.NED}) or FRD ({px4.FRD})"
            )
        columns = [f"position[{axis}]" for axis in range(3)] if is_new else ["x", "y", "z"]
        quaternions = _columns(fields, [f"q[{axis}]" for axis in range(4)])
        frd = bool(frames[0] == px4.FRD)
        return StampedPoses(
            stamps, *px4.to_ours(_columns(fields, columns), quaternions, frd=frd)
        ), name
    positions = _columns(fields, ["x", "y", "z"])
    positions[fields["xy_valid"] == 0, :2] = np.nan
    positions[fields["z_valid"] == 0, 2] = np.nan
    heading = fields["heading"] if "heading" in fields else fields["yaw"]
    poses = StampedPoses(stamps, *px4.to_ours(positions, px4.level(heading)))
    if ATTITUDE not in topics:
        return poses, f"{name}, taken to be level: no {ATTITUDE}"
    turns = topics[ATTITUDE]
    quaternions = _columns(turns, [f"q[{axis}]" for axis in range(4)])
    attitudes = StampedPoses(
        _stamps(turns), *px4.to_ours(np.zeros((len(quaternions), 3)), quaternions)
    )
    return px4.turned(poses, attitudes), f"{name}, turned as {ATTITUDE}"


def _stamps(fields: Fields) -> NDArray[np.int64]:
    published = fields["timestamp"]
    return px4.sampled_us(published, fields.get("timestamp_sample", published)) * 1000


def _columns(fields: Fields, names: list[str]) -> NDArray[np.float64]:
    return np.column_stack([fields[name].astype(np.float64) for name in names])
