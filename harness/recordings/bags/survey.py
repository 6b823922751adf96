"""A first pass over a bag: its topics, frames and poses, and the order of its messages.

Where its clock was set back, or a simulator reset, a time has two poses, so the order in the file
tells the runs apart, for poses, transforms and sweeps alike; one of them is judged.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from wayproof.harness.errors import InputError
from wayproof.harness.interface.ros2.task import Announcement, read_task
from wayproof.harness.recordings.bags.container import RawMessage, messages_of
from wayproof.harness.recordings.bags.frames import FrameTree, Link
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
    camera_of,
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
from wayproof.harness.recordings.bags.series import Series
from wayproof.harness.recordings.bags.vendors.nav2 import is_costmap
from wayproof.harness.recordings.options import Broken, Faults, unreadable
from wayproof.harness.recordings.order import set_backs
from wayproof.harness.recordings.poses import RESET

FIRST_CLOUDS = 10
"""Number of clouds of a topic; the one with most points gives the unit of their times: the
first ones of a driver that starts up may hold no point, or few."""

TASK = "/task"
"""End of the topic with the task of an episode, as a stack of ROS 2 nodes gets it."""

OF_FRAME = "@"
"""Between topic and frame in the name of a sensor whose topic has messages of several frames; it is
in no name of a topic."""

MOST_FRAMES = 1000

NO_TASK = "task: cannot be read"
STAMPLESS = "sweep: without a stamp, taken as recorded"
OTHER_RUN = "sweep: of another run, as the clock was set back"


@dataclass
class SensorTopic:
    """A topic with ranges, points or depths.

    Attributes:
        first: Its first message that can be read, None if there was none; of clouds the one with
            the most finite points of the first `FIRST_CLOUDS`, which gives the unit of their times.
        points: Number of finite points in that cloud.
        series: Its messages.
        skipped: Number of messages of the topic, of other runs, before these.
        maxima: Maximum ranges of scans, m; more than a few are the greatest reading of each.
    """

    first: RawMessage | None = None
    points: int = -1
    series: Series = field(default_factory=Series.of_sweeps)
    skipped: int = 0
    maxima: set[float] = field(default_factory=set)

    @property
    def period_ns(self) -> float | None:
        """Median time between messages, ns; None of fewer than three."""
        steps = np.diff(np.unique(self.series.times))
        return float(np.median(steps)) if len(steps) > 1 else None


@dataclass
class PoseTopic:
    """Poses of a topic, with the frames of its first message, and its estimator's jumps so far."""

    parent: str
    child: str
    type: str
    resets: int = 0
    series: Series = field(default_factory=Series.of_poses)


@dataclass
class Survey:
    """Result of the first pass over a bag.

    Attributes:
        sensors: Topics with ranges, points or depths; of several frames each for itself.
        poses: Topics with poses.
        links: Transforms.
        cameras: Geometry of cameras by the topic of their CameraInfo, from stamps on, ns.
        limits: Minimum and maximum range by the topic of a Range, m.
        others: Types of the topics that are not read.
        task: Task of the episode whose topics were recorded; None of other robots.
        grids: The robot's own maps by topic.
        tree: Frames and the transforms between them; empty until those of a robot are chosen.
        unread: Why the first message of a topic that could not be read was not, by topic.
    """

    sensors: dict[str, SensorTopic] = field(default_factory=dict)
    poses: dict[str, PoseTopic] = field(default_factory=dict)
    links: dict[Link, Series] = field(default_factory=dict)
    cameras: dict[str, list[tuple[int, Camera]]] = field(default_factory=dict)
    limits: dict[str, tuple[float, float]] = field(default_factory=dict)
    others: dict[str, str] = field(default_factory=dict)
    task: Announcement | None = None
    grids: dict[str, Grids] = field(default_factory=dict)
    tree: FrameTree = field(default_factory=lambda: FrameTree({}, Counter()))
    unread: dict[str, str] = field(default_factory=dict)

    @property
    def lost(self) -> str:
        """Topics whose messages could not be read, in words; empty without any."""
        listed = [f"{topic} ({why})" for topic, why in sorted(self.unread.items())[:5]]
        return f"; cannot be read: {', '.join(listed)}" if listed else ""

    @property
    def moving(self) -> Iterator[tuple[str, Series]]:
        """Name and messages of all that moves."""
        for name, one in self.poses.items():
            yield name, one.series
        for link, series in self.links.items():
            if not link.is_fixed:
                yield f"{link.topic} {link.parent} -> {link.child}", series

    def between(self, first: int, last: int) -> Survey:
        """Return what was found at places in the file from the first up to, not with, a last."""
        return replace(
            self,
            sensors={
                name: replace(
                    one, series=one.series.between(first, last), skipped=one.series.before(first)
                )
                for name, one in self.sensors.items()
            },
            poses={
                name: replace(one, series=one.series.between(first, last))
                for name, one in self.poses.items()
            },
            links={
                link: one if link.is_fixed else one.between(first, last)
                for link, one in self.links.items()
            },
            grids={name: one.between(first, last) for name, one in self.grids.items()},
        )


def survey(files: Sequence[Path], faults: Faults) -> Survey:
    """Read a bag once, and keep its poses and the first messages of its sensors."""
    walk = _Walk(faults)
    for place, raw in enumerate(messages_of(files, faults)):
        try:
            walk.take(raw, place)
        except Broken as error:
            faults[unreadable(faults, error)] += 1
            walk.found.unread.setdefault(raw.topic, str(error))
    counts = Counter(topic for topic, _ in walk.sensors)
    walk.found.sensors = {
        topic if counts[topic] == 1 else f"{topic}{OF_FRAME}{frame}": one
        for (topic, frame), one in walk.sensors.items()
    }
    return walk.found


