"""Reader of ROS bags: ROS 1, and ROS 2 in MCAP and SQLite."""

from __future__ import annotations

import heapq
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from wayproof.harness.errors import InputError
from wayproof.harness.recordings.bags.choose import (
    LIMITS,
    SILENT,
    UNSURE,
    Motion,
    body_height,
    choose_cameras,
    choose_motion,
    choose_mount,
    choose_sensors,
    declared,
    order_in_task,
)
from wayproof.harness.recordings.bags.clouds import OWN_TIME, read_cloud
from wayproof.harness.recordings.bags.container import (
    RawMessage,
    container_of,
    files_of,
    messages_of,
)
from wayproof.harness.recordings.bags.frames import FramePath
from wayproof.harness.recordings.bags.messages import IMAGE, frame_of, header_stamp
from wayproof.harness.recordings.bags.own_maps import own_maps
from wayproof.harness.recordings.bags.runs import choose_run
from wayproof.harness.recordings.bags.sensors import Reading, Topic, beams_of, first_of, measured_by
from wayproof.harness.recordings.bags.survey import (
    OF_FRAME,
    STAMPLESS,
    SensorTopic,
    Survey,
    survey,
    topic_of,
)
from wayproof.harness.recordings.bags.transforms import tree_for
from wayproof.harness.recordings.beams import (
    FARTHEST,
    Beams,
    Limits,
    Silent,
    float32,
    from_first_beam,
)
from wayproof.harness.recordings.digest import digest_of
from wayproof.harness.recordings.order import Order, nearly_sorted
from wayproof.harness.recordings.poses import track_of
from wayproof.harness.recordings.recording import (
    Broken,
    Faults,
    Recording,
    RecordingOptions,
    unreadable,
)
from wayproof.harness.recordings.types import RecordedSensor, RecordedSweep, Transform
from wayproof.harness.recordings.window import NO_BEAM, OUT_OF_ORDER, Window, window_of

NO_MOUNT = "sweep: no transform at its time"


def looks_like(path: Path) -> bool:
    """Return whether a path is a bag: a file by its first bytes, a folder by the files in it."""
    files = files_of(path)
    return bool(files) and all(container_of(one) is not None for one in files)


def open_bag(path: Path, options: RecordingOptions) -> Recording:
    """Open a bag: read it once for its poses and transforms.

    Raises:
        InputError: It has no sensor or no poses, several of which none was chosen, or no transform
            between body and sensor.
    """
    faults: Faults = Counter()
    files = files_of(path)
    if not files or container_of(files[0]) is None:
        raise InputError(
            f"recording '{path}': not a bag of ROS 1 (.bag), ROS 2 (.mcap, .db3) or PX4 (.ulg)"
        )
    found = survey(files, faults)
    names = choose_sensors(path, found, options)
    names.sort(key=lambda name: order_in_task(name, found))
    found, runs = choose_run(path, found, names, faults)
    found.tree = tree_for(path, found.transforms, names, faults, options.pose)
    topics = [_topic(path, name, found, options) for name in names]
    motion = choose_motion(path, found, topics, options)
    poses, task = motion.poses, found.task
    if task is not None:  # before its start a node was waited for
        poses = poses.at(poses.stamps_ns >= task.start_ns)
    track, start = track_of(path, poses, motion.source, options, faults)
    window = window_of(track, start, options)
    if task is not None and window.first_ns is None:
        window = replace(window, first_ns=task.start_ns - start)
    readers = [
        _reader(path, files, name, topic, found, motion, options, window)
        for name, topic in zip(names, topics, strict=True)
    ]
    for reader in readers:
        if not reader.is_stamped:
            faults[STAMPLESS] += len(reader.order.kept)
    return Recording(
        name=path.resolve().name,
        format="bag",
        sha256=digest_of(files),
        start_ns=start,
        sensors=tuple(reader.sensor for reader in readers),
        track=track,
        chosen=f"{', '.join(reader.text for reader in readers)}; poses: {motion.source}{runs}",
        opening=faults,
        read=_Sweeps(readers),
        body_height=body_height(found, motion.body, start),
        mission=None if task is None else task.mission,
        own_maps=own_maps(found.grids, found.tree, motion.world, start, faults),
    )


