"""A drone with distance sensors in a room, as PX4 tells of it: in bags of ROS 2, and in ULog."""

import struct

import numpy as np
from rosbags.typesys import get_types_from_msg

from tests.harness.recordings.bags.making import Bag
from wayproof.harness.recordings.bags.messages import typestore

LOW, HIGH = np.array([-4.0, -3.0, 0.0]), np.array([5.0, 6.0, 4.0])
"""Walls, floor and ceiling of the room, east, north, up, m."""

FACING = {0: (1, 0, 0), 2: (0, 1, 0), 4: (-1, 0, 0), 6: (0, -1, 0), 24: (0, 0, -1), 25: (0, 0, 1)}
"""Orientations of a distance sensor: forward, right, down."""

DEFINITIONS = {
    "VehicleOdometry": (
        "uint64 timestamp\nuint64 timestamp_sample\nuint8 pose_frame\nfloat32[3] position\n"
        "float32[4] q\nuint8 velocity_frame\nfloat32[3] velocity\nfloat32[3] angular_velocity\n"
        "float32[3] position_variance\nfloat32[3] orientation_variance\n"
        "float32[3] velocity_variance\nuint8 reset_counter\nint8 quality\n"
    ),
    "VehicleAttitude": (
        "uint64 timestamp\nuint64 timestamp_sample\nfloat32[4] q\nfloat32[4] delta_q_reset\n"
        "uint8 quat_reset_counter\n"
    ),
    "VehicleLocalPosition": (
        "uint64 timestamp\nuint64 timestamp_sample\nbool xy_valid\nbool z_valid\nbool v_xy_valid\n"
        "bool v_z_valid\nfloat32 x\nfloat32 y\nfloat32 z\nfloat32[2] delta_xy\n"
        "uint8 xy_reset_counter\nfloat32 delta_z\nuint8 z_reset_counter\nfloat32 vx\nfloat32 vy\n"
        "float32 vz\nfloat32 z_deriv\nfloat32[2] delta_vxy\nuint8 vxy_reset_counter\n"
        "float32 delta_vz\nuint8 vz_reset_counter\nfloat32 ax\nfloat32 ay\nfloat32 az\n"
        "float32 heading\nfloat32 heading_var\nfloat32 unaided_heading\nfloat32 delta_heading\n"
        "uint8 heading_reset_counter\nbool heading_good_for_control\nfloat32 tilt_var\n"
        "bool xy_global\nbool z_global\nuint64 ref_timestamp\nfloat64 ref_lat\nfloat64 ref_lon\n"
        "float32 ref_alt\nbool dist_bottom_valid\nfloat32 dist_bottom\nfloat32 dist_bottom_var\n"
        "float32 delta_dist_bottom\nuint8 dist_bottom_reset_counter\n"
        "uint8 dist_bottom_sensor_bitfield\nfloat32 eph\nfloat32 epv\nfloat32 evh\nfloat32 evv\n"
        "bool dead_reckoning\nfloat32 vxy_max\nfloat32 vz_max\nfloat32 hagl_min\n"
        "float32 hagl_max_z\nfloat32 hagl_max_xy\n"
    ),
    "DistanceSensor": (
        "uint64 timestamp\nuint32 device_id\nfloat32 min_distance\nfloat32 max_distance\n"
        "float32 current_distance\nfloat32 variance\nint8 signal_quality\nuint8 type\n"
        "float32 h_fov\nfloat32 v_fov\nfloat32[4] q\nuint8 orientation\nuint8 mode\n"
    ),
}
"""Messages of `px4_msgs` 1.16."""


def rows_of(quaternion):
    """Return the rotation of a quaternion w x y z, written out."""
    w, x, y, z = quaternion
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def state(seconds):
    """Return position north, east, down, m, quaternion and yaw of a body that turns and tilts."""
    position = np.array([0.4 * seconds, 0.3 * np.sin(seconds), -1.5 - 0.1 * seconds])
    yaw, pitch = 0.4 + 0.7 * seconds, 0.15 * np.sin(2 * seconds)
    a, b, c, d = np.cos(yaw / 2), np.sin(yaw / 2), np.cos(pitch / 2), np.sin(pitch / 2)
    return position, np.array([a * c, -b * d, a * d, b * c]), yaw


def to_wall(seconds, orientation):
    """Return the distance of the room from the drone along a sensor, m."""
    position, quaternion, _ = state(seconds)
    north, east, down = rows_of(quaternion) @ np.array(FACING[orientation], float)
    origin, ray = position[[1, 0, 2]] * [1, 1, -1], np.array([east, north, -down])
    with np.errstate(divide="ignore"):
        ahead = np.where(ray > 0, (HIGH - origin) / ray, (LOW - origin) / ray)
    return float(ahead[ray != 0.0].min())


