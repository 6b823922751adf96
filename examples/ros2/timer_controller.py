"""A ROS 2 node with a timer of its own: a command every 50 ms of simulated time, as Nav2's.

Run `python3 timer_controller.py`, and Wayproof with `--stack ros2:pace=controller`.
"""

import rclpy
from gap import Gap
from geometry_msgs.msg import PoseStamped, TwistStamped
from nav_msgs.msg import Odometry
from rclpy.parameter import Parameter
from robot import LATCHED, goal_in_body, obstacles, yaw
from sensor_msgs.msg import PointCloud2

PERIOD = 0.05  # s


class TimerController:
    """Commands by the newest of all inputs, whenever its timer fires."""

    def __init__(self, node):
        """Publish and subscribe."""
        self.node, self.gap, self.goal, self.odom, self.cloud = node, Gap(), None, None, None
        self.publisher = node.create_publisher(TwistStamped, "cmd_vel", 10)
        node.create_subscription(PoseStamped, "goal_pose", self.on_goal, LATCHED)
        node.create_subscription(Odometry, "odom", self.on_odom, 10)
        node.create_subscription(PointCloud2, "points", self.on_cloud, 10)
        node.create_timer(PERIOD, self.control)

    def on_goal(self, message):
        """Take a goal."""
        self.goal = message

    def on_odom(self, message):
        """Take the pose."""
        self.odom = message

    def on_cloud(self, message):
        """Take a sweep."""
        self.cloud = message

    def control(self):
        """Command."""
        if None in (self.goal, self.odom, self.cloud):
            return
        pose = self.odom.pose.pose
        command = TwistStamped()
        command.header.stamp = self.node.get_clock().now().to_msg()
        command.header.frame_id = "base_link"
        command.twist.linear.x, command.twist.angular.z = self.gap.step(
            obstacles(self.cloud, pose.position.z),
            goal_in_body(self.goal.pose, pose),
            yaw(pose.orientation),
        )
        self.publisher.publish(command)


def main():
    """Spin until it is stopped."""
    rclpy.init()
    simulated = [Parameter("use_sim_time", value=True)]
    node = rclpy.create_node("timer_controller", parameter_overrides=simulated)
    controller = TimerController(node)
    try:
        rclpy.spin(node)
    except (KeyboardInterrupt, rclpy.executors.ExternalShutdownException):
        del controller
    rclpy.try_shutdown()


main()
