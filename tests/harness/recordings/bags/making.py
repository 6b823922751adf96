"""Bags made for tests, message by message."""

import numpy as np

from wayproof.harness.recordings.bags.building import Builder
from wayproof.harness.recordings.bags.messages import TRANSFORMS
from wayproof.harness.recordings.bags.writing import Stamped, encoding_of, write_bag
from wayproof.harness.recordings.transform import Transform

S = 10**9
UNTURNED = (1.0, 0.0, 0.0, 0.0)


def at(x=0.0, y=0.0, z=0.0, quaternion=UNTURNED):
    return Transform(np.array([x, y, z], float), np.array(quaternion, float))


class Bag:
    """Messages of a bag, in the order in which they are added."""

    def __init__(self, kind="mcap"):
        self.kind = kind
        self.build = Builder(encoding_of(kind))
        self.messages = []

    def add(self, topic, type_, message, stamp):
        package, name = type_.split("/")
        self.messages.append(Stamped(round(stamp * S), topic, f"{package}/msg/{name}", message))

    def tf(self, parent, child, stamp, transform, topic="/tf"):
        message = self.build.transforms(round(stamp * S), parent, child, transform)
        self.messages.append(Stamped(round(stamp * S), topic, TRANSFORMS[0], message))

    def odometry(self, stamp, transform, topic="/odom", parent="odom", child="base_link"):
        message = self.build.odometry(round(stamp * S), parent, child, transform)
        self.add(topic, "nav_msgs/Odometry", message, stamp)

    def drive(self, times, speed=1.0):
        """Move the body along x, at z = 0."""
        for stamp in times:
            self.tf("odom", "base_link", stamp, at(speed * stamp))

    def scan(self, stamp, ranges, topic="/scan", frame="laser", **fields):
        defaults = {
            "header": self.build.header(round(stamp * S), frame),
            "angle_min": -1.0,
            "angle_increment": 0.5,
            "time_increment": 0.0,
            "scan_time": 0.0,
            "range_min": 0.1,
            "range_max": 10.0,
            "ranges": np.array(ranges, np.float32),
            "intensities": np.empty(0, np.float32),
        }
        message = defaults | fields
        span = message["angle_increment"] * (len(ranges) - 1)
        message = {"angle_max": message["angle_min"] + span} | message
        message = self.build.make("sensor_msgs/LaserScan", **message)
        self.add(topic, "sensor_msgs/LaserScan", message, stamp)

    def cloud(self, stamp, columns, topic="/points", frame="lidar", **changed):
        """Add a cloud of columns by name, each of any number type."""
        rows = np.empty(
            len(next(iter(columns.values()))),
            np.dtype([(name, column.dtype) for name, column in columns.items()]),
        )
        codes = {"i": {1: 1, 2: 3, 4: 5}, "u": {1: 2, 2: 4, 4: 6}, "f": {4: 7, 8: 8}}
        fields = []
        for name, column in columns.items():
            rows[name] = column
            code = codes[column.dtype.kind][column.dtype.itemsize]
            offset = rows.dtype.fields[name][1]
            fields.append(
                self.build.make(
                    "sensor_msgs/PointField", name=name, offset=offset, datatype=code, count=1
                )
            )
        defaults = {
            "header": self.build.header(round(stamp * S), frame),
            "height": 1,
            "width": len(rows),
            "fields": fields,
            "is_bigendian": False,
            "point_step": rows.dtype.itemsize,
            "row_step": rows.dtype.itemsize * len(rows),
            "data": rows.view(np.uint8).reshape(-1),
            "is_dense": True,
        }
        message = self.build.make("sensor_msgs/PointCloud2", **(defaults | changed))
        self.add(topic, "sensor_msgs/PointCloud2", message, stamp)

    def livox(self, stamp, points, offsets_ns, package="livox_ros_driver2"):
        """Add a CustomMsg of points (n, 3), m, measured at offsets (n,) from the stamp."""
        kind = f"{package}/CustomPoint"
        made = [
            self.build.make(kind, offset_time=int(t), x=x, y=y, z=z, reflectivity=9, tag=0, line=0)
            for t, (x, y, z) in zip(offsets_ns, points, strict=True)
        ]
        message = self.build.make(
            f"{package}/CustomMsg",
            header=self.build.header(round(stamp * S), "lidar"),
            timebase=round(stamp * S),
            point_num=len(made),
            lidar_id=0,
            rsvd=np.zeros(3, np.uint8),
            points=made,
        )
        self.add("/livox/lidar", f"{package}/CustomMsg", message, stamp)

    def image(self, stamp, pixels, encoding, topic="/depth/image_raw", **changed):
        defaults = {
            "header": self.build.header(round(stamp * S), "camera"),
            "height": pixels.shape[0],
            "width": pixels.shape[1],
            "encoding": encoding,
            "is_bigendian": 0,
            "step": pixels.strides[0],
            "data": np.ascontiguousarray(pixels).view(np.uint8).reshape(-1),
        }
        message = self.build.make("sensor_msgs/Image", **(defaults | changed))
        self.add(topic, "sensor_msgs/Image", message, stamp)

    def camera(self, stamp, shape, focal, roi=(), binning=0, **lens):
        """Add a CameraInfo, with a region of interest and parts D, K, R, P of its lens."""
        matrix = np.array([focal, 0, shape[1] / 2, 0, focal, shape[0] / 2, 0, 0, 1], float)
        lens = {"D": np.zeros(5), "K": matrix, "R": np.eye(3).ravel(), "P": np.zeros(12)} | lens
        region = dict.fromkeys(("x_offset", "y_offset", "height", "width"), 0) | dict(roi)
        message = self.build.make(
            "sensor_msgs/CameraInfo",
            header=self.build.header(round(stamp * S), "camera"),
            height=shape[0],
            width=shape[1],
            distortion_model="plumb_bob",
            binning_x=binning,
            binning_y=binning,
            roi=self.build.make("sensor_msgs/RegionOfInterest", do_rectify=False, **region),
            **lens,
            **{name.lower(): value for name, value in lens.items()},
        )
        self.add("/depth/camera_info", "sensor_msgs/CameraInfo", message, stamp)

    def write(self, path):
        write_bag(self.messages, path, self.kind)
        return path
