"""A first pass over a bag: its topics, frames and poses, and the order of its messages."""

from __future__ import annotations

from array import array
from bisect import bisect_left
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from wayproof.harness.errors import InputError
from wayproof.harness.interface.ros2.task import Announcement, read_task
from wayproof.harness.recordings.bags.container import RawMessage, messages_of
from wayproof.harness.recordings.bags.frames import MOST_FRAMES, FrameTree, Samples
from wayproof.harness.recordings.bags.messages import (
    CAMERA,
    CLOUDS,
    GRIDS,
    POSES,
    RANGE,
    SCAN,
    SENSORS,
    TEXT,
    TRANSFORMS,
    Camera,
    add_camera,
    decode,
    frame_of,
    header_stamp,
    pose_of,
    transforms_of,
)
from wayproof.harness.recordings.bags.own_maps import Grids, base_of
from wayproof.harness.recordings.bags.sensors import (
    finite_points,
    is_sensor,
    scan_limits,
    scan_maximum,
)
from wayproof.harness.recordings.bags.transforms import Transforms, namespace_of
from wayproof.harness.recordings.bags.vendors.nav2 import is_costmap
from wayproof.harness.recordings.options import Broken, Faults, unreadable
from wayproof.harness.recordings.poses import RESET

FIRST_CLOUDS = 10
"""Number of clouds of a topic, of which one with most points gives the unit of their times: the
first ones of a driver that starts up may hold no point, or few."""

TASK = "/task"
"""End of the topic with the task of an episode, as a stack of ROS 2 nodes gets it."""

OF_FRAME = "@"
"""Between topic and frame in the name of a sensor whose topic has messages of several frames; it is
in no name of a topic."""

NO_TASK = "task: cannot be read"
STAMPLESS = "sweep: without a stamp, taken as recorded"


@dataclass
class SensorTopic:
    """Index of a topic with ranges, points or depths, of the first pass over a bag.

    Attributes:
        first: Its first message that can be read, None if there was none; of clouds the one with
            the most finite points of the first `FIRST_CLOUDS`, which gives the unit of their times.
        points: Number of finite points in that cloud.
        stamps: Stamps of the headers, ns.
        logged: Times at which they were recorded, ns.
        sizes: Bytes of the messages.
        places: Their places in the file.
        skipped: Number of messages of the topic, of other runs, before these.
        maxima: Maximum ranges of scans, m, with the number of scans of each.
    """

    first: RawMessage | None = None
    points: int = -1
    stamps: array[int] = field(default_factory=lambda: array("q"))
    logged: array[int] = field(default_factory=lambda: array("q"))
    sizes: array[int] = field(default_factory=lambda: array("q"))
    places: array[int] = field(default_factory=lambda: array("q"))
    skipped: int = 0
    maxima: Counter[float] = field(default_factory=Counter)

    @property
    def maximum_varies(self) -> bool:
        """Whether the maximum range is another one from scan to scan, so the greatest reading."""
        return len(self.maxima) > 3

    @property
    def times(self) -> NDArray[np.int64]:
        """Stamps (n,), or the times of recording where there are none, ns."""
        return np.array(self.stamps if self.is_stamped else self.logged, np.int64)

    @property
    def period_ns(self) -> float | None:
        """Median time between messages, ns; None of fewer than three."""
        steps = np.diff(np.unique(self.times))
        return float(np.median(steps)) if len(steps) > 1 else None

    @property
    def is_stamped(self) -> bool:
        """Whether its headers have stamps."""
        return any(self.stamps)

    def between(self, first: int, last: int) -> SensorTopic:
        """Return it with messages at places in the file from the first up to, not with, a last."""
        part = slice(bisect_left(self.places, first), bisect_left(self.places, last))
        return replace(
            self,
            stamps=self.stamps[part],
            logged=self.logged[part],
            sizes=self.sizes[part],
            places=self.places[part],
            skipped=part.start,
        )


@dataclass
class PoseTopic:
    """Poses of a topic, with the frames of its first message, and its estimator's jumps so far."""

    parent: str
    child: str
    type: str
    resets: int = 0
    samples: Samples = field(default_factory=Samples)


@dataclass
class Survey:
    """Result of the first pass over a bag.

    Attributes:
        sensors: Topics with ranges, points or depths; of several frames each for itself.
        poses: Topics with poses.
        cameras: Geometry of cameras by the topic of their CameraInfo, from stamps on, ns.
        limits: Minimum and maximum range by the topic of a Range, m.
        others: Types of the topics that are not read.
        transforms: Transforms by the namespace of their topics.
        tree: Frames and the transforms between them; empty until those of a robot are chosen.
        task: Task of the episode whose topics were recorded; None of other robots.
        grids: The robot's own maps by topic.
        unread: Why the first message of a topic that could not be read was not, by topic.
    """

    sensors: dict[str, SensorTopic]
    poses: dict[str, PoseTopic]
    cameras: dict[str, list[tuple[int, Camera]]]
    limits: dict[str, tuple[float, float]]
    others: dict[str, str]
    transforms: dict[str, Transforms]
    tree: FrameTree
    task: Announcement | None = None
    grids: dict[str, Grids] = field(default_factory=dict)
    unread: dict[str, str] = field(default_factory=dict)

    @property
    def lost(self) -> str:
        """Topics whose messages could not be read, in words; empty without any."""
        listed = [f"{topic} ({why})" for topic, why in sorted(self.unread.items())[:5]]
        return f"; cannot be read: {', '.join(listed)}" if listed else ""


