"""A recorder as `ros2 bag record TOPICS`: into a bag of ROS 2, until SIGTERM.

python recorder.py DOMAIN BAG KIND
"""

import signal
import sys
import time

from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from wayproof.harness.interface.ros2.cdr import encode
from wayproof.harness.interface.ros2.messages import (
    LaserScan,
    Odometry,
    PointCloud2,
    TFMessage,
    TwistStamped,
)
from wayproof.harness.interface.ros2.node import Node

TOPICS = {
    "/tf": TFMessage,
    "/tf_static": TFMessage,
    "/odom": Odometry,
    "/points": PointCloud2,
    "/scan": LaserScan,
    "/cmd_vel": TwistStamped,
}
STORE = get_typestore(Stores.ROS2_JAZZY)


class Recorder:
    """Subscribes to the topics, and writes what comes by its time of receipt."""

    def __init__(self, domain, writer):
        self.node, self.writer = Node(domain), writer
        self.topics = [
            (
                self.node.subscription(topic, kind, latched=topic == "/tf_static"),
                writer.add_connection(topic, kind.TYPE, typestore=STORE),
            )
            for topic, kind in TOPICS.items()
        ]

    def spin(self):
        self.node.wait(0.01)
        received = 0
        for subscription, connection in self.topics:
            for sample in subscription.take():
                self.writer.write(connection, time.time_ns(), encode(sample.message))
                received += 1
        return received


def main():
    stopped = []
    signal.signal(signal.SIGTERM, lambda *_: stopped.append(True))
    with Writer(sys.argv[2], version=9, storage_plugin=StoragePlugin[sys.argv[3]]) as writer:
        recorder = Recorder(int(sys.argv[1]), writer)
        while recorder.spin() or not stopped:
            pass


if __name__ == "__main__":
    main()