def topic_of(name: str) -> str:
    """Return the topic of a sensor: its name without a frame."""
    return name.partition(OF_FRAME)[0]


class _Walk:
    """First pass over a bag."""

    def __init__(self, faults: Faults) -> None:
        self._faults = faults
        self.found = Survey()
        self.sensors: dict[tuple[str, str], SensorTopic] = {}

    def take(self, raw: RawMessage, place: int) -> None:
        found = self.found
        if raw.type in SENSORS:
            self._sensor(raw, place)
        elif raw.type in TRANSFORMS:
            self._transforms(raw, place)
        elif raw.type in POSES:
            pose = pose_of(raw)
            new = PoseTopic(pose.parent, pose.child, raw.type, resets=pose.resets)
            topic = found.poses.setdefault(raw.topic, new)
            topic.series.add_pose(place, pose)
            self._faults[RESET] += topic.resets != pose.resets
            topic.resets = pose.resets
        elif raw.type in GRIDS and is_costmap(raw.topic, raw.type):
            grids = found.grids.setdefault(base_of(raw.topic), Grids([]))
            grids.take(GRIDS[raw.type](decode(raw)), place)
        elif raw.type == CAMERA:
            camera, stamp = camera_of(raw), header_stamp(raw)
            known = found.cameras.setdefault(raw.topic, [])
            same = known and known[-1][1] == camera  # one object of many alike
            known.append((stamp, known[-1][1] if same else camera))
        elif raw.type == RANGE:
            if raw.topic not in found.limits:
                message = decode(raw)
                found.limits[raw.topic] = scan_limits(message.min_range, message.max_range)
        else:
            found.others[raw.topic] = raw.type
            if raw.type == TEXT and raw.topic.endswith(TASK) and found.task is None:
                try:
                    found.task = read_task(decode(raw).data)
                except InputError:  # a text of that name may be anything
                    self._faults[NO_TASK] += 1

    def _sensor(self, raw: RawMessage, place: int) -> None:
        stamp, key = header_stamp(raw), (raw.topic, frame_of(raw))
        if raw.topic in self.found.others:
            return
        if key not in self.sensors and len(self.sensors) >= MOST_FRAMES:
            self._faults["message: of too many topics and frames"] += 1
            return
        topic = self.sensors.setdefault(key, SensorTopic())
        topic.series.add(place, stamp, min(raw.logged_ns, 2**62), len(raw.data))
        if raw.type == SCAN:
            topic.maxima.add(scan_maximum(raw))
        if topic.first is None and not is_sensor(raw):
            del self.sensors[key]
            self.found.others[raw.topic] = raw.type
        elif topic.first is None or len(topic.series.stamps) <= FIRST_CLOUDS:
            points = finite_points(raw) if raw.type in CLOUDS else 0
            if points > topic.points:
                topic.first, topic.points = raw, points

    def _transforms(self, raw: RawMessage, place: int) -> None:
        links = self.found.links
        for pose in transforms_of(raw):
            link = Link(raw.topic, pose.parent, pose.child)
            if link not in links and len(links) >= MOST_FRAMES:
                self._faults["transform: too many frames"] += 1
            else:
                links.setdefault(link, Series.of_poses()).add_pose(place, pose)


def choose_run(found: Survey, names: Sequence[str], faults: Faults) -> tuple[Survey, str]:
    """Return the run with the most sweeps of the sensors, and all of them in words.

    Args:
        found: What the first pass found.
        names: Sensors that are read.
        faults: Sweeps of other runs are counted.

    Raises:
        InputError: It is unknown to which run the sweeps belong.
    """
    cuts = _cuts([*found.moving, *((name, found.sensors[name].series) for name in names)])
    if not cuts:
        return found, ""
    runs = [
        found.between(first, last) for first, last in zip([0, *cuts], [*cuts, 2**62], strict=True)
    ]
    counts = [sum(len(run.sensors[name].series.stamps) for name in names) for run in runs]
    best = int(np.argmax(counts))
    for name in names:
        # The poses may be of another run than sweeps that lie beside all of them in the file.
        places = np.array(runs[best].sensors[name].series.places)
        moving = [np.array(one.places) for _, one in runs[best].moving]
        inside = any(((one >= places[0]) & (one <= places[-1])).any() for one in moving)
        if len(places) > 1 and not inside:
            raise InputError(
                f"the clock was set back, and no pose lies between the sweeps "
                f"of '{name}' in the file, so it cannot be told which run they are of: split it "
                "there"
            )
    faults[OTHER_RUN] += sum(counts) - counts[best]
    listed = []
    for number, (count, run) in enumerate(zip(counts, runs, strict=True), 1):
        stamps = [stamp for name in names for stamp in run.sensors[name].series.stamps]
        span = f", {min(stamps) * 1e-9:.1f} to {max(stamps) * 1e-9:.1f} s" if stamps else ""
        if number != best + 1:
            listed.append(f"run {number} ({count} sweeps{span})")
    return runs[best], (
        f"; run {best + 1} of {len(runs)}, as the clock was set back; not judged: "
        f"{', '.join(listed)}"
    )


def _cuts(streams: Sequence[tuple[str, Series]]) -> list[int]:
    """Return the places in the file from which on a new run counts.

    Streams are set back one after another, each at its next message: those up to the second one of
    any stream are one event, and it is where the first of them was.
    """
    met = [
        (one.places[k], name)
        for name, one in streams
        for k in set_backs(np.array(one.stamps, np.int64))
    ]
    cuts: list[int] = []
    seen: set[str] = set()
    for place, name in sorted(met):
        if not cuts or name in seen:
            cuts.append(place)
            seen = set()
        seen.add(name)
    return cuts