@dataclass(frozen=True)
class _Sweeps:
    """The sweeps of all chosen sensors, in order of time and of their names."""

    readers: Sequence[_TopicReader]

    def __call__(self, faults: Faults) -> Iterator[RecordedSweep]:
        counted: Faults = Counter()  # damage was counted when the bag was opened
        streams = [reader.sweeps(counted, faults) for reader in self.readers]
        return heapq.merge(*streams, key=lambda sweep: (sweep.time_ns, sweep.sensor))


@dataclass(frozen=True)
class _TopicReader:
    """One sensor of a bag.

    Attributes:
        files: Files of the bag.
        topic: Its topic.
        frame: Frame of its messages, where the topic has others too; else None.
        skipped: Number of its first messages that are of another run.
        sensor: Properties of the sensor.
        reading: Settings by which its messages are read.
        order: Messages that are read, and whether they are in order.
        is_stamped: Whether its headers have stamps; else the time of recording is taken.
        mount: Its place on the body, which may move.
        window: Times that are read.
    """

    files: Sequence[Path]
    topic: str
    frame: str | None
    skipped: int
    sensor: RecordedSensor
    reading: Reading
    order: Order
    is_stamped: bool
    mount: FramePath | Transform
    window: Window

    @property
    def text(self) -> str:
        """Topic, kind of sensor and field of the times, in words."""
        time = self.reading.topic.time
        name = self.topic if self.frame is None else f"{self.topic}{OF_FRAME}{self.frame}"
        return f"{name} ({self.sensor.kind}{f', time {time.text}' if time else ''})"

    def sweeps(self, counted: Faults, faults: Faults) -> Iterator[RecordedSweep]:
        """Yield the sweeps in order of their stamps."""
        fixed = self._fixed_mount()
        for stamp, raw, silent in self._messages(counted, faults):
            if not self.window.has_pose(stamp, None, faults):
                continue
            try:
                beams = beams_of(raw, self.reading, silent, faults)
            except Broken as error:
                faults[unreadable(faults, error)] += 1
                continue
            mount = fixed or self._mount_at(stamp, faults)
            # An episode's first sweep began before its first pose: the body stood there.
            times = None if beams.measured is not None else beams.times_ns
            if mount is None or not self.window.has_pose(stamp, times, faults):
                continue
            if len(beams.ranges):
                yield self._sweep(stamp, beams, mount)
            else:
                faults[NO_BEAM] += 1

    def _sweep(self, stamp: int, beams: Beams, mount: Transform) -> RecordedSweep:
        """Return a sweep that begins with its first beam."""
        early, times = from_first_beam(beams)
        return RecordedSweep(
            time_ns=stamp - self.window.start_ns + early,
            sensor=self.sensor.name,
            directions=beams.directions,
            ranges=beams.ranges,
            beam_times_ns=times,
            T_body_sensor=mount,
            grid=beams.grid,
            points=beams.points,
            measured=beams.measured,
        )

    def _messages(
        self, counted: Faults, faults: Faults
    ) -> Iterator[tuple[int, RawMessage, Silent | None]]:
        """Yield stamp, message, and beams without return, in order."""
        if self.order.is_sorted:
            items: Iterator[tuple[int, int, _Item]] = self._in_file(counted, keep=False)
        else:
            items = nearly_sorted(self._in_file(counted, keep=True))
        for stamp, _, (place, raw, silent) in items:
            if not self.window.holds(stamp):
                continue
            if self.order.kept[place]:
                yield stamp, raw, silent
            else:
                faults[OUT_OF_ORDER] += 1

    def _in_file(self, counted: Faults, keep: bool) -> Iterator[tuple[int, int, _Item]]:
        """Yield stamp, size and message of the topic in the order of the files."""
        place = -self.skipped
        silent: tuple[int, Silent] | None = None
        for raw in messages_of(self.files, counted):
            if raw.topic in (self.topic + SILENT, self.topic + UNSURE):
                silent = _silent(raw)
            if raw.topic != self.topic:
                continue
            if self.frame is not None and frame_of(raw) != self.frame:
                continue
            try:
                stamp = header_stamp(raw)
            except Broken:
                continue
            if not 0 <= place < len(self.order.kept):  # of another run
                place += 1
                continue
            if keep:
                raw = raw._replace(data=bytes(raw.data))
            beside = silent[1] if silent is not None and silent[0] == stamp else None
            logged = min(raw.logged_ns, 2**62)
            yield (stamp if self.is_stamped else logged), len(raw.data), (place, raw, beside)
            place += 1

    def _fixed_mount(self) -> Transform | None:
        if not isinstance(self.mount, FramePath):
            return self.mount
        if not self.mount.is_fixed:
            return None
        transform, _ = self.mount.at(np.zeros(1, np.int64))
        return Transform(transform.position[0], transform.quaternion[0])

    def _mount_at(self, stamp: int, faults: Faults) -> Transform | None:
        assert isinstance(self.mount, FramePath)
        transform, known = self.mount.at(np.array([stamp]))
        if not known[0]:
            faults[NO_MOUNT] += 1
            return None
        return Transform(transform.position[0], transform.quaternion[0])


