"""A ROS 2 node in lockstep: answers each cloud with a command of the same stamp.

Run `python3 gap_follower.py`, and Wayproof with `--stack ros2:pace=lockstep`.
"""

import rclpy
from gap import Gap
from geometry_msgs.msg import PoseStamped, TwistStamped
from nav_msgs.msg import Odometry
from robot import LATCHED, goal_in_body, obstacles, yaw
from sensor_msgs.msg import PointCloud2


class GapFollower:
    """Answers each cloud once the odometry of its stamp is there, too."""

    def __init__(self, node):
        """Publish and subscribe."""
        self.gap, self.goal, self.odom, self.cloud, self.answer = Gap(), None, None, None, None
        self.publisher = node.create_publisher(TwistStamped, "cmd_vel", 10)
        node.create_subscription(PoseStamped, "goal_pose", self.on_goal, LATCHED)
        node.create_subscription(Odometry, "odom", self.on_odom, 10)
        node.create_subscription(PointCloud2, "points", self.on_cloud, 10)

    def on_goal(self, message):
        """Take a goal."""
        if self.goal is None or self.goal.header.stamp == message.header.stamp:
            self.goal = message
            self.try_to_answer()
        else:  # a new episode
            self.gap, self.goal, self.answer = Gap(), message, None

    def on_odom(self, message):
        """Take the pose."""
        self.odom = message
        self.try_to_answer()

    def on_cloud(self, message):
        """Take a sweep."""
        self.cloud = message
        self.try_to_answer()

    def try_to_answer(self):
        """Answer once all inputs of one stamp are there; a repeated sweep gets the same answer."""
        if None in (self.goal, self.odom, self.cloud):
            return
        stamp = self.cloud.header.stamp
        if self.odom.header.stamp != stamp:
            return
        if self.answer is None or self.answer.header.stamp != stamp:
            pose = self.odom.pose.pose
            speed, yaw_rate = self.gap.step(
                obstacles(self.cloud, pose.position.z),
                goal_in_body(self.goal.pose, pose),
                yaw(pose.orientation),
            )
            self.answer = TwistStamped()
            self.answer.header.stamp, self.answer.header.frame_id = stamp, "base_link"
            self.answer.twist.linear.x, self.answer.twist.angular.z = speed, yaw_rate
        self.publisher.publish(self.answer)


def main():
    """Spin until it is stopped."""
    rclpy.init()
    node = rclpy.create_node("gap_follower")
    follower = GapFollower(node)
    try:
        rclpy.spin(node)
    except (KeyboardInterrupt, rclpy.executors.ExternalShutdownException):
        del follower
    rclpy.try_shutdown()


main()
