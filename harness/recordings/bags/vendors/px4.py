"""Messages of PX4, `px4_msgs`: odometry, local position, attitude, and distance sensors.

They are read by their layout, as their definitions change from release to release: those of 1.12
to 1.18 begin alike, and the size tells two of the odometry apart. PX4's world is north, east, down
(NED), or forward, right, down (FRD), and its body forward, right, down; ours are east, north, up
(REP 103), or forward, left, up, and forward, left, up.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wayproof.harness.recordings.bags.parts import Cloud, StampedTransform, Vendor
from wayproof.harness.recordings.options import Broken
from wayproof.harness.recordings.poses import StampedPoses, sound
from wayproof.harness.recordings.track import RecordedTrack
from wayproof.harness.recordings.transform import Transform, compose, rotate

WORLD, BODY = "odom", "base_link"

ODOMETRY = "px4_msgs/msg/VehicleOdometry"
LOCAL = "px4_msgs/msg/VehicleLocalPosition"
ATTITUDE = "px4_msgs/msg/VehicleAttitude"
DISTANCE = "px4_msgs/msg/DistanceSensor"

LATEST_US = 1_000_000
"""Greatest age of the data of an estimate, microseconds; above it the stamp of its data is none."""

LONGEST_TURN_NS = 500_000_000
"""Greatest time between two attitudes between which one is interpolated, ns."""

_HALF = float(np.sqrt(0.5))
FLIP = Transform(np.zeros(3), np.array([0.0, 1.0, 0.0, 0.0]))
"""Forward, right, down to forward, left, up, and back."""

TO_ENU = Transform(np.zeros(3), np.array([0.0, _HALF, _HALF, 0.0]))
"""North, east, down to east, north, up."""

NED, FRD = 1, 2
"""Frames of an odometry, as of `POSE_FRAME`; releases before 1.14 count from 0."""

UP, DOWN, CUSTOM = 24, 25, 100
"""Orientations of a distance sensor beside the eighths of a turn to the right."""


def _layout(size: int, *fields: tuple[str, str, int]) -> np.dtype[Any]:
    names, formats, offsets = zip(*fields, strict=True)
    return np.dtype({"names": names, "formats": formats, "offsets": offsets, "itemsize": size})


_TIMES = ("timestamp", "<u8", 0), ("timestamp_sample", "<u8", 8)
_ODOMETRY = (*_TIMES, ("frame", "u1", 16), ("position", "(3,)<f4", 20), ("q", "(4,)<f4", 32))
LAYOUTS: dict[str, dict[int, np.dtype[Any]]] = {
    ODOMETRY: {
        114: _layout(114, *_ODOMETRY, ("reset_counter", "u1", 112)),
        260: _layout(260, *_ODOMETRY),
        261: _layout(261, *_ODOMETRY, ("reset_counter", "u1", 260)),
    },
    LOCAL: {
        180: _layout(
            180,
            *_TIMES,
            ("xy_valid", "?", 16),
            ("z_valid", "?", 17),
            ("position", "(3,)<f4", 20),
            ("xy_reset_counter", "u1", 40),
            ("z_reset_counter", "u1", 48),
            ("heading", "<f4", 100),
        )
    },
    ATTITUDE: {49: _layout(49, *_TIMES, ("q", "(4,)<f4", 16))},
    DISTANCE: {
        57: _layout(
            57,
            ("timestamp", "<u8", 0),
            ("min_distance", "<f4", 12),
            ("max_distance", "<f4", 16),
            ("current_distance", "<f4", 20),
            ("signal_quality", "i1", 28),
            ("q", "(4,)<f4", 40),
            ("orientation", "u1", 56),
        )
    },
}
"""Type -> size of a message, bytes -> fields that are read."""

LONGER = {LOCAL: 40, DISTANCE: 1}
"""Bytes that later releases have added."""

PADDING = 3

CDR_HEAD = b"\0\1\0\0"
"""Head of a message of CDR, little-endian."""

ULOG = {
    "vehicle_odometry": ODOMETRY,
    "vehicle_local_position": LOCAL,
    "vehicle_attitude": ATTITUDE,
    "distance_sensor": DISTANCE,
}
"""Topics of ULog, PX4's log on board, and the messages that they are sent as
(https://docs.px4.io/main/en/dev_log/ulog_file_format.html)."""

ULOG_NAMES = {"frame": ["pose_frame"], "position": ["x", "y", "z"]}
OLD_ULOG_NAMES = {"frame": ["local_frame"], "heading": ["yaw"]}
"""Columns of ULog of other names than the fields of messages."""

ULOG_OPTIONAL = (
    *("timestamp_sample", "signal_quality"),
    *("reset_counter", "xy_reset_counter", "z_reset_counter"),
)


def decoded(kind: str, data: bytes) -> Any:
    """Return the fields of a message of CDR as a record.

    Raises:
        Broken: Its size is that of no release from 1.12 on.
    """
    size = len(data) - 4
    for least, layout in LAYOUTS[kind].items():
        if size >= least and size - least <= LONGER.get(kind, 0) + PADDING * (size % 4 == 0):
            order = layout if data[1] & 1 else layout.newbyteorder(">")
            return np.frombuffer(data, order, 1, 4)[0]
    raise Broken(f"{kind} of {size} bytes, expected px4_msgs of 1.12 or later")


def messages_of_ulog(
    topic: str, columns: Mapping[str, NDArray[Any]]
) -> Iterator[tuple[str, int, bytes]]:
    """Yield the rows of a topic of ULog as messages: type, stamp, ns, and bytes of CDR.

    Of a topic that is not read nothing.

    Raises:
        Broken: A column is missing.
    """
    kind = ULOG.get(topic)
    if kind is None:
        return
    layout = list(LAYOUTS[kind].values())[-1 if "local_frame" in columns else 0]
    rows = np.zeros(len(columns["timestamp"]), layout)
    for name in layout.names or ():
        field = rows[name]
        parts = [f"{name}[{axis}]" for axis in range(field[0].size)] if field.ndim > 1 else [name]
        choices = (parts, ULOG_NAMES.get(name, parts), OLD_ULOG_NAMES.get(name, parts))
        known = next((one for one in choices if set(one) <= columns.keys()), None)
        if known is not None:
            rows[name] = np.column_stack([columns[one] for one in known]).reshape(field.shape)
        elif name not in ULOG_OPTIONAL and (name, kind) != ("q", DISTANCE):
            raise Broken(f"{topic} without {name}")
    if kind == DISTANCE and "signal_quality" not in columns:
        rows["signal_quality"] = -1
    for row in rows:
        yield kind, int(row["timestamp"]) * 1000, CDR_HEAD + row.tobytes()


def to_ours(positions: NDArray[Any], quaternions: NDArray[Any], *, frd: bool = False) -> Transform:
    """Return poses (..., 3), m, and (..., 4) of PX4's body in its world as those of ours."""
    theirs = Transform(np.asarray(positions, np.float64), np.asarray(quaternions, np.float64))
    return compose(compose(FLIP if frd else TO_ENU, theirs), FLIP)


def level(headings: NDArray[Any]) -> NDArray[np.float64]:  # (..., 4)
    """Return the quaternions of a level body by headings (...), rad, clockwise from north."""
    half = np.asarray(headings, np.float64) / 2.0
    zero = np.zeros_like(half)
    return np.stack([np.cos(half), zero, zero, np.sin(half)], axis=-1)


def turned(poses: StampedPoses, attitudes: StampedPoses) -> StampedPoses:
    """Return poses with the orientations of attitudes at their stamps; those without are left out.

    Both are in our frames; a rotation that is not finite is none.
    """
    good = sound(attitudes, Counter())
    if len(good.stamps_ns) == 0:
        return poses.at(np.zeros(len(poses.stamps_ns), bool))
    track = RecordedTrack(*good, source="attitude", max_gap_ns=LONGEST_TURN_NS)
    known = track.covers(poses.stamps_ns)
    return poses._replace(quaternions=track.at(poses.stamps_ns)[1]).at(known)


def direction(orientation: int, q: NDArray[Any]) -> NDArray[np.float64]:  # (3,)
    """Return where a distance sensor looks: forward, left, up.

    Raises:
        Broken: Its orientation is none of PX4's.
    """
    if orientation in (UP, DOWN):
        return np.array([0.0, 0.0, 1.0 if orientation == UP else -1.0])
    if orientation == CUSTOM:
        ahead = rotate(np.asarray(q, np.float64), np.array([1.0, 0.0, 0.0]))
        return np.array([ahead[0], -ahead[1], -ahead[2]])
    if orientation > 7:
        raise Broken(f"a distance sensor of the orientation {orientation}")
    angle = -np.pi / 4.0 * orientation
    return np.array([np.cos(angle), np.sin(angle), 0.0])


def sampled_us(published: NDArray[Any], sampled: NDArray[Any]) -> NDArray[np.int64]:
    """Return when estimates (n,) held: at the time of their data where that is near, us."""
    late, early = np.asarray(published, np.int64), np.asarray(sampled, np.int64)
    return np.where((early > 0) & (np.abs(late - early) <= LATEST_US), early, late)


def _pose(kind: str, message: Any) -> StampedTransform:
    stamp = int(sampled_us(message["timestamp"], message["timestamp_sample"])) * 1000
    position, frd, resets = np.zeros(3), False, 0
    if kind != ATTITUDE:
        position = message["position"].astype(np.float64)
    if kind == ODOMETRY:
        frame = int(message["frame"]) + (message.dtype.itemsize > 200)
        if frame not in (NED, FRD):
            raise Broken(f"an odometry of the frame {message['frame']}, expected NED or FRD")
        frd = frame == FRD
    if kind == LOCAL:
        known = [message["xy_valid"], message["xy_valid"], message["z_valid"]]
        position = np.where(known, position, np.nan)
        resets = 256 * int(message["xy_reset_counter"]) + int(message["z_reset_counter"])
        pose = to_ours(position, level(message["heading"]))
    else:
        pose = to_ours(position, message["q"], frd=frd)
    if "reset_counter" in (message.dtype.names or ()):
        resets = int(message["reset_counter"])
    x, y, z = pose.position.tolist()
    return StampedTransform(stamp, WORLD, BODY, (x, y, z, *pose.quaternion.tolist()), resets)


def _cloud(message: Any) -> Cloud:
    """Return the one point that a distance sensor has met, if any."""
    ahead = direction(int(message["orientation"]), message["q"])
    points = met_points(
        np.array([message["current_distance"]], np.float64),
        ahead,
        (float(message["min_distance"]), float(message["max_distance"])),
        np.array([message["signal_quality"]]),
    )
    stamp = int(message["timestamp"]) * 1000
    return Cloud(points[np.isfinite(points[:, 0])], None, "", stamp, BODY)


def met_points(
    distances: NDArray[Any],
    ahead: NDArray[np.float64],
    limits: tuple[float, float],
    quality: NDArray[Any],
) -> NDArray[np.float32]:  # (n, 3)
    """Return the points at distances (n,), m, NaN where none was met.

    A signal of the quality 0 is invalid, and a distance at or beyond the limits says nothing.
    """
    low, high = limits
    met = (distances > 0.0) & (distances >= low) & (distances < high) & (quality != 0)
    return (np.where(met, distances, np.nan)[:, None] * ahead).astype(np.float32)


def stamp_ns(data: bytes) -> int:
    """Return the stamp of a message of CDR, ns, without decoding it."""
    return int(np.frombuffer(data, "<u8" if data[1] & 1 else ">u8", 1, 4)[0]) * 1000


VENDOR = Vendor(
    clouds={DISTANCE: _cloud},
    poses={kind: partial(_pose, kind) for kind in (ODOMETRY, LOCAL, ATTITUDE)},
    decoders={kind: partial(decoded, kind) for kind in LAYOUTS},
)