def survey(files: Sequence[Path], faults: Faults) -> Survey:
    """Read a bag once, and keep its poses and the first messages of its sensors."""
    walk, unread = _Walk(faults), dict[str, str]()
    for raw in messages_of(files, faults):
        try:
            walk.take(raw)
        except Broken as error:
            faults[unreadable(faults, error)] += 1
            unread.setdefault(raw.topic, str(error))
    return Survey(
        sensors=_by_name(walk.sensors),
        poses=walk.poses,
        cameras={name: known for name, known in walk.cameras.items() if known},
        limits=walk.limits,
        others=walk.others,
        transforms=walk.transforms,
        tree=FrameTree({}, {}, faults),
        task=walk.task,
        grids=walk.grids,
        unread=unread,
    )


def topic_of(name: str) -> str:
    """Return the topic of a sensor: its name without a frame."""
    return name.partition(OF_FRAME)[0]


def _by_name(found: dict[tuple[str, str], SensorTopic]) -> dict[str, SensorTopic]:
    """Return sensors by name: a topic, with the frame where it has messages of several."""
    counts = Counter(topic for topic, _ in found)
    return {
        topic if counts[topic] == 1 else f"{topic}{OF_FRAME}{frame}": one
        for (topic, frame), one in found.items()
    }


class _Walk:
    """First pass over a bag."""

    def __init__(self, faults: Faults) -> None:
        self._faults = faults
        self.place = 0
        self.sensors: dict[tuple[str, str], SensorTopic] = {}
        self.poses: dict[str, PoseTopic] = {}
        self.cameras: dict[str, list[tuple[int, Camera]]] = {}
        self.limits: dict[str, tuple[float, float]] = {}
        self.others: dict[str, str] = {}
        self.transforms: dict[str, Transforms] = {}
        self.grids: dict[str, Grids] = {}
        self._links: Counter[bool] = Counter()  # by whether they are fixed
        self.task: Announcement | None = None

    def take(self, raw: RawMessage) -> None:
        self.place += 1
        if raw.type in SENSORS:
            self._sensor(raw)
        elif raw.type in TRANSFORMS:
            self._transforms(raw)
        elif raw.type in POSES:
            pose = pose_of(raw)
            new = PoseTopic(pose.parent, pose.child, raw.type, resets=pose.resets)
            topic = self.poses.setdefault(raw.topic, new)
            topic.samples.add(pose, self.place)
            if topic.resets != pose.resets:
                self._faults[RESET] += 1
                topic.resets = pose.resets
        elif raw.type in GRIDS and is_costmap(raw.topic, raw.type):
            self.grids.setdefault(base_of(raw.topic), Grids([])).take(
                GRIDS[raw.type](decode(raw)), self.place
            )
        elif raw.type == CAMERA:
            add_camera(self.cameras.setdefault(raw.topic, []), raw)
        elif raw.type == RANGE:
            if raw.topic not in self.limits:
                message = decode(raw)
                self.limits[raw.topic] = scan_limits(message.min_range, message.max_range)
        else:
            self.others[raw.topic] = raw.type
            if raw.type == TEXT and raw.topic.endswith(TASK) and self.task is None:
                self._task(raw)

    def _task(self, raw: RawMessage) -> None:
        """Take the task of an episode; a text of that name may be anything."""
        try:
            self.task = read_task(decode(raw).data)
        except InputError:
            self._faults[NO_TASK] += 1

    def _sensor(self, raw: RawMessage) -> None:
        stamp, key = header_stamp(raw), (raw.topic, frame_of(raw))
        if raw.topic in self.others:
            return
        if key not in self.sensors and len(self.sensors) >= MOST_FRAMES:
            self._faults["message: of too many topics and frames"] += 1
            return
        topic = self.sensors.setdefault(key, SensorTopic())
        topic.stamps.append(stamp)
        topic.logged.append(min(raw.logged_ns, 2**62))
        topic.sizes.append(len(raw.data))
        topic.places.append(self.place)
        if raw.type == SCAN:
            topic.maxima[scan_maximum(raw)] += 1
        if topic.first is None and not is_sensor(raw):
            del self.sensors[key]
            self.others[raw.topic] = raw.type
        elif topic.first is None or len(topic.stamps) <= FIRST_CLOUDS:
            points = finite_points(raw) if raw.type in CLOUDS else 0
            if points > topic.points:
                topic.first, topic.points = raw._replace(data=bytes(raw.data)), points

    def _transforms(self, raw: RawMessage) -> None:
        is_fixed = raw.topic.rsplit("/", 1)[-1] == "tf_static"
        namespace = namespace_of(raw.topic)
        known = self.transforms.get(namespace, Transforms())
        links = known.fixed if is_fixed else known.moving
        for pose in transforms_of(raw):
            key = pose.parent, pose.child
            if key not in links:
                if self._links[is_fixed] >= MOST_FRAMES:
                    self._faults["transform: too many frames"] += 1
                    continue
                self._links[is_fixed] += 1
                self.transforms.setdefault(namespace, known).topics.add(raw.topic)
            links.setdefault(key, Samples()).add(pose, self.place)
