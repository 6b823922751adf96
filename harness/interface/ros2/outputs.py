"""Topics that a ROS 2 stack gets in one mission, and their times."""

from __future__ import annotations

from wayproof.harness.interface.ros2.grids import costmap_grid, map_grid
from wayproof.harness.interface.ros2.messages import (
    Clock,
    Message,
    OccupancyGrid,
    Odometry,
    PoseStamped,
    String,
    TFMessage,
    time_of,
)
from wayproof.harness.interface.ros2.node import Node, Publisher
from wayproof.harness.interface.ros2.options import Options
from wayproof.harness.interface.ros2.sensors import publications_of, ranges_image
from wayproof.harness.interface.ros2.task import write_task
from wayproof.harness.interface.ros2.transforms import (
    goal_pose,
    moving_transforms,
    odometry,
    static_transforms,
)
from wayproof.harness.interface.types import Observation, Task
from wayproof.maps import Costmap

LATCHED = ("tf_static", "task", "map", "referee/costmap", "goal_pose")
"""Topics with a durability of transient local: a node that joins later gets the last message."""

GRID_PERIOD_NS = 1_000_000_000
"""Simulated time between two maps and costmaps, ns; Nav2's default publish frequency."""

PAST_NS = 1
"""Lead of the clock over the stamps of sweeps and the ends of controller periods, ns: so a stamp
that was copied from a sweep can be distinguished from one that a node took from its clock."""


class Outputs:
    """The publishers of one mission.

    Attributes:
        publishers: Publishers by the name of the topic without remapping.
    """

    def __init__(self, node: Node, options: Options, task: Task) -> None:
        """Announce the topics that this robot's sensors make."""
        self._options, self._task = options, task
        self._sensors = publications_of(task)
        self._grids_due_ns = 0
        self._moved_ns = 0  # stamp of the last transforms
        kinds: dict[str, type[Message]] = {
            "clock": Clock,
            "tf": TFMessage,
            "tf_static": TFMessage,
            "odom": Odometry,
            "task": String,
            "goal_pose": PoseStamped,
        }
        if task.mission.planar:
            kinds |= {"map": OccupancyGrid, "referee/costmap": OccupancyGrid}
        for sensor in self._sensors.values():
            kinds |= sensor.topics()
        self.publishers: dict[str, Publisher] = {}
        for topic, kind in kinds.items():
            if name := options.topic(topic):
                self.publishers[topic] = node.publisher(name, kind, topic in LATCHED)

    def send_mountings(self, stamp_ns: int) -> None:
        """Send the transforms that stay."""
        self._send("tf_static", static_transforms(self._task, self._options, time_of(stamp_ns)))

    def send_task(self, start_ns: int) -> None:
        """Send the task; its simulated time 0 is a ROS time, ns."""
        self._send("task", String(write_task(self._task, start_ns)))

    def send_goal(self, stamp_ns: int, reached: int = 0) -> None:
        """Send the next goal after those reached."""
        stamp = time_of(stamp_ns)
        self._send("goal_pose", goal_pose(self._task, self._options, stamp, reached))

    def send_clock(self, time_ns: int) -> None:
        """Send simulated time."""
        self._send("clock", Clock(time_of(time_ns + PAST_NS)))

    def send_observation(self, observation: Observation, stamp_ns: int) -> None:
        """Send the pose if it is new, then the sweeps that it places, each with its own stamp."""
        stamp = time_of(stamp_ns)
        if not observation.pose_age_ns:
            since_ns, self._moved_ns = self._moved_ns, stamp_ns
            moved = moving_transforms(self._task, observation, self._options, stamp, since_ns)
            self._send("tf", moved)
            self._send("odom", odometry(observation, self._options, stamp))
        for sweep in observation.sweeps:
            stamp = time_of(max(stamp_ns - sweep.age_ns, 0))
            if (sensor := self._sensors.get(sweep.sensor)) is not None:
                for topic, message in sensor.messages(
                    sweep, observation.sequence - sweep.lag, stamp
                ):
                    self._send(topic, message)
                ranges = self.publishers.get(sensor.ranges_topic)
                if ranges is not None and ranges.readers:  # a recorder, seldom another
                    ranges.publish(ranges_image(sensor.sensor, sweep, stamp))

    def send_grids(self, costmap: Costmap, time_ns: int, stamp_ns: int) -> None:
        """Send the referee's map and costmap, where they are due; in the plane alone.

        Args:
            costmap: The referee's, as it is.
            time_ns: Simulated time, ns.
            stamp_ns: ROS time of it, ns.
        """
        if not self._task.mission.planar or time_ns < self._grids_due_ns:
            return
        self._grids_due_ns = time_ns + GRID_PERIOD_NS
        frame, stamp = self._options.map_frame, time_of(stamp_ns)
        self._send("map", map_grid(costmap, frame, stamp))
        self._send("referee/costmap", costmap_grid(costmap, frame, stamp))

    def not_taken(self, wall_s: float) -> str:
        """Return a topic with a reliable reader that still lacks messages; empty if none."""
        for publisher in self.publishers.values():
            if not publisher.wait_for_readers(wall_s):
                return publisher.topic
        return ""

    def _send(self, topic: str, message: Message) -> None:
        if (publisher := self.publishers.get(topic)) is not None:
            publisher.publish(message)
