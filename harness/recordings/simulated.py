"""A log of a simulated episode as a recording: its robot's measurements and estimates.

The ground truth of the episode is not read.
"""

from __future__ import annotations

import heapq
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from wayproof.harness.errors import InputError, unknown_name
from wayproof.harness.inputs import Beams as LoggedBeams
from wayproof.harness.inputs import SweepInput
from wayproof.harness.log.codec.container import is_log
from wayproof.harness.log.codec.messages import read_messages
from wayproof.harness.log.reader import Log, open_log
from wayproof.harness.recordings.beams import (
    FARTHEST,
    Beams,
    Limits,
    Silent,
    float32,
    from_first_beam,
    point_beams,
)
from wayproof.harness.recordings.digest import digest_of
from wayproof.harness.recordings.folders import new_faults
from wayproof.harness.recordings.matrices import quaternion_of
from wayproof.harness.recordings.poses import StampedPoses, track_of
from wayproof.harness.recordings.recording import Faults, Recording, RecordingOptions
from wayproof.harness.recordings.types import RecordedSensor, RecordedSweep, Transform
from wayproof.harness.recordings.window import NO_BEAM, Window, window_of
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.models.sensors.beams import (
    DROPPED,
    MILLIMETRES,
    NO_RETURN,
    directions,
    pose_indices,
    pose_offsets,
    ray_ranges,
)


def looks_like(path: Path) -> bool:
    """Return whether a file is an MCAP file with the profile of our logs."""
    return path.is_file() and is_log(path)


def open_episode(path: Path, options: RecordingOptions) -> Recording:
    """Open the log of an episode; its sensors are those of the robot, all of them or the chosen.

    Raises:
        InputError: It is no finished log, or its sweeps were left out.
    """
    faults = new_faults()
    log = open_log(path)
    log.check_sweeps()
    if log.config.recording is not None:
        raise InputError(f"recording '{path}': the log of a recording, expected the recording")
    for name in options.sensors:
        if name not in log.beams:
            raise unknown_name("sensor of the recording", name, log.beams)
    chosen = sorted(options.sensors or log.beams)
    track, start = track_of(
        path, _poses(path), source="the estimated poses", options=options, faults=faults
    )
    sensors = tuple(_sensor(name, log.beams[name], options) for name in chosen)
    return Recording(
        name=path.name,
        format="wayproof",
        sha256=digest_of([path]),
        start_ns=start,
        sensors=sensors,
        track=track,
        chosen=f"sensors {', '.join(chosen)}; poses: {track.source}",
        opening=faults,
        read=_Sweeps(log, {one.name: one for one in sensors}, window_of(track, start, options)),
        body_height=float(track.positions[0, 2]),  # the floor of a world is at z = 0
    )


@dataclass(frozen=True)
class _Sweeps:
    """The sweeps of a log, as often as they are read."""

    log: Log
    sensors: dict[str, RecordedSensor]
    window: Window

    def __call__(self, faults: Faults) -> Iterator[RecordedSweep]:
        """Yield the sweeps by their first beams, of which the sensors have different delays."""
        longest_ns = max(round(1e9 / one.rate) for one in self.log.beams.values())
        heap: list[tuple[int, str, int, RecordedSweep]] = []
        count = 0
        for record in self.log.records():
            inputs = record.inputs
            if not self.window.holds(inputs.time_ns):
                continue
            beams = self.log.as_of(inputs.sequence).beams
            for sweep in inputs.sweeps:
                if sweep.sensor not in self.sensors:
                    continue
                logged = beams[sweep.sensor]
                for one in self._sweep(sweep, logged, inputs.time_ns, inputs.sequence, faults):
                    heapq.heappush(heap, (one.time_ns, one.sensor, count, one))
                    count += 1
            certain_ns = inputs.time_ns - self.window.start_ns - longest_ns
            while heap and heap[0][0] < certain_ns:
                yield heapq.heappop(heap)[-1]
        while heap:
            yield heapq.heappop(heap)[-1]

    def _sweep(
        self, sweep: SweepInput, logged: LoggedBeams, time_ns: int, sequence: int, faults: Faults
    ) -> Iterator[RecordedSweep]:
        beams = _beams(sweep, logged, sequence, self.sensors[sweep.sensor], faults)
        if not len(beams.ranges):
            faults[NO_BEAM] += 1
        elif self.window.has_pose(time_ns, beams.times_ns, faults):
            early, times = from_first_beam(beams)
            yield RecordedSweep(
                time_ns=time_ns - self.window.start_ns + early,
                sensor=sweep.sensor,
                directions=beams.directions,
                ranges=beams.ranges,
                beam_times_ns=times,
                T_body_sensor=_mount(logged),
                points=beams.points,
            )


def _beams(
    sweep: SweepInput,
    logged: LoggedBeams,
    sequence: int,
    sensor: RecordedSensor,
    faults: Faults,
) -> Beams:
    """Return the beams of a sweep with information, as points of 32 bits."""
    table = logged.table
    unit = directions(table, sequence)
    if len(sweep.ranges_mm) != len(unit):
        raise InputError(
            f"sweep of '{sweep.sensor}': {len(sweep.ranges_mm)} beams, expected {len(unit)}"
        )
    ranges_mm = ray_ranges(table, unit, sweep.ranges_mm)
    silent = ranges_mm == NO_RETURN
    met = ~silent & (ranges_mm != DROPPED)
    times: NDArray[np.int64] | None = None
    if table.scan_poses > 1:
        times = pose_offsets(table, round(1e9 / logged.rate))[pose_indices(table)]
    points = (unit[met] * (ranges_mm[met, None] / MILLIMETRES)).astype(np.float32)
    limits = Limits(0.0, FARTHEST, sensor.range_max, beyond_is_none=False)
    none = Silent(unit[silent].astype(np.float32), None if times is None else times[silent])
    return point_beams(
        points,
        times_ns=None if times is None else times[met],
        limits=limits,
        faults=faults,
        silent=none,
    )


def _sensor(name: str, beams: LoggedBeams, options: RecordingOptions) -> RecordedSensor:
    free = options.missing_returns_free
    return RecordedSensor(
        name=name,
        frame=name,
        kind="depth" if beams.table.measures == "depth" else "points",
        range_min=0.0,
        range_max=float32(min(beams.range, options.range_max or np.inf)),
        missing_returns_known=True if free is None else free,
    )


def _mount(beams: LoggedBeams) -> Transform:
    position, R = beams.mounting
    return Transform(position, quaternion_of(R))


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
