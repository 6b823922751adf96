"""Values for every field of a ROS message: the same for rclpy's messages and for Wayproof's.

Without imports of either, as the two live in environments of their own.
"""

import re

MESSAGES = (
    "builtin_interfaces/msg/Time",
    "std_msgs/msg/Header",
    "std_msgs/msg/String",
    "rosgraph_msgs/msg/Clock",
    "geometry_msgs/msg/Vector3",
    "geometry_msgs/msg/Point",
    "geometry_msgs/msg/Quaternion",
    "geometry_msgs/msg/Pose",
    "geometry_msgs/msg/PoseStamped",
    "geometry_msgs/msg/PoseWithCovariance",
    "geometry_msgs/msg/Twist",
    "geometry_msgs/msg/TwistStamped",
    "geometry_msgs/msg/TwistWithCovariance",
    "geometry_msgs/msg/Transform",
    "geometry_msgs/msg/TransformStamped",
    "tf2_msgs/msg/TFMessage",
    "nav_msgs/msg/Odometry",
    "nav_msgs/msg/Path",
    "nav_msgs/msg/MapMetaData",
    "nav_msgs/msg/OccupancyGrid",
    "sensor_msgs/msg/LaserScan",
    "sensor_msgs/msg/PointField",
    "sensor_msgs/msg/PointCloud2",
    "sensor_msgs/msg/Image",
    "sensor_msgs/msg/RegionOfInterest",
    "sensor_msgs/msg/CameraInfo",
)


class Fill:
    """Counts up, so that no two fields have the same value."""

    def __init__(self, length):
        """Give sequences this many elements."""
        self.length, self.count = length, 0

    def number(self, kind):
        """The next value of a primitive type, as `.msg` files name them."""
        self.count += 1
        if kind in ("bool", "boolean"):
            return self.count % 2 == 1
        if kind.startswith("float") or kind == "double":
            return self.count + 0.25
        if kind.startswith("int"):
            return self.count % 100 - 50
        return self.count % 100

    def text(self):
        """The next text; its length varies, and with it all alignment after it."""
        self.count += 1
        return "märz"[: 1 + self.count % 4] + "x" * (self.count % 3)

    def message(self, message):
        """Set every field of a message of rclpy."""
        for name, kind in message.get_fields_and_field_types().items():
            setattr(message, name, self._value(getattr(message, name), kind))
        return message

    def _value(self, now, kind):
        if kind == "string":
            return self.text()
        if match := re.fullmatch(r"sequence<(.*)>", kind):
            return [self._element(match[1]) for _ in range(self.length)]
        if match := re.fullmatch(r"(.*)\[(\d+)\]", kind):
            return [self.number(match[1]) for _ in range(int(match[2]))]
        if "/" in kind:
            return self.message(now)
        return self.number(kind)

    def _element(self, kind):
        if "/" not in kind:
            return self.number(kind)
        import importlib

        package, name = kind.split("/")
        return self.message(getattr(importlib.import_module(f"{package}.msg"), name)())
