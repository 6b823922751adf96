"""Sensors of a bag: the beams that their messages describe."""

from __future__ import annotations

from bisect import bisect_right
from collections import Counter
from operator import itemgetter
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayproof.harness.input_messages import beams_from_info
from wayproof.harness.recordings.bags.clouds import (
    LONGEST_SHARE,
    PointTime,
    finite,
    offsets_ns,
    point_time,
    read_cloud,
)
from wayproof.harness.recordings.bags.container import RawMessage
from wayproof.harness.recordings.bags.messages import (
    CLOUDS,
    IMAGE,
    SCAN,
    Camera,
    decode,
)
from wayproof.harness.recordings.bags.parts import frame_name, stamp_of
from wayproof.harness.recordings.beams import (
    FARTHEST,
    Beams,
    Limits,
    Silent,
    measured_beams,
    point_beams,
    scan_beams,
)
from wayproof.harness.recordings.depth import depth_beams, depths_of
from wayproof.harness.recordings.options import Broken, Faults, RecordingOptions
from wayproof.harness.recordings.types import SensorKind
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.models.sensors.beams import (
    NO_RETURN,
    directions,
    ray_ranges,
)

DEPTH_ENCODINGS = {"16UC1": "u2", "mono16": "u2", "32FC1": "f4"}
"""Encodings of depth images, REP 118: millimetres, and metres."""

MILLIMETRES = 1000.0
LONGEST_SCAN_NS = 10e9

DEEPEST = 200.0
"""Median depth of an image beyond which it is not in metres, m."""

LEAST_SHARE = 0.02
"""Share of the time of a scan that its beams take at least."""

AT_ONCE = "sweep: beams without times in a scan that takes time"
MOST_ANGLE = 100.0


class Topic(NamedTuple):
    """Properties of a sensor by its first message, constant over the bag.

    Attributes:
        kind: Kind of the sensor.
        frame: Frame of its beams.
        range_min: Minimum range, m.
        range_max: Maximum range, m; inf where it is not stated.
        time: Field with the time of a point.
        cameras: Geometry of the images from stamps on, ns, in order.
        maximum_varies: Whether its maximum range is another one from message to message.
        declared: Declaration of a sensor whose ranges are recorded as it measured them.
        period_ns: Time from one message to the next, ns; None where it is not known.
    """

    kind: SensorKind
    frame: str
    range_min: float
    range_max: float
    time: PointTime | None = None
    cameras: tuple[tuple[int, Camera], ...] = ()
    maximum_varies: bool = False
    declared: pb.SensorInfo | None = None
    period_ns: float | None = None


def is_sensor(raw: RawMessage) -> bool:
    """Return whether a message is one of ranges, points or depths, not a picture.

    Raises:
        Broken: It cannot be read.
    """
    message = decode(raw)
    return raw.type != IMAGE or message.encoding in DEPTH_ENCODINGS


def measured_by(info: pb.SensorInfo) -> Topic:
    """Return the properties of a sensor whose ranges are recorded as it measured them."""
    kind: SensorKind = "depth" if info.kind == "depth_camera" else "points"
    return Topic(kind, info.name, 0.0, info.range_m, declared=info)


def first_of(
    raw: RawMessage,
    cameras: tuple[tuple[int, Camera], ...],
    limits: tuple[float, float] = (0.0, np.inf),
    period_ns: float | None = None,
) -> Topic:
    """Read a sensor's properties from the first message of its topic.

    Args:
        raw: The message.
        cameras: Geometry of the images from stamps on, ns.
        limits: Limits of points or depths, m, which their messages do not state.
        period_ns: Time from one message to the next, ns.

    Raises:
        Broken: It cannot be read.
    """
    if raw.type == SCAN:
        scan = decode(raw)
        low, high = scan_limits(scan.range_min, scan.range_max)
        frame = frame_name(scan.header.frame_id)
        return Topic("laser", frame, low, high, period_ns=period_ns)
    if raw.type in CLOUDS:
        cloud = read_cloud(raw)
        time = point_time(finite(cloud, Counter()), period_ns)
        return Topic("points", frame_name(cloud.frame), *limits, time, period_ns=period_ns)
    frame = frame_name(decode(raw).header.frame_id)
    return Topic("depth", frame, *limits, cameras=cameras)


def finite_points(raw: RawMessage) -> int:
    """Return the number of finite points of a cloud; 0 of one that cannot be read.

    A driver that starts up sends clouds of no points, of few or of none that are finite.
    """
    try:
        return len(finite(read_cloud(raw), Counter()).points)
    except Broken:
        return 0


def beams_of(
    raw: RawMessage,
    topic: Topic,
    limits: Limits,
    options: RecordingOptions,
    silent: Silent | None,
    faults: Faults,
) -> Beams:
    """Return the beams of a message, with those without return that were recorded beside it.

    Args:
        raw: The message.
        topic: Properties of its sensor.
        limits: Limits of the ranges.
        options: Stride and scale of depth images.
        silent: Beams without return.
        faults: Counts readings that say nothing.

    Raises:
        Broken: It cannot be read.
    """
    if topic.kind == "points" and topic.declared is None:
        return _of_cloud(raw, topic, limits, silent, faults)
    message = decode(raw)
    if topic.declared is not None:
        return _as_measured(message, topic.declared, limits.cut, faults)
    if topic.kind == "laser":
        return _of_scan(message, topic, limits, faults)
    depths, camera = _depths(message, topic, options)
    return depth_beams(depths, camera.intrinsics, options.pixel_stride, limits, faults)


