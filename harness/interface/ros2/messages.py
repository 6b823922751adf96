"""ROS 2 messages that travel, as in the `.msg` files of common_interfaces, Jazzy.

Each is final: neither fields nor order have changed from Foxy to Kilted. Times are ROS time.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray


class Code(NamedTuple):
    """Encoding of a primitive field.

    Attributes:
        dtype: Dtype of numpy, without byte order.
        length: Elements of a fixed array; 0: a sequence, none: one value.
    """

    dtype: str
    length: int | None = None


bool_ = Annotated[bool, Code("?")]
uint8 = Annotated[int, Code("u1")]
int32 = Annotated[int, Code("i4")]
uint32 = Annotated[int, Code("u4")]
float32 = Annotated[float, Code("f4")]
float64 = Annotated[float, Code("f8")]
Int8s = Annotated[NDArray[np.int8], Code("i1", 0)]
Uint8s = Annotated[NDArray[np.uint8], Code("u1", 0)]
Float32s = Annotated[NDArray[np.float32], Code("f4", 0)]
Float64s = Annotated[NDArray[np.float64], Code("f8", 0)]
Float64x9 = Annotated[NDArray[np.float64], Code("f8", 9)]
Float64x12 = Annotated[NDArray[np.float64], Code("f8", 12)]
Float64x36 = Annotated[NDArray[np.float64], Code("f8", 36)]


@dataclass(frozen=True)
class Message:
    """Base class of messages."""

    TYPE: ClassVar[str]
    """Name as ROS prints it, such as `sensor_msgs/msg/LaserScan`."""


@dataclass(frozen=True)
class Time(Message):
    """Seconds and nanoseconds."""

    TYPE = "builtin_interfaces/msg/Time"
    sec: int32 = 0
    nanosec: uint32 = 0

    @classmethod
    def of(cls, time_ns: int) -> Time:
        """Make a time of nanoseconds."""
        return cls(*divmod(time_ns, 1_000_000_000))

    @property
    def ns(self) -> int:
        """The time in nanoseconds."""
        return self.sec * 1_000_000_000 + self.nanosec


@dataclass(frozen=True)
class Header(Message):
    """Time and frame."""

    TYPE = "std_msgs/msg/Header"
    stamp: Time = field(default_factory=Time)
    frame_id: str = ""


@dataclass(frozen=True)
class String(Message):
    """A text."""

    TYPE = "std_msgs/msg/String"
    data: str = ""


@dataclass(frozen=True)
class Clock(Message):
    """Simulated time."""

    TYPE = "rosgraph_msgs/msg/Clock"
    clock: Time = field(default_factory=Time)


@dataclass(frozen=True)
class Vector3(Message):
    """A vector."""

    TYPE = "geometry_msgs/msg/Vector3"
    x: float64 = 0.0
    y: float64 = 0.0
    z: float64 = 0.0


@dataclass(frozen=True)
class Point(Message):
    """A point, m."""

    TYPE = "geometry_msgs/msg/Point"
    x: float64 = 0.0
    y: float64 = 0.0
    z: float64 = 0.0


@dataclass(frozen=True)
class Quaternion(Message):
    """An orientation."""

    TYPE = "geometry_msgs/msg/Quaternion"
    x: float64 = 0.0
    y: float64 = 0.0
    z: float64 = 0.0
    w: float64 = 1.0


@dataclass(frozen=True)
class Pose(Message):
    """A position and an orientation."""

    TYPE = "geometry_msgs/msg/Pose"
    position: Point = field(default_factory=Point)
    orientation: Quaternion = field(default_factory=Quaternion)


@dataclass(frozen=True)
class PoseStamped(Message):
    """A pose in a frame."""

    TYPE = "geometry_msgs/msg/PoseStamped"
    header: Header = field(default_factory=Header)
    pose: Pose = field(default_factory=Pose)


@dataclass(frozen=True)
class PoseWithCovariance(Message):
    """A pose and its covariance, (6, 6) row-major: x, y, z, rotations about x, y, z."""

    TYPE = "geometry_msgs/msg/PoseWithCovariance"
    pose: Pose = field(default_factory=Pose)
    covariance: Float64x36 = field(default_factory=lambda: np.zeros(36))


@dataclass(frozen=True)
class Twist(Message):
    """A velocity, m/s, and an angular one, rad/s."""

    TYPE = "geometry_msgs/msg/Twist"
    linear: Vector3 = field(default_factory=Vector3)
    angular: Vector3 = field(default_factory=Vector3)


@dataclass(frozen=True)
class TwistStamped(Message):
    """A twist with a time and a frame."""

    TYPE = "geometry_msgs/msg/TwistStamped"
    header: Header = field(default_factory=Header)
    twist: Twist = field(default_factory=Twist)


@dataclass(frozen=True)
class TwistWithCovariance(Message):
    """A twist and its covariance, (6, 6) row-major."""

    TYPE = "geometry_msgs/msg/TwistWithCovariance"
    twist: Twist = field(default_factory=Twist)
    covariance: Float64x36 = field(default_factory=lambda: np.zeros(36))


@dataclass(frozen=True)
class Transform(Message):
    """A translation and a rotation."""

    TYPE = "geometry_msgs/msg/Transform"
    translation: Vector3 = field(default_factory=Vector3)
    rotation: Quaternion = field(default_factory=Quaternion)


@dataclass(frozen=True)
class TransformStamped(Message):
    """T_parent_child: from the header's frame, the parent, to the child's."""

    TYPE = "geometry_msgs/msg/TransformStamped"
    header: Header = field(default_factory=Header)
    child_frame_id: str = ""
    transform: Transform = field(default_factory=Transform)


@dataclass(frozen=True)
class TFMessage(Message):
    """Transforms of `/tf` and `/tf_static`."""

    TYPE = "tf2_msgs/msg/TFMessage"
    transforms: tuple[TransformStamped, ...] = ()


@dataclass(frozen=True)
class Odometry(Message):
    """Pose in the header's frame, twist in the child's."""

    TYPE = "nav_msgs/msg/Odometry"
    header: Header = field(default_factory=Header)
    child_frame_id: str = ""
    pose: PoseWithCovariance = field(default_factory=PoseWithCovariance)
    twist: TwistWithCovariance = field(default_factory=TwistWithCovariance)


@dataclass(frozen=True)
class Path(Message):
    """Poses along a path."""

    TYPE = "nav_msgs/msg/Path"
    header: Header = field(default_factory=Header)
    poses: tuple[PoseStamped, ...] = ()


@dataclass(frozen=True)
class MapMetaData(Message):
    """Resolution, m, size, cells, and pose of the corner of cell (0, 0)."""

    TYPE = "nav_msgs/msg/MapMetaData"
    map_load_time: Time = field(default_factory=Time)
    resolution: float32 = 0.0
    width: uint32 = 0
    height: uint32 = 0
    origin: Pose = field(default_factory=Pose)


@dataclass(frozen=True)
class OccupancyGrid(Message):
    """Cells row by row, x first: 0 to 100, -1 is unknown."""

    TYPE = "nav_msgs/msg/OccupancyGrid"
    header: Header = field(default_factory=Header)
    info: MapMetaData = field(default_factory=MapMetaData)
    data: Int8s = field(default_factory=lambda: np.zeros(0, np.int8))


@dataclass(frozen=True)
class LaserScan(Message):
    """Ranges of one plane, counter-clockwise about z, m."""

    TYPE = "sensor_msgs/msg/LaserScan"
    header: Header = field(default_factory=Header)
    angle_min: float32 = 0.0
    angle_max: float32 = 0.0
    angle_increment: float32 = 0.0
    time_increment: float32 = 0.0
    scan_time: float32 = 0.0
    range_min: float32 = 0.0
    range_max: float32 = 0.0
    ranges: Float32s = field(default_factory=lambda: np.zeros(0, np.float32))
    intensities: Float32s = field(default_factory=lambda: np.zeros(0, np.float32))


@dataclass(frozen=True)
class PointField(Message):
    """A channel of a point cloud; datatype 7 is float32."""

    TYPE = "sensor_msgs/msg/PointField"
    name: str = ""
    offset: uint32 = 0
    datatype: uint8 = 0
    count: uint32 = 0


@dataclass(frozen=True)
class PointCloud2(Message):
    """Points as bytes, whose layout the fields describe."""

    TYPE = "sensor_msgs/msg/PointCloud2"
    header: Header = field(default_factory=Header)
    height: uint32 = 0
    width: uint32 = 0
    fields: tuple[PointField, ...] = ()
    is_bigendian: bool_ = False
    point_step: uint32 = 0
    row_step: uint32 = 0
    data: Uint8s = field(default_factory=lambda: np.zeros(0, np.uint8))
    is_dense: bool_ = False


@dataclass(frozen=True)
class Image(Message):
    """An image, row by row from the top."""

    TYPE = "sensor_msgs/msg/Image"
    header: Header = field(default_factory=Header)
    height: uint32 = 0
    width: uint32 = 0
    encoding: str = ""
    is_bigendian: uint8 = 0
    step: uint32 = 0
    data: Uint8s = field(default_factory=lambda: np.zeros(0, np.uint8))


@dataclass(frozen=True)
class RegionOfInterest(Message):
    """Part of an image; all zeros is the whole."""

    TYPE = "sensor_msgs/msg/RegionOfInterest"
    x_offset: uint32 = 0
    y_offset: uint32 = 0
    height: uint32 = 0
    width: uint32 = 0
    do_rectify: bool_ = False


@dataclass(frozen=True)
class CameraInfo(Message):
    """Calibration of a camera: distortion d, intrinsics k, rectification r, projection p."""

    TYPE = "sensor_msgs/msg/CameraInfo"
    header: Header = field(default_factory=Header)
    height: uint32 = 0
    width: uint32 = 0
    distortion_model: str = ""
    d: Float64s = field(default_factory=lambda: np.zeros(0))
    k: Float64x9 = field(default_factory=lambda: np.zeros(9))
    r: Float64x9 = field(default_factory=lambda: np.zeros(9))
    p: Float64x12 = field(default_factory=lambda: np.zeros(12))
    binning_x: uint32 = 0
    binning_y: uint32 = 0
    roi: RegionOfInterest = field(default_factory=RegionOfInterest)
