"""ROS 2 messages that travel: their types and their CDR by `rosbags`. Times are ROS time.

Neither fields nor order have changed from Foxy to Kilted.
"""

from __future__ import annotations

from typing import ClassVar, Protocol, TypeVar, cast

from wayproof.harness.errors import InputError

try:
    from rosbags.serde import SerdeError
    from rosbags.typesys import Stores, get_typestore
    from rosbags.typesys.stores import ros2_jazzy as jazzy
except ImportError:
    raise InputError("--stack ros2 needs rosbags: pip install rosbags (the extra 'ros2')") from None

STORE = get_typestore(Stores.ROS2_JAZZY)

Time = jazzy.builtin_interfaces__msg__Time
Header = jazzy.std_msgs__msg__Header
String = jazzy.std_msgs__msg__String
Clock = jazzy.rosgraph_msgs__msg__Clock
Vector3 = jazzy.geometry_msgs__msg__Vector3
Point = jazzy.geometry_msgs__msg__Point
Quaternion = jazzy.geometry_msgs__msg__Quaternion
Pose = jazzy.geometry_msgs__msg__Pose
PoseStamped = jazzy.geometry_msgs__msg__PoseStamped
PoseWithCovariance = jazzy.geometry_msgs__msg__PoseWithCovariance
Twist = jazzy.geometry_msgs__msg__Twist
TwistStamped = jazzy.geometry_msgs__msg__TwistStamped
TwistWithCovariance = jazzy.geometry_msgs__msg__TwistWithCovariance
Transform = jazzy.geometry_msgs__msg__Transform
TransformStamped = jazzy.geometry_msgs__msg__TransformStamped
TFMessage = jazzy.tf2_msgs__msg__TFMessage
Odometry = jazzy.nav_msgs__msg__Odometry
Path = jazzy.nav_msgs__msg__Path
MapMetaData = jazzy.nav_msgs__msg__MapMetaData
OccupancyGrid = jazzy.nav_msgs__msg__OccupancyGrid
LaserScan = jazzy.sensor_msgs__msg__LaserScan
PointField = jazzy.sensor_msgs__msg__PointField
PointCloud2 = jazzy.sensor_msgs__msg__PointCloud2
Image = jazzy.sensor_msgs__msg__Image
RegionOfInterest = jazzy.sensor_msgs__msg__RegionOfInterest
CameraInfo = jazzy.sensor_msgs__msg__CameraInfo

LEVEL = Quaternion(0.0, 0.0, 0.0, 1.0)
"""Orientation that turns nothing."""


class Message(Protocol):
    """A message of `rosbags`."""

    __msgtype__: ClassVar[str]


M = TypeVar("M", bound=Message)


class CdrError(ValueError):
    """Bytes that are no message of the type, in one line."""


def encode(message: Message) -> bytes:
    """Encode a message, with the header of the encapsulation."""
    return bytes(STORE.serialize_cdr(message, message.__msgtype__, little_endian=True))


def decode(kind: type[M], data: bytes) -> M:
    """Decode a message.

    Raises:
        CdrError: They end early, or are in another encoding.
    """
    try:
        return cast(M, STORE.deserialize_cdr(data, kind.__msgtype__))
    except (SerdeError, AssertionError, IndexError) as error:
        raise CdrError(" ".join(str(error).split())) from None


def time_of(time_ns: int) -> Time:
    """Return a time of nanoseconds."""
    return Time(*divmod(time_ns, 1_000_000_000))


def nanoseconds(time: Time) -> int:
    """Return a time in nanoseconds."""
    return time.sec * 1_000_000_000 + time.nanosec
