"""Messages of a ROS 2 stack: velocity commands, a plan and a costmap; each checked."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from wayproof.harness.interface.errors import StackError
from wayproof.harness.interface.ros2.messages import (
    CdrError,
    Header,
    M,
    Message,
    OccupancyGrid,
    Path,
    Twist,
    TwistStamped,
    nanoseconds,
)
from wayproof.harness.interface.ros2.node import Node, Sample, Subscription
from wayproof.harness.interface.ros2.options import Options
from wayproof.harness.interface.types import Array, Grid, Velocity


class Received(NamedTuple):
    """A velocity command.

    Attributes:
        velocity: Velocity that the body is to hold.
        stamp_ns: ROS time of its header, ns; none of a Twist.
        sent_ns: Wall time of its sending, by its sender's clock, ns.
        publisher: Handle of its publisher.
    """

    velocity: Velocity
    stamp_ns: int | None
    sent_ns: int
    publisher: int


class Inputs:
    """The subscriptions of one stack.

    Attributes:
        topic: Topic of the commands.
    """

    def __init__(self, node: Node, options: Options, who: str) -> None:
        """Subscribe to them.

        Args:
            node: Node to subscribe with.
            options: Names of topics and frames.
            who: Name of the stack in messages.
        """
        self._options, self._who = options, who
        self.topic = options.topic("cmd_vel")
        self._twists = node.subscription(self.topic, Twist)
        self._stamped = node.subscription(self.topic, TwistStamped)
        self._plan = self._costmap = None
        if topic := options.topic("plan"):
            self._plan = node.subscription(topic, Path)
        if topic := options.topic("local_costmap/costmap"):
            self._costmap = node.subscription(topic, OccupancyGrid, latched=True)

    @property
    def subscriptions(self) -> list[Subscription[Message]]:
        """All subscriptions."""
        found = self._twists, self._stamped, self._plan, self._costmap
        return [one for one in found if one is not None]  # type: ignore[misc]

    @property
    def publishers(self) -> set[int]:
        """Handles of the publishers of commands."""
        return self._twists.publishers | self._stamped.publishers

    def commands(self) -> list[Received]:
        """Return commands received since, oldest first.

        Raises:
            StackError: One is none that a body can follow.
        """
        received = [
            self._received(sample, sample.message, None)
            for sample in self._take_samples(self._twists)
        ]
        for one in self._take_samples(self._stamped):
            header = one.message.header
            self._check_frame(self.topic, header, ("", self._options.base_frame))
            received.append(self._received(one, one.message.twist, nanoseconds(header.stamp)))
        return sorted(received, key=lambda one: one.sent_ns)

    def plan(self) -> Array | None:
        """Return the newest plan since the last call, (k, 3) m, world; None without one."""
        samples = self._take_samples(self._plan) if self._plan else []
        if not samples:
            return None
        path = samples[-1].message
        self._check_frame(self._options.topic("plan"), path.header, self._fixed_frames)
        positions = [one.pose.position for one in path.poses]
        return np.array([(one.x, one.y, one.z) for one in positions]).reshape(-1, 3)

    def costmap(self) -> Grid | None:
        """Return the newest costmap since the last call; None without one."""
        samples = self._take_samples(self._costmap) if self._costmap else []
        if not samples:
            return None
        grid = samples[-1].message
        topic, info = self._options.topic("local_costmap/costmap"), grid.info
        self._check_frame(topic, grid.header, self._fixed_frames)
        if len(grid.data) != info.width * info.height or info.resolution <= 0.0:
            raise StackError(
                self._who,
                f"sent {len(grid.data)} cells of {info.resolution:g} m on {topic}, expected "
                f"{info.width} x {info.height}",
            )
        corner = info.origin.position
        cells = grid.data.reshape(info.height, info.width)
        return Grid(np.array([corner.x, corner.y]), info.resolution, cells)

    @property
    def _fixed_frames(self) -> tuple[str, ...]:
        return self._options.map_frame, self._options.odom_frame

    def _take_samples(self, subscription: Subscription[M]) -> list[Sample[M]]:
        try:
            return subscription.take()
        except CdrError as error:
            line = f"sent bytes on {subscription.topic} that are no message: {error}"
            raise StackError(self._who, line) from None

    def _received(self, sample: Sample[M], twist: Twist, stamp_ns: int | None) -> Received:
        linear, angular = twist.linear, twist.angular
        values = linear.x, linear.y, linear.z, angular.z
        if not all(map(math.isfinite, values)):
            raise StackError(self._who, f"sent {twist} on {self.topic}, expected finite numbers")
        velocity = Velocity(linear.x, linear.y, linear.z, angular.z)
        return Received(velocity, stamp_ns, sample.sent_ns, sample.publisher)

    def _check_frame(self, topic: str, header: Header, expected: tuple[str, ...]) -> None:
        if header.frame_id not in expected:
            frames = " or ".join(f"'{one}'" for one in expected if one)
            raise StackError(
                self._who, f"sent {topic} in frame '{header.frame_id}', expected {frames}"
            )
