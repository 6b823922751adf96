"""A node of rclpy that answers each sweep, or breaks in one way: `python node.py KIND`.

`ignores` and `heeds` command on a timer, by the last scan: the one however old its stamp is.
"""

import os
import sys
import time

import rclpy
from geometry_msgs.msg import PoseStamped, TwistStamped
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy, qos_profile_sensor_data
from rclpy.time import Time
from sensor_msgs.msg import LaserScan, PointCloud2

BEST_EFFORT = QoSProfile(depth=10, reliability=ReliabilityPolicy.BEST_EFFORT)
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)

kind = sys.argv[1]
rclpy.init()
simulated = [Parameter("use_sim_time", value=kind in ("ignores", "heeds"))]
node = rclpy.create_node(f"stack_{kind}", parameter_overrides=simulated)
quality = BEST_EFFORT if kind == "best_effort_command" else 10
wrong = kind == "wrong_type"
publisher = node.create_publisher(PoseStamped if wrong else TwistStamped, "cmd_vel", quality)
second = node.create_publisher(TwistStamped, "cmd_vel", 10) if kind == "two" else None
count = 0
scan = None
RECENT = 0.4  # s


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


def take(message):
    """Take a scan."""
    global scan
    scan = message


def control():
    """Command straight on; `heeds` stands where its scan is old."""
    now = node.get_clock().now()
    if scan is None:
        return
    age = (now - Time.from_msg(scan.header.stamp)).nanoseconds * 1e-9
    command = TwistStamped()
    command.header.stamp = now.to_msg()
    command.twist.linear.x = 0.3 if kind == "ignores" or age < RECENT else 0.0
    publisher.publish(command)


if kind in ("ignores", "heeds"):
    node.create_subscription(LaserScan, "scan", take, 10)
    node.create_timer(0.05, control)
elif kind == "latched_scan":
    node.create_subscription(LaserScan, "scan", answer, LATCHED)
elif kind == "sensor_data":
    node.create_subscription(LaserScan, "scan", answer, qos_profile_sensor_data)
elif kind == "cloud":
    node.create_subscription(PointCloud2, "points", answer, qos_profile_sensor_data)
else:
    node.create_subscription(LaserScan, "scan", answer, 10)
rclpy.spin(node)
