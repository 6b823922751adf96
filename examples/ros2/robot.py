"""What both example nodes know of the robot: its odometry and the goal, from their topics."""

import math

import numpy as np
from rclpy.qos import DurabilityPolicy, QoSProfile

LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
SENSOR = np.array([0.15, 0.0, 0.12])  # m, of the quadruped's lidar on its base, as in /tf_static
FLOOR = 0.06  # m, highest that counts as floor
CEILING = 0.65  # m, lowest that counts as overhead


def yaw(q):
    """Heading of an orientation, rad."""
    return math.atan2(2.0 * (q.w * q.z + q.x * q.y), 1.0 - 2.0 * (q.y * q.y + q.z * q.z))


def goal_in_body(goal, pose):
    """The goal (2,) m in the body's frame, by poses in the world's."""
    dx, dy = goal.position.x - pose.position.x, goal.position.y - pose.position.y
    c, s = math.cos(yaw(pose.orientation)), math.sin(yaw(pose.orientation))
    return c * dx + s * dy, -s * dx + c * dy


def obstacles(cloud, height):
    """Points (n, 2) m in the body's frame, between floor and overhead, of a base this high, m."""
    points = np.frombuffer(cloud.data, np.float32).reshape(-1, cloud.point_step // 4)[:, :3]
    points = points.astype(float) + SENSOR
    above = points[:, 2] + height
    return points[(above > FLOOR) & (above < CEILING), :2]
