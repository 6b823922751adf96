import numpy as np
import pytest
from rosbags.highlevel import AnyReader

from tests.harness.recordings.bags.making import Bag, at
from wayproof.harness.errors import InputError
from wayproof.harness.recordings.bags.writing import recording_messages, write_bag
from wayproof.harness.recordings.formats import open_recording
from wayproof.harness.recordings.options import RecordingOptions

KINDS = {"ros1": "out.bag", "mcap": "out", "sqlite": "out"}


def same(first, second):
    if first is None or second is None:
        return first is second
    return first.dtype == second.dtype and np.array_equal(first, second)


def check_same(one, other):
    """Two recordings are the same, bit by bit."""
    assert one.sensors == other.sensors
    assert (one.start_ns, one.body_height) == (other.start_ns, other.body_height)
    for name in ("times_ns", "positions", "quaternions"):
        assert same(getattr(one.track, name), getattr(other.track, name)), name
    count = 0
    for first, second in zip(one.sweeps(), other.sweeps(), strict=True):
        assert (first.time_ns, first.sensor) == (second.time_ns, second.sensor)
        for name in ("directions", "ranges", "beam_times_ns", "points"):
            assert same(getattr(first, name), getattr(second, name)), name
        for part in range(2):
            assert same(first.T_body_sensor[part], second.T_body_sensor[part])
        count += 1
    assert count


def test_a_real_recording_is_the_same_from_a_bag(tmp_path, fr079):
    kind = "ros1"
    recording = open_recording(fr079)
    count = write_bag(recording_messages(recording, kind), tmp_path / KINDS[kind], kind)
    assert count == 200 + 2 * 200 + 1
    again = open_recording(tmp_path / KINDS[kind])
    check_same(recording, again)
    assert again.faults == {}


def test_rosbags_reads_what_was_written(tmp_path, fr079):
    recording = open_recording(fr079)
    write_bag(recording_messages(recording, "mcap"), tmp_path / "out", "mcap")
    with AnyReader([tmp_path / "out"]) as reader:
        assert sorted(reader.topics) == ["/FLASER", "/odom", "/tf", "/tf_static"]
        scans = [
            reader.deserialize(data, connection.msgtype)
            for connection, _, data in reader.messages()
            if connection.topic == "/FLASER"
        ]
    for message, sweep in zip(scans, recording.sweeps(), strict=True):
        stamp = message.header.stamp.sec * 10**9 + message.header.stamp.nanosec
        assert stamp == recording.start_ns + sweep.time_ns
        assert np.array_equal(message.ranges[sweep.grid.places], sweep.ranges)
        assert np.isnan(message.ranges).sum() == 360 - len(sweep.ranges)


@pytest.mark.parametrize("kind", KINDS)
def test_points_times_and_beams_without_return_are_the_same(tmp_path, kind):
    bag = Bag("mcap")
    bag.tf("base_link", "lidar", 0.0, at(0.0, 0.1, 0.5, (0.8, 0.0, 0.6, 0.0)), "/tf_static")
    bag.drive([10.0, 11.0, 12.0])
    rng = np.random.default_rng(0)
    for stamp in (10.5, 10.6):
        x, y, z = rng.normal(scale=10.0, size=(3, 50)).astype(np.float32)
        times = rng.integers(0, 10**8, 50).astype(np.uint32)
        bag.cloud(stamp, {"x": x, "y": y, "z": z, "t": times})
    bag.write(tmp_path / "given")
    for free in (None, True):
        options = RecordingOptions(range_max=12.0, no_return_is_free=free)
        recording = open_recording(tmp_path / "given", options=options)
        assert any(np.isinf(sweep.ranges).any() for sweep in recording.sweeps())
        out = tmp_path / f"{free}-{KINDS[kind]}"
        write_bag(recording_messages(recording, kind), out, kind)
        again = open_recording(out)
        check_same(recording, again)
        assert again.sensors[0].missing_returns_known == bool(free)


def test_nothing_is_left_of_a_bag_that_cannot_be_written(tmp_path, fr079):
    recording = open_recording(fr079)
    (tmp_path / "there").mkdir()
    for name, said in (("there", "exists already"), ("no/out", "No such file or directory")):
        with pytest.raises(InputError, match=said):
            write_bag(recording_messages(recording, "mcap"), tmp_path / name, "mcap")
    bag = Bag()
    bag.drive([10.0, 11.0])
    for stamp in (10.0, 11.0):
        bag.tf("base_link", "laser", stamp, at(stamp))
    bag.scan(10.5, [1.0])
    bag.scan(10.6, [1.0])
    bag.write(tmp_path / "given")
    moving = open_recording(tmp_path / "given", options=RecordingOptions(body="base_link"))
    with pytest.raises(InputError, match="moves on the body"):
        write_bag(recording_messages(moving, "ros1"), tmp_path / "out.bag", "ros1")
    assert sorted(one.name for one in tmp_path.iterdir()) == ["given", "there"]