def moments(begin=100.0, seconds=3.0):
    """Yield times of PX4's clock, us, and seconds of the flight."""
    for k in range(round(50 * seconds)):
        yield round((begin + 0.02 * k) * 1e6), 0.02 * k


def told(name, us, seconds, **changed):
    """Return the fields of a message, by the definition of `px4_msgs`."""
    position, quaternion, yaw = state(seconds)
    north, east, down = position.tolist()
    own = {
        "VehicleOdometry": {"pose_frame": 1, "position": position, "q": quaternion},
        "VehicleAttitude": {"q": quaternion},
        "VehicleLocalPosition": {
            **dict.fromkeys(("xy_valid", "z_valid"), True),
            **{"x": north, "y": east, "z": down, "heading": (yaw + np.pi) % (2 * np.pi) - np.pi},
        },
        "DistanceSensor": {
            **{"min_distance": 0.1, "max_distance": 20.0, "signal_quality": 100},
            "current_distance": to_wall(seconds, changed.get("orientation", 0)),
        },
    }[name]
    return {"timestamp": us, "timestamp_sample": us, **own, **changed}


def bag(names=("VehicleOdometry",), orientation=0, changed=lambda name, seconds: {}):
    """Return a bag of a flight, with messages of the names and of a distance sensor."""
    made = Bag("mcap")
    types = {f"px4_msgs/msg/{name}": text for name, text in DEFINITIONS.items()}
    for name, text in types.items():
        if name not in typestore("cdr").types:
            typestore("cdr").register(get_types_from_msg(text, name))
    for us, seconds in moments():
        for name in (*names, "DistanceSensor"):
            facing = {"orientation": orientation} if name == "DistanceSensor" else {}
            fields = told(name, us, seconds, **facing, **changed(name, seconds))
            made.add(f"/fmu/out/{name}", f"px4_msgs/{name}", message(made, name, fields), us * 1e-6)
    return made


def message(made, name, fields):
    """Build a message, all of whose other fields are 0."""
    whole = {}
    for line in DEFINITIONS[name].splitlines():
        kind, field = line.split()
        base, _, count = kind.partition("[")
        if count:
            given = fields.get(field, np.zeros(int(count[:-1])))
            whole[field] = np.asarray(given, base)
        else:
            whole[field] = fields.get(field, False if base == "bool" else 0)
    return made.build.make(f"px4_msgs/{name}", **whole)


ULOG = {
    "vehicle_attitude": ("VehicleAttitude", "uint64_t timestamp;float[4] q;", "<Q4f"),
    "vehicle_local_position": (
        "VehicleLocalPosition",
        "uint64_t timestamp;float x;float y;float z;float heading;bool xy_valid;bool z_valid;",
        "<Q4f2?",
    ),
    "vehicle_odometry": (
        "VehicleOdometry",
        "uint64_t timestamp;float[3] position;float[4] q;uint8_t pose_frame;",
        "<Q7fB",
    ),
    "distance_sensor": (
        "DistanceSensor",
        "uint64_t timestamp;float current_distance;float min_distance;float max_distance;"
        "int8_t signal_quality;uint8_t orientation;",
        "<Q3fbB",
    ),
}
"""Topic -> message of `px4_msgs`, fields, and how they are packed."""


def ulog(path, topics=("vehicle_attitude", "vehicle_local_position"), facing=(0,)):
    """Write the ULog of a flight, with a distance sensor for each orientation."""
    parts = [b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 0), record(b"B", bytes(40))]
    listed = [(topic, 0, {}) for topic in topics]
    listed += [("distance_sensor", k, {"orientation": one}) for k, one in enumerate(facing)]
    for topic in {topic for topic, _, _ in listed}:
        parts.append(record(b"F", f"{topic}:{ULOG[topic][1]}".encode()))
    for number, (topic, instance, _) in enumerate(listed):
        parts.append(record(b"A", struct.pack("<BH", instance, number) + topic.encode()))
    for us, seconds in moments():
        for number, (topic, _, changed) in enumerate(listed):
            name, columns, packed = ULOG[topic]
            values = told(name, us, seconds, **changed)
            names = [column.split()[-1] for column in columns.split(";")[:-1]]
            row = np.concatenate([np.atleast_1d(values[one]) for one in names]).tolist()
            data = struct.pack(packed, int(row[0]), *whole(packed, row[1:]))
            parts.append(record(b"D", struct.pack("<H", number) + data))
    path.write_bytes(b"".join(parts))
    return path


def whole(packed, row):
    """Return the values of a row as the codes of a packing want them."""
    codes = packed[2:]
    listed, count = [], ""
    for code in codes:
        if code.isdigit():
            count += code
        else:
            listed += [code] * int(count or 1)
            count = ""
    return [value if code == "f" else int(value) for code, value in zip(listed, row, strict=True)]


def record(kind, data):
    return struct.pack("<H", len(data)) + kind + data
