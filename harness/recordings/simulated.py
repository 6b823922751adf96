"""A log of a simulated episode as a recording: its robot's measurements and estimates.

The ground truth of the episode is not read.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from wayproof.harness.errors import InputError, unknown_name
from wayproof.harness.inputs import Beams as LoggedBeams
from wayproof.harness.inputs import SweepInput
from wayproof.harness.log.codec.container import is_log
from wayproof.harness.log.codec.messages import read_messages
from wayproof.harness.log.reader import Log, open_log
from wayproof.harness.recordings.beams import Beams, measured_beams
from wayproof.harness.recordings.options import Faults, RecordingOptions
from wayproof.harness.recordings.poses import StampedPoses
from wayproof.harness.recordings.recording import Recording, Stream, recording_of, sensor_of
from wayproof.harness.recordings.transform import Transform, quaternion_of
from wayproof.harness.recordings.types import SensorKind
from wayproof.harness.schema import wayproof_pb2 as pb

Payload = tuple[SweepInput, LoggedBeams, int]
"""A sweep, the beams of its sensor, and the number of its decision."""


def looks_like(path: Path) -> bool:
    """Return whether a file is an MCAP file with the profile of our logs."""
    return path.is_file() and is_log(path)


def open_episode(path: Path, options: RecordingOptions) -> Recording:
    """Open the log of an episode; its sensors are those of the robot, all of them or the chosen.

    Raises:
        InputError: It is no finished log, or its sweeps were left out.
    """
    log, faults = open_log(path), Counter[str]()
    log.check_sweeps()
    if log.config.recording is not None:
        raise InputError("the log of a recording, expected the recording")
    for name in options.sensors:
        if name not in log.beams:
            raise unknown_name("sensor of the recording", name, log.beams)
    streams = [_stream(log, name, options) for name in sorted(options.sensors or log.beams)]
    source = "the estimated poses"
    found = recording_of(path, "wayproof", [path], streams, _poses(path), source, options, faults)
    height = float(found.track.positions[0, 2])  # the floor of a world is at z = 0
    return replace(found, body_height=height)


def _stream(log: Log, name: str, options: RecordingOptions) -> Stream:
    beams = log.beams[name]
    kind: SensorKind = "depth" if beams.table.measures == "depth" else "points"
    sensor = sensor_of(name, kind, options, ranges=(0.0, beams.range), silence_known=True)
    position, R = beams.mounting
    stamps = [
        record.inputs.time_ns
        for record in log.records()
        for sweep in record.inputs.sweeps
        if sweep.sensor == name
    ]
    return Stream(
        sensor=sensor,
        stamps=np.array(stamps, np.int64),
        payloads=partial(_payloads, log, name),
        read=partial(_beams, sensor.range_max),
        mount=Transform(position, quaternion_of(R)),
    )


def _payloads(log: Log, name: str) -> Iterator[Payload]:
    for record in log.records():
        sequence = record.inputs.sequence
        for sweep in record.inputs.sweeps:
            if sweep.sensor == name:
                yield sweep, log.as_of(sequence).beams[name], sequence


def _beams(range_max: float, payload: Payload, faults: Faults) -> Beams:
    """Return the beams of a sweep with information, as points of 32 bits."""
    sweep, logged, sequence = payload
    found = measured_beams(logged, sweep.ranges_mm.astype(np.uint16), sequence, range_max, faults)
    return found._replace(measured=None)


def _poses(path: Path) -> StampedPoses:
    """Return the estimated poses of all decisions, with those while their sweeps were taken."""
    stamps: list[int] = []
    rows: list[list[float]] = []
    for message in read_messages(path):
        if not isinstance(message, pb.Pose):
            continue
        now = message.timestamp.ToNanoseconds()
        period_ns = round(message.history_period_s * 1e9)
        past = list(message.history_positions), list(message.history_quaternions)
        count = min(len(past[0]) // 3, len(past[1]) // 4)
        for k in range(count - 1):  # the last one is the pose itself
            stamp = now - (count - 1 - k) * period_ns
            if not stamps or stamp > stamps[-1]:
                stamps.append(stamp)
                rows.append([*past[0][3 * k : 3 * k + 3], *past[1][4 * k : 4 * k + 4]])
        if len(message.position) == 3 and len(message.quaternion) == 4:
            stamps.append(now)
            rows.append([*message.position, *message.quaternion])
    table = np.array(rows, np.float64).reshape(-1, 7)
    return StampedPoses(np.array(stamps, np.int64), table[:, :3], table[:, 3:])
