"""Recorded sweeps as messages of the log, each beam with the pose that it leaves from."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from wayproof.harness.input_messages import beams_from_info
from wayproof.harness.listed_beams import CODEC, MOST_POSES, OLDEST_S, write_list
from wayproof.harness.recordings.transform import Transform
from wayproof.harness.recordings.types import RecordedSensor, RecordedSweep
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.models.poses import rotation_matrices
from wayproof.models.sensors import codecs
from wayproof.models.sensors.beams import DROPPED, MILLIMETRES, NO_RETURN, pose_offsets

POSE_STEP_NS = 5_000_000
"""Time for which beams leave from one pose, ns: at 2 m/s the sensor moves by 1 cm meanwhile."""

SAME_MOUNT = 1e-6
"""Difference up to which two mounts are one, m and of quaternions."""


def topic_name(name: str) -> str:
    """Return the name of a sensor in the log, from its topic or file."""
    kept = "".join(c if c.isalnum() or c in "-_." else "_" for c in name.strip("/"))
    return kept[:60] or "sensor"


def sensor_message(
    sensor: RecordedSensor, mount: Transform, range_m: float, rate_hz: float
) -> pb.SensorInfo:
    """Return the sensor as the log declares it.

    Args:
        sensor: Sensor of the recording.
        mount: T_base_sensor.
        range_m: Longest range that counts, m.
        rate_hz: Sweeps a second.
    """
    R = rotation_matrices(mount.quaternion[None])[0]
    return pb.SensorInfo(
        name=topic_name(sensor.name),
        kind=KINDS[sensor.kind],
        range_m=range_m,
        rate_hz=rate_hz,
        order="list",
        measures="range",
        scan_poses=1,
        device=sensor.name,
        source="recording",
        position_base_sensor=mount.position.tolist(),
        rotation_base_sensor=R.ravel().tolist(),
    )


KINDS = {"laser": "lidar", "points": "lidar", "depth": "depth_camera"}
"""Kind of a recorded sensor -> kind in the log."""


class TableWriter:
    """Writes the sweeps of a sensor whose ranges were recorded as it measured them.

    Attributes:
        info: Its declaration in the log: that of the episode, by its topic's name.
        age_ns: Age of its oldest beam at the end of a sweep, ns.
    """

    def __init__(self, sensor: RecordedSensor, declared: pb.SensorInfo) -> None:
        """Write by the tables of a declaration."""
        self._sensor = sensor
        self.info = pb.SensorInfo()
        self.info.CopyFrom(declared)
        self.info.name, self.info.source = topic_name(sensor.name), "recording"
        self.info.range_m = min(declared.range_m, sensor.range_max)
        beams = beams_from_info(declared)
        self._rows = beams.table.image_rows
        self.age_ns = int(-pose_offsets(beams.table, round(1e9 / beams.rate)).min())

    def write(
        self, sweep: RecordedSweep, mount: Transform, time_ns: int, sequence: int
    ) -> pb.Sweep:
        """Write one sweep; arguments as of `SweepWriter.write`, the mount is the declared one."""
        assert sweep.measured is not None
        ranges_mm = sweep.measured
        if not self._sensor.missing_returns_known:
            ranges_mm = np.where(ranges_mm == NO_RETURN, DROPPED, ranges_mm)
        message = pb.Sweep(
            sequence=sequence,
            sensor=self.info.name,
            rows=self._rows,
            columns=len(ranges_mm) // self._rows,
            codec=CODEC,
            ranges=codecs.encode_image(ranges_mm, self._rows),
        )
        message.timestamp.FromNanoseconds(time_ns)
        return message


class SweepWriter:
    """Writes the sweeps of one sensor, each with the list of its beams.

    Attributes:
        info: Its declaration in the log.
        age_ns: 0: its sweeps list the ages of their beams.
    """

    age_ns = 0

    def __init__(self, sensor: RecordedSensor, info: pb.SensorInfo, mount: Transform) -> None:
        """Write as declared.

        Args:
            sensor: Sensor of the recording.
            info: Its declaration in the log.
            mount: T_base_sensor in the declaration.
        """
        self._sensor, self.info, self._mount = sensor, info, mount

    @property
    def silence(self) -> int:
        """Report of a beam without return: evidence of free space only if the sensor states so."""
        return int(NO_RETURN if self._sensor.missing_returns_known else DROPPED)

    def write(
        self, sweep: RecordedSweep, mount: Transform, time_ns: int, sequence: int
    ) -> pb.Sweep:
        """Write one sweep.

        Args:
            sweep: As recorded.
            mount: T_base_sensor at its time, in the log's frame of the body.
            time_ns: Time of the decision.
            sequence: Number of the decision.
        """
        message = pb.Sweep(sequence=sequence, sensor=self.info.name)
        message.timestamp.FromNanoseconds(time_ns)
        poses, ages = _ages(sweep, time_ns)
        write_list(
            message, sweep.directions, ranges_mm=self._millimetres(sweep), poses=poses, ages_ns=ages
        )
        numbers = [*mount.position.tolist(), *mount.quaternion.tolist()]
        known = [*self._mount.position.tolist(), *self._mount.quaternion.tolist()]
        if max(abs(a - b) for a, b in zip(numbers, known, strict=True)) > SAME_MOUNT:
            message.mount.extend(numbers)
        return message

    def _millimetres(self, sweep: RecordedSweep) -> NDArray[np.uint32]:
        """Return ranges in whole mm; dropped below the sensor's least and beyond its greatest."""
        ranges = sweep.ranges.astype(np.float64)
        silent = np.isinf(ranges)
        counted = np.rint(np.where(silent, 0.0, ranges) * MILLIMETRES)
        counted[counted == NO_RETURN] = NO_RETURN - 1  # 65.535 m has another meaning
        lost = (ranges < self._sensor.range_min) | (ranges > self.info.range_m) | (counted < 1.0)
        counted[lost] = DROPPED
        counted[silent] = self.silence
        return counted.astype(np.uint32)


def _ages(sweep: RecordedSweep, time_ns: int) -> tuple[NDArray[np.int64] | None, tuple[int, ...]]:
    """Return the index of the pose that each beam leaves from, and the age of each pose, ns."""
    if sweep.beam_times_ns is None or len(sweep.beam_times_ns) == 0:
        return None, (min(max(time_ns - sweep.time_ns, 0), round(OLDEST_S * 1e9)),)
    ages = np.clip(time_ns - sweep.time_ns - sweep.beam_times_ns, 0, round(OLDEST_S * 1e9))
    least = int(ages.min())
    step = max(POSE_STEP_NS, -(-(int(ages.max()) - least + 1) // MOST_POSES))
    bins = (ages - least) // step
    used, poses = np.unique(bins, return_inverse=True)
    return poses.ravel(), tuple(int(least + step * (2 * k + 1) // 2) for k in used.tolist())


def greatest_age(sweeps: Sequence[pb.Sweep]) -> int:
    """Return the age of the oldest pose of sweeps, ns."""
    return max((max(sweep.ages_ns, default=0) for sweep in sweeps), default=0)
