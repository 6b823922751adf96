import bz2
import gzip
import hashlib

import numpy as np
import pytest

from wayproof.harness.errors import InputError
from wayproof.harness.recordings.formats import open_recording
from wayproof.harness.recordings.options import RecordingOptions

HEAD = (
    "# CARMEN Logfile\nPARAM robot_front_laser_max 50 a 0\nPARAM robot_frontlaser_offset 0.2 a 0\n"
)


def old_scan(stamp, ranges, robot=(0.0, 0.0, 0.0), laser=None, kind="FLASER"):
    x, y, yaw = robot
    laser = laser or (x + 0.2 * np.cos(yaw), y + 0.2 * np.sin(yaw), yaw)
    words = [kind, len(ranges), *ranges, *laser, *robot, stamp, "host", stamp]
    return " ".join(str(word) for word in words) + "\n"


def written(tmp_path, *lines):
    path = tmp_path / "log.clf"
    path.write_text(HEAD + "".join(lines))
    return path


def test_the_real_log_has_its_scans_mount_and_way(fr079):
    recording = open_recording(fr079)
    sweeps = list(recording.sweeps())
    assert len(sweeps) == len(recording.track.times_ns) == 200
    assert recording.format == "carmen"
    assert recording.start_ns == 1211_520_329_000  # the seventh number behind the first scan
    assert [sweep.time_ns for sweep in sweeps] == recording.track.times_ns.tolist()
    assert sweeps[0].T_body_sensor.position.tolist() == [-0.04, 0.0, 0.0]
    assert recording.track.positions[0].tolist() == [-3.034287, 8.291214, 0.0]
    steps = np.diff(recording.track.positions, axis=0)
    assert np.sqrt(np.square(steps).sum(axis=1)).sum() == pytest.approx(16.69, abs=0.01)
    assert recording.sensors[0].range_max == np.float32(80.99)
    assert sum(np.isinf(sweep.ranges).sum() for sweep in sweeps) == 68  # counted by awk
    assert not recording.sensors[0].missing_returns_known
    assert recording.faults == {}
    assert recording.sha256 == hashlib.sha256(fr079.read_bytes()).hexdigest()


def test_the_first_ranges_are_the_numbers_of_the_line(fr079):
    sweep = next(open_recording(fr079).sweeps())
    line = next(one for one in bz2.open(fr079, "rt") if one.startswith("FLASER"))
    numbers = np.array([float(word) for word in line.split()[2:362]], np.float32)
    assert np.array_equal(np.where(numbers >= 80.99, np.inf, numbers), sweep.ranges)
    assert sweep.directions.shape == (360, 3)
    np.testing.assert_allclose(sweep.directions[[0, 180]], [[0, -1, 0], [1, 0, 0]], atol=1e-6)


@pytest.mark.parametrize("pack", [bytes, bz2.compress, gzip.compress])
def test_compression_is_found_by_the_first_bytes(tmp_path, pack):
    path = written(tmp_path, old_scan(1, [1.0] * 181), old_scan(2, [1.0] * 181))
    path.write_bytes(pack(path.read_bytes()))
    assert len(list(open_recording(path).sweeps())) == 2


def test_a_new_message_states_its_angles_and_limit(tmp_path):
    line = "ROBOTLASER1 0 -1.0 2.0 1.0 9.0 0.01 0 3 1.0 9.5 2.0 0 0.1 0 0 0 0 0 0 0 0.5 0.5 0.5 "
    path = written(tmp_path, line + "1.0 host 1.0\n", line + "2.0 host 2.0\n")
    recording = open_recording(path)
    sweep = next(recording.sweeps())
    assert recording.sensors[0].range_max == 9.0
    assert sweep.ranges.tolist() == [1.0, np.inf, 2.0]
    assert (sweep.grid.angle_min, sweep.grid.angle_increment, sweep.grid.beams) == (-1.0, 1.0, 3)
    assert sweep.T_body_sensor.position.tolist() == [0.1, 0.0, 0.0]


def test_poses_that_a_slam_wrote_are_found_and_can_be_declined(tmp_path):
    lines = [
        old_scan(k, [1.0], robot=(k, 0.0, 0.0), laser=(k + 0.2, 0.3 * k * k, 0.1 * k))
        for k in range(5)
    ]
    path = written(tmp_path, *lines)
    corrected = open_recording(path)
    assert "poses: corrected" in corrected.chosen
    yaw = 0.4
    expected = [4.2 - 0.2 * np.cos(yaw), 4.8 - 0.2 * np.sin(yaw), 0.0]
    np.testing.assert_allclose(corrected.track.positions[-1], expected, atol=1e-12)
    odometry = open_recording(path, options=RecordingOptions(pose="odometry"))
    assert odometry.track.positions[-1].tolist() == [4.0, 0.0, 0.0]
    with pytest.raises(InputError, match="unknown poses of the recording 'x'"):
        open_recording(path, options=RecordingOptions(pose="x"))


