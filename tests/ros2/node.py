"""A node of rclpy that answers each sweep, or breaks in one way: `python node.py KIND`."""

import os
import sys
import time

import rclpy
from geometry_msgs.msg import PoseStamped, TwistStamped
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy, qos_profile_sensor_data
from sensor_msgs.msg import LaserScan, PointCloud2

BEST_EFFORT = QoSProfile(depth=10, reliability=ReliabilityPolicy.BEST_EFFORT)
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)

kind = sys.argv[1]
rclpy.init()
node = rclpy.create_node(f"stack_{kind}")
quality = BEST_EFFORT if kind == "best_effort_command" else 10
wrong = kind == "wrong_type"
publisher = node.create_publisher(PoseStamped if wrong else TwistStamped, "cmd_vel", quality)
second = node.create_publisher(TwistStamped, "cmd_vel", 10) if kind == "two" else None
count = 0


def answer(message):
    """Command straight on, with the stamp of the sweep."""
    global count, publisher
    count += 1
    if kind == "dies" and count == 5:
        os._exit(1)
    if kind == "restarts" and count == 5:
        node.destroy_publisher(publisher)
        publisher = node.create_publisher(TwistStamped, "cmd_vel", 10)
        time.sleep(1.0)
    command = TwistStamped()
    command.header.stamp, command.twist.linear.x = message.header.stamp, 0.3
    if not wrong:
        publisher.publish(command)
    if second is not None and count > 3:
        second.publish(command)


if kind == "latched_scan":
    node.create_subscription(LaserScan, "scan", answer, LATCHED)
elif kind == "sensor_data":
    node.create_subscription(LaserScan, "scan", answer, qos_profile_sensor_data)
elif kind == "cloud":
    node.create_subscription(PointCloud2, "points", answer, qos_profile_sensor_data)
else:
    node.create_subscription(LaserScan, "scan", answer, 10)
rclpy.spin(node)