_Item = tuple[int, RawMessage, Silent | None]
"""Place in the file, message, and beams without return."""


def _topic(path: Path, name: str, found: Survey, options: RecordingOptions) -> Topic:
    first, info = found.sensors[name].first, declared(name, found)
    assert first is not None
    if info is not None:
        return measured_by(info)
    cameras = choose_cameras(path, topic_of(name), found, options) if first.type == IMAGE else ()
    try:
        limits = found.limits.get(topic_of(name) + LIMITS, (0.0, np.inf))
        topic = first_of(first, cameras, limits, found.sensors[name].period_ns)
    except Broken as error:
        raise InputError(f"recording '{path}': '{name}' cannot be read ({error})") from None
    topic = topic._replace(period_ns=found.sensors[name].period_ns)
    maxima = found.sensors[name].maxima
    if not maxima:
        return topic
    varies = found.sensors[name].maximum_varies
    return topic._replace(range_max=max(maxima), maximum_varies=varies)


def _reader(
    path: Path,
    files: Sequence[Path],
    name: str,
    topic: Topic,
    found: Survey,
    motion: Motion,
    options: RecordingOptions,
    window: Window,
) -> _TopicReader:
    one: SensorTopic = found.sensors[name]
    cut = min(topic.range_max, float32(options.range_max or np.inf))
    free = options.missing_returns_free
    silence_known = topic.declared is not None or name + SILENT in found.sensors
    mount = choose_mount(path, found, motion.body, topic, options)
    sensor = RecordedSensor(
        name=name.lstrip("/"),
        frame=topic.frame,
        kind=topic.kind,
        range_min=topic.range_min,
        range_max=cut,
        missing_returns_known=silence_known if free is None else free,
        declared=topic.declared,
        mount_is_fixed=not isinstance(mount, FramePath) or mount.is_fixed,
    )
    limits = Limits(topic.range_min, min(topic.range_max, FARTHEST), cut, beyond_is_none=False)
    reading = Reading(topic, limits, options)
    return _TopicReader(
        files=files,
        topic=topic_of(name),
        frame=topic.frame if OF_FRAME in name else None,
        skipped=one.skipped,
        sensor=sensor,
        reading=reading,
        order=one.order(),
        is_stamped=one.is_stamped,
        mount=mount,
        window=window,
    )


def _silent(raw: RawMessage) -> tuple[int, Silent] | None:
    """Return the stamp and the beams of a message of beams without return."""
    try:
        cloud = read_cloud(raw)
    except Broken:
        return None
    squares = np.square(cloud.points.astype(np.float64)).sum(axis=1)
    unit = np.abs(squares - 1.0) < 1e-3  # false for NaN
    times = None
    if cloud.times is not None and cloud.time_field == OWN_TIME:
        times = cloud.times.astype(np.int64)[unit]
    return cloud.stamp_ns, Silent(cloud.points[unit], times)
