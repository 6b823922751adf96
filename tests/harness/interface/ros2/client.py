"""A small ROS 2 node on Cyclone DDS alone, in a process of its own: good, and broken in each way.

python client.py DOMAIN KIND
"""

import sys
import time

import numpy as np

from wayproof.harness.interface.ros2.messages import (
    LEVEL,
    Clock,
    Header,
    MapMetaData,
    OccupancyGrid,
    Odometry,
    Path,
    Point,
    Pose,
    PoseStamped,
    Twist,
    TwistStamped,
    Vector3,
    nanoseconds,
    time_of,
)
from wayproof.harness.interface.ros2.node import Node

PERIOD_NS = 50_000_000


class Client:
    """Answers each odometry with a command of its stamp; variants override what they break."""

    forward = 0.3
    frame = "base_link"

    def __init__(self, domain):
        self.node = Node(domain)
        self.topic = self.node.publisher("/cmd_vel", TwistStamped)
        self.odom = self.node.subscription("/odom", Odometry)
        self.clock = self.node.subscription("/clock", Clock)
        self.answered = 0

    def twist(self):
        return Twist(Vector3(self.forward, 0.0, 0.0), Vector3(0.0, 0.0, 0.0))

    def on_odom(self, stamp):
        self.topic.publish(TwistStamped(Header(stamp, self.frame), self.twist()))
        self.answered += 1

    def on_clock(self, time_ns):
        pass

    def run(self):
        while True:
            self.node.wait(0.2)
            for one in self.odom.take():
                self.on_odom(one.message.header.stamp)
            for one in self.clock.take():
                self.on_clock(nanoseconds(one.message.clock))


class Timer(Client):
    """A controller with a timer: fires once in a jump of the clock, however long, as rcl's does."""

    due_ns = 0

    def on_odom(self, stamp):
        pass

    def on_clock(self, time_ns):
        if time_ns < self.due_ns - 1_000_000_000:
            self.due_ns = 0  # the clock went back: a new episode
        if time_ns >= self.due_ns:
            self.due_ns = time_ns - time_ns % PERIOD_NS + PERIOD_NS
            self.fire(time_ns)

    def fire(self, time_ns):
        self.topic.publish(TwistStamped(Header(time_of(time_ns), self.frame), self.twist()))


class SlowTimer(Timer):
    """Takes long to compute; by simulated time it makes no difference."""

    def fire(self, time_ns):
        time.sleep(0.05)
        super().fire(time_ns)


class PlainTwist(Timer):
    """Sends commands without a stamp."""

    def __init__(self, domain):
        super().__init__(domain)
        self.plain = self.node.publisher("/cmd_vel", Twist)

    def fire(self, time_ns):
        self.plain.publish(self.twist())


class OnceInAWhile(PlainTwist):
    """Says nothing in most periods, as Nav2 does while it plans or recovers."""

    def fire(self, time_ns):
        if time_ns // PERIOD_NS % 3 == 2:
            super().fire(time_ns)


class Silent(Client):
    def on_odom(self, stamp):
        pass


class Dies(Client):
    def on_odom(self, stamp):
        super().on_odom(stamp)
        if self.answered == 4:
            sys.exit(3)


class Restarts(Client):
    """Its publisher is made anew after four answers, as by a node that was restarted."""

    def on_odom(self, stamp):
        if self.answered == 4:
            del self.topic
            self.topic = self.node.publisher("/cmd_vel", TwistStamped)
            time.sleep(0.5)
        super().on_odom(stamp)


class Two(Client):
    """Two publishers answer, as when a second node was left running."""

    def __init__(self, domain):
        super().__init__(domain)
        self.other = self.node.publisher("/cmd_vel", TwistStamped)

    def on_odom(self, stamp):
        super().on_odom(stamp)
        if self.answered > 3:
            self.other.publish(TwistStamped(Header(stamp, self.frame), self.twist()))


class WrongType(Client):
    def __init__(self, domain):
        self.node = Node(domain)
        self.wrong = self.node.publisher("/cmd_vel", PoseStamped)
        self.odom = self.node.subscription("/odom", Odometry)
        self.clock = self.node.subscription("/clock", Clock)

    def on_odom(self, stamp):
        pass


class OwnTime(Client):
    """Answers sweeps, but with the time of its own clock."""

    def on_odom(self, stamp):
        super().on_odom(time_of(nanoseconds(stamp) + 7))


class NotANumber(Client):
    forward = float("nan")


class WrongFrame(Client):
    frame = "map"


class Plans(Client):
    """Sends a plan and a costmap beside its commands."""

    def __init__(self, domain):
        super().__init__(domain)
        self.plan = self.node.publisher("/plan", Path)
        self.costmap = self.node.publisher("/local_costmap/costmap", OccupancyGrid, latched=True)

    def on_odom(self, stamp):
        header = Header(stamp, "map")
        poses = [PoseStamped(header, Pose(Point(x, 0.5, 0.0), LEVEL)) for x in (1.0, 2.0, 3.0)]
        self.plan.publish(Path(header, poses))
        info = MapMetaData(stamp, 0.5, 3, 2, Pose(Point(-1.0, -2.0, 0.0), LEVEL))
        cells = np.array([0, 50, 100, -1, -1, 99], np.int8)
        self.costmap.publish(OccupancyGrid(Header(stamp, "odom"), info, cells))
        time.sleep(0.02)
        super().on_odom(stamp)


class Repeats(Client):
    """Takes its time for the first answer, so that the first sweep is sent again."""

    def on_odom(self, stamp):
        if self.answered == 0:
            time.sleep(1.5)
        super().on_odom(stamp)


if __name__ == "__main__":
    globals()[sys.argv[2]](int(sys.argv[1])).run()
