"""What public recordings do to a reader: each is read right, counted or refused."""

import numpy as np
import pytest

from tests.harness.recordings.bags.making import Bag, at
from wayproof.harness.errors import InputError
from wayproof.harness.recordings.formats import open_recording
from wayproof.harness.recordings.options import RecordingOptions

STAMPS = 1000.0 + 0.1 * np.arange(10)
SHARES = np.linspace(0.0, 1.0, 200)


def opened(path, **options):
    return open_recording(path, options=RecordingOptions(**options))


def with_body(frame="laser"):
    bag = Bag()
    bag.tf("base_link", frame, 0.0, at(0.2), "/tf_static")
    bag.drive(np.arange(999.0, 1003.0, 0.05))
    return bag


@pytest.mark.parametrize(
    ("times", "counted"),
    [
        (lambda stamp: (SHARES * 1e5).astype(np.float32), None),
        (lambda stamp: (SHARES * 1e2).astype(np.float32), None),
        (lambda stamp: SHARES.astype(np.float32), None),
        (lambda stamp: (SHARES * 1e8).astype(np.uint32), None),
        (lambda stamp: stamp + 37.0 + 0.1 * SHARES, "sweep: times of another clock"),
    ],
    ids=["us", "ms", "share", "ns", "other clock"],
)
def test_a_sweep_takes_the_time_between_stamps(tmp_path, times, counted):
    bag = with_body("lidar")
    for stamp in STAMPS:
        x = np.full(200, 3.0, np.float32)
        bag.cloud(stamp, {"x": x, "y": x, "z": x, "time": times(stamp)})
    recording = opened(bag.write(tmp_path / "bag"))
    found = list(recording.sweeps())
    assert len(found) == len(STAMPS)
    for sweep in found:
        np.testing.assert_allclose(sweep.beam_times_ns, SHARES * 1e8, atol=1e3)
    assert [kind.startswith(counted or "-") for kind in recording.faults] == [True] * bool(counted)


def test_a_point_many_periods_off_is_no_point(tmp_path):
    bag = with_body("lidar")
    for stamp in STAMPS:
        x, times = np.full(200, 3.0, np.float32), (SHARES * 1e8).astype(np.uint32)
        times[7] = 3_600_000_000
        bag.cloud(stamp, {"x": x, "y": x, "z": x, "t": times})
    recording = opened(bag.write(tmp_path / "bag"))
    assert {len(sweep.ranges) for sweep in recording.sweeps()} == {199}
    assert recording.faults == {"point: time far from the others": 10}


def test_a_maximum_that_varies_is_a_return(tmp_path):
    bag = with_body()
    for k, stamp in enumerate(STAMPS):
        bag.scan(stamp, [1.0, 4.0 + 0.1 * k], range_max=4.0 + 0.1 * k, time_increment=-0.01)
    for k, sweep in enumerate(opened(bag.write(tmp_path / "bag")).sweeps()):
        np.testing.assert_allclose(sweep.ranges, [1.0, 4.0 + 0.1 * k], rtol=1e-6)
        assert sweep.beam_times_ns.tolist() == [10_000_000, 0]


def two_frames(bag):
    bag.tf("base_link", "rear", 0.0, at(-0.2), "/tf_static")
    bag.scan(1000.05, [1.0], frame="rear")


def another_parent(bag):
    for stamp in (999.0, 1000.0, 1001.0):
        bag.tf("wheels", "base_link", stamp, at(2 * stamp))


def reset(bag):
    bag.drive(np.arange(999.0, 1003.0, 0.05))


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (two_frames, r"several sensors, choose: /scan@laser \(LaserScan, \d+\), /scan@rear"),
        (another_parent, "choose: frame odom, frame wheels"),
        (reset, "cannot be told which run they are of"),
    ],
)
def test_what_has_two_meanings_is_refused(tmp_path, change, said):
    bag = with_body()
    for stamp in STAMPS:
        bag.scan(stamp, [1.0])
    change(bag)
    with pytest.raises(InputError, match=said):
        opened(bag.write(tmp_path / "bag"))


def test_a_topic_of_several_frames_is_a_sensor_for_each(tmp_path):
    bag = with_body()
    for stamp in STAMPS:
        bag.scan(stamp, [1.0])
    two_frames(bag)
    path = bag.write(tmp_path / "bag")
    (rear,) = opened(path, sensors=("/scan@rear",)).sweeps()
    assert rear.T_body_sensor.position[0] == pytest.approx(-0.2)
    both = opened(path, sensors=("/scan@rear", "/scan@laser"))
    assert sorted({sweep.sensor for sweep in both.sweeps()}) == ["scan@laser", "scan@rear"]


@pytest.mark.parametrize("back", [0.3, 5.0])
def test_the_longer_run_is_judged_and_the_other_is_named(tmp_path, back):
    bag = with_body()
    bag.messages = bag.messages[:1]  # the mount
    clock = [*np.arange(1000.0, 1002.0, 0.1), *np.arange(1002.0 - back, 1005.0 - back, 0.1)]
    for k, stamp in enumerate(clock):
        bag.tf("odom", "base_link", stamp - 0.01, at(0.1 * k))
        bag.tf("odom", "base_link", stamp + 0.04, at(0.1 * k + 0.05))
        bag.scan(stamp, [1.0])
    recording = opened(bag.write(tmp_path / "bag"))
    found = list(recording.sweeps())
    assert [len(found), recording.faults] == [
        30,
        {"sweep: of another run, as the clock was set back": 20},
    ]
    assert "; run 2 of 2, as the clock was set back; not judged: run 1 (20 sweeps, 1000.0" in (
        recording.chosen
    )
    x = recording.track.at(np.array([sweep.time_ns for sweep in found]))[0][:, 0]
    assert x == pytest.approx(0.1 * np.arange(20, 50) + 0.01, abs=1e-6)


def test_a_parent_can_be_chosen_and_the_last_static_transform_counts(tmp_path):
    bag = with_body()
    another_parent(bag)
    bag.tf("base_link", "laser", 1.0, at(0.5), "/tf_static")
    bag.scan(1000.0, [1.0])
    path = bag.write(tmp_path / "bag")
    for pose, place in (("odom", 1000.0), ("wheels", 2000.0)):
        recording = opened(path, pose=pose)
        (sweep,) = recording.sweeps()
        assert recording.track.at(np.array([sweep.time_ns]))[0][0, 0] == pytest.approx(place)
        assert sweep.T_body_sensor.position[0] == 0.5


def test_the_code_for_no_depth_says_nothing(tmp_path):
    bag = with_body("camera")
    bag.camera(1000.0, (4, 6), 2.0)
    pixels = np.full((4, 6), 2000, np.uint16)
    pixels[0, :2] = 0, 65535
    bag.image(1000.0, pixels, "16UC1")
    (sweep,) = opened(bag.write(tmp_path / "bag"), pixel_stride=1).sweeps()
    assert len(sweep.ranges) == 22
