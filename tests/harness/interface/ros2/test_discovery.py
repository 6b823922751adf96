"""Endpoints that cannot match are named, with what was expected."""

from types import SimpleNamespace

import pytest

from wayproof.harness.interface.ros2.discovery import mismatch
from wayproof.harness.interface.ros2.messages import (
    Clock,
    LaserScan,
    OccupancyGrid,
    Twist,
    TwistStamped,
)
from wayproof.harness.interface.ros2.node import Endpoint

PUBLISHERS = [
    SimpleNamespace(topic="/scan", kind=LaserScan, latched=False),
    SimpleNamespace(topic="/clock", kind=Clock, latched=False),
]
SUBSCRIPTIONS = [
    SimpleNamespace(topic="/cmd_vel", kind=Twist, latched=False),
    SimpleNamespace(topic="/cmd_vel", kind=TwistStamped, latched=False),
    SimpleNamespace(topic="/local_costmap/costmap", kind=OccupancyGrid, latched=True),
]
STAMPED, GRID = "geometry_msgs/msg/TwistStamped", "nav_msgs/msg/OccupancyGrid"
SCAN, COSTMAP = "sensor_msgs/msg/LaserScan", "/local_costmap/costmap"


def found(publications=(), subscriptions=()):
    return mismatch(publications, subscriptions, PUBLISHERS, SUBSCRIPTIONS)


def test_what_fits_is_no_mismatch():
    theirs = [Endpoint("/cmd_vel", STAMPED, True, False), Endpoint(COSTMAP, GRID, True, True)]
    best_effort, other = Endpoint("/scan", SCAN, False, False), Endpoint("/x", "a", False, True)
    assert found([*theirs, other], [best_effort, other]) == ""


@pytest.mark.parametrize(
    ("endpoint", "line"),
    [
        (
            Endpoint("/clock", "rosgraph_msgs/msg/Clock", True, False),
            "/clock is published by another simulator or episode in this domain, too",
        ),
        (
            Endpoint("/cmd_vel", "geometry_msgs/msg/Pose", True, False),
            "/cmd_vel is published as geometry_msgs/msg/Pose, expected geometry_msgs/msg/Twist or "
            "geometry_msgs/msg/TwistStamped",
        ),
        (
            Endpoint("/cmd_vel", STAMPED, False, False),
            "/cmd_vel is published with best effort reliability, expected reliable",
        ),
        (
            Endpoint(COSTMAP, GRID, True, False),
            f"{COSTMAP} is published with volatile durability, expected transient local",
        ),
    ],
)
def test_a_publisher_that_cannot_be_heard(endpoint, line):
    assert found([endpoint]) == line


@pytest.mark.parametrize(
    ("endpoint", "line"),
    [
        (
            Endpoint("/scan", "sensor_msgs/msg/PointCloud2", True, False),
            f"/scan is subscribed as sensor_msgs/msg/PointCloud2, expected {SCAN}",
        ),
        (
            Endpoint("/scan", SCAN, True, True),
            "/scan is subscribed with transient local durability, expected volatile",
        ),
    ],
)
def test_a_subscription_that_hears_nothing(endpoint, line):
    assert found((), [endpoint]) == line
