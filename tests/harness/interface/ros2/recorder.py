"""A recorder as `ros2 bag record TOPICS`: into a bag of ROS 2, until SIGTERM.

python recorder.py DOMAIN BAG KIND TOPIC...
"""

import signal
import sys
import time

from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from wayproof.harness.interface.ros2.messages import (
    Image,
    LaserScan,
    Odometry,
    PointCloud2,
    String,
    TFMessage,
    TwistStamped,
    encode,
)
from wayproof.harness.interface.ros2.node import Node

TOPICS = {
    "/tf": TFMessage,
    "/tf_static": TFMessage,
    "/odom": Odometry,
    "/task": String,
    "/points": PointCloud2,
    "/points/ranges": Image,
    "/depth/image": Image,
    "/depth/image/ranges": Image,
    "/altimeter/ranges": Image,
    "/scan": LaserScan,
    "/cmd_vel": TwistStamped,
}
LATCHED = ("/tf_static", "/task")
STORE = get_typestore(Stores.ROS2_JAZZY)


class Recorder:
    """Subscribes to the topics, and writes what comes by its time of receipt."""

    def __init__(self, domain, writer, topics):
        self.node, self.writer = Node(domain), writer
        self.topics = [
            (
                self.node.subscription(topic, TOPICS[topic], latched=topic in LATCHED),
                writer.add_connection(topic, TOPICS[topic].__msgtype__, typestore=STORE),
            )
            for topic in topics
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
        recorder = Recorder(int(sys.argv[1]), writer, sys.argv[4:])
        print("subscribed", flush=True)
        while recorder.spin() or not stopped:
            pass


if __name__ == "__main__":
    main()