def _of_scan(message: Any, topic: Topic, limits: Limits, faults: Faults) -> Beams:
    low, high = scan_limits(message.range_min, message.range_max)
    angles = float(message.angle_min), float(message.angle_increment)
    count = len(message.ranges)
    if not all(abs(angle) < MOST_ANGLE for angle in (*angles, angles[1] * count)):
        raise Broken(f"a scan of {count} beams from {angles[0]:g} by {angles[1]:g} rad")
    last = float(message.angle_max) - angles[0] - angles[1] * (count - 1)
    if abs(last) > 2.0 * abs(angles[1]) + 0.05 * abs(angles[1]) * count:
        raise Broken(f"a scan of {count} beams by {angles[1]:g} rad to {message.angle_max:g} rad")
    step = float(message.time_increment)
    period = float(message.scan_time) * 1e9
    if not 0.0 < period <= LONGEST_SCAN_NS:
        period = topic.period_ns or LONGEST_SCAN_NS / LONGEST_SHARE
    if not abs(step) * count * 1e9 <= LONGEST_SHARE * period:
        raise Broken(f"a scan of {count} beams {step:g} s apart in {period / 1e9:g} s")
    if abs(step) * count * 1e9 < LEAST_SHARE * float(message.scan_time) * 1e9:
        faults[AT_ONCE] += 1
    ranges = np.asarray(message.ranges)
    # Older drivers write the maximum where nothing came back; laser_geometry drops it, too.
    # Some write the largest reading of each scan as its maximum, which is then a return.
    if not topic.maximum_varies:
        ranges = np.where(ranges == np.float32(high), np.float32(np.inf), ranges)
    own = limits._replace(range_min=low, range_max=min(high, FARTHEST))
    return scan_beams(angles, written=ranges, limits=own, faults=faults, time_increment_s=step)


def _of_cloud(
    raw: RawMessage, topic: Topic, limits: Limits, silent: Silent | None, faults: Faults
) -> Beams:
    cloud = finite(read_cloud(raw), faults)
    times = None
    if topic.time is not None and len(cloud.points):
        if cloud.time_field != topic.time.name:
            raise Broken("a cloud without the time of its points")
        found = offsets_ns(cloud, topic.time, faults)
        if found is None:
            raise Broken("a cloud of points of other times")
        times, kept = found
        cloud = cloud._replace(points=cloud.points[kept])
    return point_beams(cloud.points, times, limits, faults, silent)


def _as_measured(message: Any, info: pb.SensorInfo, range_max: float, faults: Faults) -> Beams:
    """Return the beams of an image of ranges, and the ranges themselves as they count."""
    beams = beams_from_info(info)
    table = beams.table
    shape = len(table.rows), len(table.columns)
    if message.encoding != "16UC1" or (message.height, message.width) != shape:
        raise Broken("an image of other ranges than the sensor's")
    measured = pixels_of(message).reshape(-1).astype(np.uint16)
    along = ray_ranges(table, directions(table, 0), measured)
    measured[(along > range_max * MILLIMETRES) & (along != NO_RETURN)] = NO_RETURN
    return measured_beams(beams, measured, 0, range_max, faults)


def _depths(
    message: Any, topic: Topic, options: RecordingOptions
) -> tuple[NDArray[np.float64], Camera]:
    """Return the depths of an image (rows, columns), m, and its camera."""
    place = bisect_right(topic.cameras, stamp_of(message.header), key=itemgetter(0))
    camera = topic.cameras[max(place - 1, 0)][1] if topic.cameras else None
    if message.encoding not in DEPTH_ENCODINGS or camera is None:
        raise Broken(f"an image of encoding '{message.encoding[:20]}'")
    if camera.width and (message.width, message.height) != (camera.width, camera.height):
        raise Broken("an image of another size than the camera")
    pixels = pixels_of(message)
    scale = (options.depth_scale or MILLIMETRES) if pixels.dtype.kind == "u" else 1.0
    depths = depths_of(pixels, scale)
    known = depths[np.isfinite(depths) & (depths > 0.0)]
    if len(known) and np.median(known) > DEEPEST:
        raise Broken(f"an image of depths of {np.median(known):g} m, expected metres")
    return depths, camera


def pixels_of(message: Any) -> NDArray[Any]:  # (rows, columns)
    """Return the pixels of an image of one of `DEPTH_ENCODINGS`.

    Raises:
        Broken: It has none, or its sizes do not agree.
    """
    rows, columns, step = int(message.height), int(message.width), int(message.step)
    kind = np.dtype((">" if message.is_bigendian else "<") + DEPTH_ENCODINGS[message.encoding])
    if rows == 0 or columns == 0:
        raise Broken("an image without pixels")
    if step < columns * kind.itemsize or len(message.data) < rows * step:
        raise Broken("an image whose sizes do not agree")
    lines = np.asarray(message.data)[: rows * step].reshape(rows, step)
    return np.ascontiguousarray(lines[:, : columns * kind.itemsize]).view(kind)


def scan_maximum(raw: RawMessage) -> float:
    """Return the maximum range that a scan states, m; inf of one that cannot be read."""
    try:
        message = decode(raw)
    except Broken:
        return np.inf
    return scan_limits(message.range_min, message.range_max)[1]


def scan_limits(low: float, high: float) -> tuple[float, float]:
    """Return the limits that a message states, m: 0 and inf where they make no sense."""
    return (
        float(low) if 0.0 <= low <= FARTHEST else 0.0,
        float(high) if 0.0 < high <= FARTHEST else np.inf,
    )
