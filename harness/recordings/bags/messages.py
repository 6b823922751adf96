"""Messages of ROS that a recording needs, decoded by the definitions of `rosbags`."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayproof.harness.errors import InputError
from wayproof.harness.recordings.bags.container import NO_ROSBAGS, RawMessage
from wayproof.harness.recordings.bags.parts import StampedTransform, frame_name, stamp_of
from wayproof.harness.recordings.bags.vendors import VENDORS, px4
from wayproof.harness.recordings.options import Broken, Intrinsics, usable

if TYPE_CHECKING:
    from rosbags.typesys.store import Typestore

SCAN = "sensor_msgs/msg/LaserScan"
CLOUD = "sensor_msgs/msg/PointCloud2"
IMAGE = "sensor_msgs/msg/Image"
RANGE = "sensor_msgs/msg/Range"
CAMERA = "sensor_msgs/msg/CameraInfo"
ODOMETRY = "nav_msgs/msg/Odometry"
POSE = "geometry_msgs/msg/PoseStamped"
POSE_COVARIANCE = "geometry_msgs/msg/PoseWithCovarianceStamped"
TEXT = "std_msgs/msg/String"
TRANSFORMS = ("tf2_msgs/msg/TFMessage", "tf/msg/tfMessage")

VENDOR_POSES = {kind: read for one in VENDORS for kind, read in one.poses.items()}
CLOUDS = (CLOUD, *(kind for one in VENDORS for kind in one.clouds))
SENSORS = (SCAN, *CLOUDS, IMAGE)
POSES = (ODOMETRY, POSE, POSE_COVARIANCE, *VENDOR_POSES)
GRIDS = {kind: read for one in VENDORS for kind, read in one.grids.items()}
DECODERS = {kind: read for one in VENDORS for kind, read in one.decoders.items()}

ROS1_DEFINITIONS = {name: "geometry_msgs/TransformStamped[] transforms\n" for name in TRANSFORMS}
"""Definitions of messages of ROS 1 that `rosbags` has for ROS 2 alone."""


class Camera(NamedTuple):
    """Geometry of a camera's images, in pixels.

    Attributes:
        width: Columns.
        height: Rows.
        intrinsics: fx, fy, cx, cy.
        rectified: fx, fy, cx, cy of its rectified images; None where they are not stated.
        distorted: Whether its lens has a distortion.
    """

    width: int
    height: int
    intrinsics: Intrinsics
    distorted: bool
    rectified: Intrinsics | None = None


@lru_cache(maxsize=2)
def typestore(encoding: str) -> Typestore:
    """Return the definitions of ROS 1 for the encoding `ros1`, else those of ROS 2.

    Raises:
        InputError: `rosbags` is not installed.
    """
    try:
        from rosbags.typesys import Stores, get_types_from_msg, get_typestore
    except ImportError:
        raise InputError(NO_ROSBAGS) from None
    ros1 = encoding == "ros1"
    store = get_typestore(Stores.ROS1_NOETIC if ros1 else Stores.ROS2_JAZZY)
    of_vendors = [one.definitions for one in VENDORS]
    for definitions in (ROS1_DEFINITIONS if ros1 else {}, *of_vendors):
        for name, definition in definitions.items():
            store.register(get_types_from_msg(definition, name))
    return store


def decode(raw: RawMessage) -> Any:  # the classes of rosbags are made when it runs
    """Decode a message.

    Raises:
        Broken: Its bytes are not those of its type.
    """
    if raw.type in DECODERS:
        return DECODERS[raw.type](raw.data)
    store = typestore(raw.encoding)
    read: Callable[[bytes, str], object]
    read = store.deserialize_ros1 if raw.encoding == "ros1" else store.deserialize_cdr
    try:
        return read(raw.data, raw.type)
    except Exception as error:  # generated code fails in many ways on bytes of another type
        raise Broken(f"{raw.type}: {type(error).__name__}") from None


def header_stamp(raw: RawMessage) -> int:
    """Return the stamp of a message that begins with a header or is of PX4, ns, undecoded.

    Raises:
        Broken: It is too short.
    """
    data = raw.data[:12]
    if len(data) < 12:
        raise Broken("a message shorter than a header")
    if raw.type in DECODERS:
        return px4.stamp_ns(data)
    if raw.encoding == "ros1":
        seconds, fraction = np.frombuffer(data, "<u4", 2, 4).tolist()
    else:
        order = "<" if data[1] & 1 else ">"
        seconds = int(np.frombuffer(data, f"{order}i4", 1, 4)[0])
        fraction = int(np.frombuffer(data, f"{order}u4", 1, 8)[0])
    return int(seconds) * 10**9 + int(fraction)


def frame_of(raw: RawMessage) -> str:
    """Return the frame of a message that begins with a header or is of PX4, undecoded."""
    if raw.type in DECODERS:
        return px4.BODY
    data = raw.data[:512]
    order = "<" if raw.encoding == "ros1" or (len(data) > 1 and data[1] & 1) else ">"
    size = int(np.frombuffer(data, f"{order}u4", 1, 12)[0]) if len(data) >= 16 else 0
    text = data[16 : 16 + size].rstrip(b"\0")
    return frame_name(str(text, "utf-8", "replace"))


def pose_of(raw: RawMessage) -> StampedTransform:
    """Return the pose of a message of `POSES`.

    Raises:
        Broken: As of `decode`.
    """
    message = decode(raw)
    if raw.type in VENDOR_POSES:
        return VENDOR_POSES[raw.type](message)
    pose = message.pose if raw.type == POSE else message.pose.pose
    child = message.child_frame_id if raw.type == ODOMETRY else ""
    parent = frame_name(message.header.frame_id)
    numbers = _numbers(pose.position, pose.orientation)
    return StampedTransform(stamp_of(message.header), parent, frame_name(child), numbers)


def transforms_of(raw: RawMessage) -> list[StampedTransform]:
    """Return the transforms of a TFMessage.

    Raises:
        Broken: As of `decode`.
    """
    return [
        StampedTransform(
            stamp_of(one.header),
            frame_name(one.header.frame_id),
            frame_name(one.child_frame_id),
            _numbers(one.transform.translation, one.transform.rotation),
        )
        for one in decode(raw).transforms
    ]


def camera_of(raw: RawMessage) -> Camera:
    """Return the geometry that a CameraInfo states.

    Raises:
        Broken: As of `decode`, or it is not calibrated.
    """
    message = decode(raw)
    K, D, P = (getattr(message, name if raw.encoding == "ros1" else name.lower()) for name in "KDP")
    bins = max(int(message.binning_x), 1), max(int(message.binning_y), 1)
    roi = message.roi
    sizes = int(roi.width or message.width), int(roi.height or message.height)

    def of_images(numbers: NDArray[np.float64]) -> Intrinsics | None:
        """Return fx, fy, cx, cy of the images from those of the whole sensor, without binning."""
        fx, fy, cx, cy = (float(value) for value in numbers)
        cx, cy = cx - int(roi.x_offset), cy - int(roi.y_offset)
        # The centre of the first pixel is 0: of the first two, binned, it is 0.5 of the old pixels.
        centre = (cx + 0.5) / bins[0] - 0.5, (cy + 0.5) / bins[1] - 0.5
        found = fx / bins[0], fy / bins[1], *centre
        return found if usable(found) else None

    own, rectified = of_images(K[[0, 4, 2, 5]]), of_images(P[[0, 5, 2, 6]])
    if own is None and rectified is None:
        raise Broken("a camera without intrinsics")
    is_bent = own is not None and bool((D != 0.0).any())  # drivers of rectified images fill P alone
    own = own or rectified
    assert own is not None
    return Camera(sizes[0] // bins[0], sizes[1] // bins[1], own, is_bent, rectified)


def _numbers(p: Any, q: Any) -> tuple[float, float, float, float, float, float, float]:
    return float(p.x), float(p.y), float(p.z), float(q.w), float(q.x), float(q.y), float(q.z)
