"""Poses as ROS 2 messages: transforms, odometry and the goal."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from wayproof.harness.interface.ros2.messages import (
    Header,
    Odometry,
    Point,
    Pose,
    PoseStamped,
    PoseWithCovariance,
    Quaternion,
    TFMessage,
    Time,
    Transform,
    TransformStamped,
    Twist,
    TwistWithCovariance,
    Vector3,
    nanoseconds,
    time_of,
)
from wayproof.harness.interface.ros2.options import Options
from wayproof.harness.interface.ros2.sensors import optical_frame
from wayproof.harness.interface.types import Array, Observation, Task

R_optical = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
"""R_sensor_optical: x right, y down, z forward (REP 103), in x forward, y left, z up."""


STATED = (0, 1, 2, 5)
"""Rows of the covariance of nav_msgs/Odometry that an estimator states: x, y, z, yaw."""

FOOTPRINT = "base_footprint"
"""Frame of the projection of a body on the ground on the floor, z = 0 of the map (REP 120)."""


def static_transforms(task: Task, options: Options, stamp: Time) -> TFMessage:
    """Return T_map_odom, which is the identity, and the mounting of each sensor."""
    made = [_transform(stamp, (options.map_frame, options.odom_frame), np.zeros(3), np.eye(3))]
    for name, sensor in task.sensors.items():
        T = sensor.T_base_sensor
        made.append(_transform(stamp, (options.base_frame, name), T[:3, 3], T[:3, :3]))
        if sensor.info.kind == "depth_camera":
            frames = name, optical_frame(sensor)
            made.append(_transform(stamp, frames, np.zeros(3), R_optical))
    return TFMessage(made)


def moving_transforms(
    task: Task, observation: Observation, options: Options, stamp: Time, since_ns: int = 0
) -> TFMessage:
    """Return T_odom_base, the estimated pose, and T_base_footprint of a body on the ground.

    Args:
        task: Task with the body.
        observation: Observation with the pose.
        options: Names of the frames.
        stamp: ROS time of the observation.
        since_ns: Stamp of the transforms that were sent last, ns. After a sweep of a rolling
            shutter the poses since then go before that of now.
    """
    moved = [
        *_trail(observation, options, nanoseconds(stamp), since_ns),
        _moved(stamp, options, observation.position, observation.quaternion),
    ]
    if not task.mission.planar or options.base_frame == FOOTPRINT:
        return TFMessage(moved)
    R_base_world = observation.rotation.T
    below = R_base_world @ np.array([0.0, 0.0, -observation.position[2]])
    R_base_footprint = R_base_world @ _heading_alone(observation.rotation)
    frames = options.base_frame, FOOTPRINT
    return TFMessage([*moved, _transform(stamp, frames, below, R_base_footprint)])


def _trail(
    observation: Observation, options: Options, stamp_ns: int, since_ns: int
) -> list[TransformStamped]:
    """Return the poses while the sweeps were taken, oldest first, without the current one."""
    trail = observation.trail
    if trail is None:
        return []
    period_ns, count = round(trail.period * 1e9), len(trail.positions)
    stamps = [stamp_ns - (count - 1 - k) * period_ns for k in range(count - 1)]
    return [
        _moved(time_of(at_ns), options, position, quaternion)
        for at_ns, position, quaternion in zip(
            stamps, trail.positions[:-1], trail.quaternions[:-1], strict=True
        )
        if at_ns > since_ns
    ]


def _moved(stamp: Time, options: Options, position: Array, wxyz: Array) -> TransformStamped:
    """Return T_odom_base at a time."""
    header = Header(stamp, options.odom_frame)
    transform = Transform(_vector(position), quaternion_of(wxyz))
    return TransformStamped(header, options.base_frame, transform)


def odometry(observation: Observation, options: Options, stamp: Time) -> Odometry:
    """Return the estimated pose in the odometry's frame, and the velocity in the base's."""
    header = Header(stamp, options.odom_frame)
    pose = Pose(_point(observation.position), quaternion_of(observation.quaternion))
    velocity = observation.rotation.T @ observation.velocity
    twist = Twist(_vector(velocity), Vector3(0.0, 0.0, observation.yaw_rate))
    return Odometry(
        header,
        options.base_frame,
        PoseWithCovariance(pose, _covariance(observation)),
        TwistWithCovariance(twist, np.zeros(36)),
    )


def goal_pose(task: Task, options: Options, stamp: Time, reached: int = 0) -> PoseStamped:
    """Return the next goal, headed to it from the one before, or the start: any heading will do."""
    before, goal = (task.mission.start, *task.mission.goals)[reached : reached + 2]
    heading = math.atan2(goal[1] - before[1], goal[0] - before[0])
    turned = Quaternion(0.0, 0.0, math.sin(0.5 * heading), math.cos(0.5 * heading))
    return PoseStamped(Header(stamp, options.map_frame), Pose(Point(*goal), turned))


def quaternion_of(wxyz: Array) -> Quaternion:
    """Convert a quaternion (4,), w x y z, to its message."""
    w, x, y, z = wxyz.tolist()
    return Quaternion(x, y, z, w)


def _transform(stamp: Time, frames: tuple[str, str], position: Array, R: Array) -> TransformStamped:
    parent, child = frames
    x, y, z, w = Rotation.from_matrix(R).as_quat().tolist()
    transform = Transform(_vector(position), Quaternion(x, y, z, w))
    return TransformStamped(Header(stamp, parent), child, transform)


def _heading_alone(R: Array) -> Array:
    """Return the rotation about the vertical in a rotation (3, 3)."""
    heading = math.atan2(R[1, 0], R[0, 0])
    c, s = math.cos(heading), math.sin(heading)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def _covariance(observation: Observation) -> NDArray[np.float64]:
    """Return the covariance (36,) of x, y, z and rotations about them: stated, or diagonal."""
    if observation.covariance is not None:
        full = np.zeros((6, 6))
        full[np.ix_(STATED, STATED)] = observation.covariance
        return full.ravel()
    diagonal = [observation.position_sigma**2] * 3 + [0.0, 0.0, observation.heading_sigma**2]
    return np.diag(diagonal).ravel()


def _vector(values: Array) -> Vector3:
    return Vector3(*(float(value) for value in values))


def _point(values: Array) -> Point:
    return Point(*(float(value) for value in values))