def test_faults_are_counted_by_kind(tmp_path):
    path = written(
        tmp_path,
        old_scan(1, [1.0, "nan", 0.0, -1.0, "1e39"]),
        old_scan(2, ["nan", 0.0]),
        "FLASER 3 1.0\n",
        "FLASER many\n",
        old_scan(3, [1.0], robot=("nan", 0.0, 0.0), laser=(0, 0, 0)),
        old_scan(2.5, [1.0]),
        old_scan(9, [1.0]),
        old_scan(10, [1.0], robot=("nan", 0.0, 0.0), laser=(0, 0, 0)),  # behind the last pose
    )
    recording = open_recording(path)
    sweeps = list(recording.sweeps())
    assert [sweep.ranges.tolist() for sweep in sweeps] == [[1.0, np.inf], [1.0], [1.0]]
    assert recording.faults == {
        "line: not a scan": 2,
        "pose: gap of more than 1 s": 1,
        "pose: not finite": 2,
        "range: below the minimum": 3,
        "range: not a number": 2,
        "sweep: no pose at its time": 2,
        "sweep: nothing measured": 1,
    }


@pytest.mark.parametrize(
    ("readings", "limit", "without"),
    [
        ([3.0, 5.0], 5.0, 0),
        ([3.0] + [5.0] * 10, 5.0, 10),
        ([3.0, 81.83, 81.91], 80.0, 2),
        ([1.0, 4.0], 3.0, 1),  # as it is asked for
    ],
)
def test_a_limit_that_is_not_stated_follows_from_the_readings(tmp_path, readings, limit, without):
    path = tmp_path / "log.clf"
    path.write_text(old_scan(1, readings))
    asked = 3.0 if limit == 3.0 else None
    recording = open_recording(path, options=RecordingOptions(range_max=asked))
    assert recording.sensors[0].range_max == limit
    assert np.isinf(next(recording.sweeps()).ranges).sum() == without


def cut_in_two(fr079):
    return fr079.read_bytes()[:20000]


def bomb(fr079):
    del fr079
    return gzip.compress((HEAD + ("#" * 999 + "\n") * 20_000).encode())


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (None, "no such file"),
        ("", "empty file"),
        ("\0\1", "no known format"),
        (HEAD + "ODOM 0 0 0 0 0 0 1 a 1\n", "no scan in it"),
        (
            HEAD + old_scan(1, [1.0]) + old_scan(1, [1.0], kind="RLASER"),
            r"FLASER \(1\), RLASER \(1\)",
        ),
        (HEAD + "FLASER " + "1 " * 2**20, "a line of over 1048576 bytes"),
        (cut_in_two, "cannot be read"),
        (bomb, "unpacks to over"),
    ],
)
def test_what_cannot_be_read_is_refused_in_a_line(tmp_path, fr079, content, said):
    path = tmp_path / ("some.clf.bz2" if content is cut_in_two else "some")
    if content is not None:
        path.write_bytes(content.encode() if isinstance(content, str) else content(fr079))
    with pytest.raises(InputError, match=said):
        open_recording(path)


def test_a_laser_is_chosen_by_name(tmp_path):
    path = written(tmp_path, old_scan(1, [1.0]), old_scan(1, [2.0], kind="RLASER"))
    rear = open_recording(path, options=RecordingOptions(sensors=("RLASER",)))
    assert next(rear.sweeps()).ranges.tolist() == [2.0]
    with pytest.raises(InputError, match="unknown laser of the recording 'x'"):
        open_recording(path, options=RecordingOptions(sensors=("x",)))


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"format": "x"}, "unknown format of recordings 'x'"),
        ({"range_max": 0.0}, "range_max 0: expected 0.001"),
        ({"range_max": float("nan")}, "range_max nan"),
        ({"pixel_stride": 0}, "pixel_stride 0"),
        ({"intrinsics": (0.0, 1.0, 1.0, 1.0)}, "intrinsics 0,1,1,1"),
        ({"end": float("inf")}, "end inf"),
    ],
)
def test_options_that_make_no_sense_are_refused(fr079, options, said):
    with pytest.raises(InputError, match=said):
        open_recording(fr079, options=RecordingOptions(**options))
