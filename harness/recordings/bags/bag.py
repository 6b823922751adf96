"""Reader of ROS bags: ROS 1, and ROS 2 in MCAP and SQLite; and of PX4's own log."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np

from wayproof.harness.errors import InputError
from wayproof.harness.recordings.bags.choose import (
    LIMITS,
    SILENT,
    UNSURE,
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
from wayproof.harness.recordings.bags.frames import FramePath, tree_for
from wayproof.harness.recordings.bags.messages import IMAGE, frame_of, header_stamp
from wayproof.harness.recordings.bags.own_maps import own_maps
from wayproof.harness.recordings.bags.sensors import Topic, beams_of, first_of, measured_by
from wayproof.harness.recordings.bags.survey import (
    OF_FRAME,
    STAMPLESS,
    Survey,
    choose_run,
    survey,
    topic_of,
)
from wayproof.harness.recordings.beams import FARTHEST, Beams, Limits, Silent
from wayproof.harness.recordings.options import Broken, Faults, RecordingOptions
from wayproof.harness.recordings.recording import Recording, Stream, recording_of, sensor_of


def looks_like(path: Path) -> bool:
    """Return whether a path is a bag: a file by its first bytes, a folder by the files in it."""
    files = files_of(path)
    return bool(files) and all(container_of(one) is not None for one in files)


def open_bag(path: Path, options: RecordingOptions) -> Recording:
    """Open a bag: read it once for its poses and transforms.

    Raises:
        InputError: It has no sensor or no poses, several and none was chosen, or no transform
            between body and sensor.
    """
    faults: Faults = Counter()
    files = files_of(path)
    if not files or container_of(files[0]) is None:
        raise InputError("not a bag of ROS 1 (.bag), ROS 2 (.mcap, .db3) or PX4 (.ulg)")
    found = survey(files, faults)
    names = choose_sensors(found, options)
    names.sort(key=lambda name: order_in_task(name, found))
    found, runs = choose_run(found, names, faults)
    found.tree = tree_for(found.links, names, faults, options.pose)
    topics = [_topic(name, found, options) for name in names]
    motion = choose_motion(found, topics, options)
    poses, task = motion.poses, found.task
    if task is not None:  # before its start a node was waited for
        poses = poses.at(poses.stamps_ns >= task.start_ns)
    streams = []
    for name, topic in zip(names, topics, strict=True):
        mount = choose_mount(found, motion.body, topic, options)
        streams.append(_stream(files, name, topic, found, mount, options))
        stamps = found.sensors[name].series.stamps
        faults[STAMPLESS] += 0 if any(stamps) else len(stamps)
    said = ", ".join(map(_in_words, names, topics))
    recording = recording_of(
        path, "bag", files, streams, poses, motion.source, options, faults, said
    )
    start, begin = recording.start_ns, recording.begin_ns
    if task is not None and begin is None:
        begin = task.start_ns - start
    return replace(
        recording,
        chosen=recording.chosen + runs,
        begin_ns=begin,
        body_height=body_height(found, motion.body, start),
        mission=None if task is None else task.mission,
        own_maps=own_maps(found.grids, found.tree, motion.world, start, faults),
    )


class _Payload(NamedTuple):
    """A message of a sensor, with the beams without return that were recorded beside it."""

    raw: RawMessage
    silent: Silent | None


def _stream(
    files: Sequence[Path],
    name: str,
    topic: Topic,
    found: Survey,
    mount: FramePath,
    options: RecordingOptions,
) -> Stream:
    index = found.sensors[name]
    sensor = sensor_of(
        name.lstrip("/"),
        topic.kind,
        options,
        frame=topic.frame,
        ranges=(topic.range_min, topic.range_max),
        silence_known=topic.declared is not None or name + SILENT in found.sensors,
        declared=topic.declared,
        mount_is_fixed=mount.is_fixed,
    )
    highest = min(topic.range_max, FARTHEST)
    limits = Limits(topic.range_min, highest, sensor.range_max, beyond_is_none=False)
    frame = topic.frame if OF_FRAME in name else None
    return Stream(
        sensor=sensor,
        stamps=index.series.times,
        payloads=partial(_payloads, files, topic_of(name), frame, index.skipped),
        read=partial(_read, topic, limits, options),
        mount=mount.mount,
        sizes=index.series.table[:, 1].astype(np.int64),
    )


def _read(
    topic: Topic, limits: Limits, options: RecordingOptions, payload: _Payload, faults: Faults
) -> Beams:
    return beams_of(payload.raw, topic, limits, options, payload.silent, faults)


def _payloads(
    files: Sequence[Path], topic: str, frame: str | None, skipped: int
) -> Iterator[_Payload]:
    """Yield the messages of a topic in the order of the files, but for the first of them.

    Args:
        files: Files of the bag; what is damaged was counted when it was opened.
        topic: Their topic.
        frame: Frame of the messages, where the topic has others too; else None.
        skipped: Number of messages that are of another run, before these.
    """
    silent: tuple[int, Silent] | None = None
    for raw in messages_of(files, Counter()):
        if raw.topic in (topic + SILENT, topic + UNSURE):
            silent = _silent(raw)
        if raw.topic != topic or (frame is not None and frame_of(raw) != frame):
            continue
        try:
            stamp = header_stamp(raw)
        except Broken:
            continue
        skipped -= 1
        if skipped < 0:
            is_beside = silent is not None and silent[0] == stamp
            yield _Payload(raw, silent[1] if silent is not None and is_beside else None)


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


def _in_words(name: str, topic: Topic) -> str:
    """Return topic, kind of sensor and field of the times."""
    return f"{name} ({topic.kind}{f', time {topic.time.text}' if topic.time else ''})"


def _topic(name: str, found: Survey, options: RecordingOptions) -> Topic:
    index, info = found.sensors[name], declared(name, found)
    assert index.first is not None
    if info is not None:
        return measured_by(info)
    is_image = index.first.type == IMAGE
    cameras = choose_cameras(topic_of(name), found, options) if is_image else ()
    limits = found.limits.get(topic_of(name) + LIMITS, (0.0, np.inf))
    try:
        topic = first_of(index.first, cameras, limits, index.period_ns)
    except Broken as error:
        raise InputError(f"'{name}' cannot be read ({error})") from None
    if index.maxima:
        varies = len(index.maxima) > 3  # so it is the greatest reading
        topic = topic._replace(range_max=max(index.maxima), maximum_varies=varies)
    return topic
