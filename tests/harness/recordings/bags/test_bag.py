"""Bags: each message is read right, counted or refused, as public recordings have them."""

import numpy as np
import pytest

from tests.harness.recordings.bags.making import Bag, at
from wayproof.harness.errors import InputError
from wayproof.harness.recordings.bags.choose import FOOTPRINT
from wayproof.harness.recordings.formats import open_recording
from wayproof.harness.recordings.options import RecordingOptions
from wayproof.harness.recordings.transform import rotate

KINDS = {"ros1": "bag.bag", "mcap": "bag", "sqlite": "bag"}
HALF = np.sqrt(0.5)


def opened(path, **options):
    return open_recording(path, options=RecordingOptions(**options))


def simple(kind="mcap"):
    """A body that moves along x at 1 m/s for 2 s, with a laser 0.2 m ahead of its middle."""
    bag = Bag(kind)
    bag.tf("base_link", "laser", 0.0, at(0.2), "/tf_static")
    bag.drive([10.0, 10.5, 11.0, 11.5, 12.0])
    return bag


@pytest.mark.parametrize("kind", KINDS)
def test_a_scan_of_every_kind_of_bag(tmp_path, kind):
    bag = simple(kind)
    bag.scan(10.25, [1.0, np.inf, np.nan, 0.0, 99.0])
    recording = opened(bag.write(tmp_path / KINDS[kind]))
    (sweep,) = recording.sweeps()
    assert (recording.format, recording.start_ns) == ("bag", 10_000_000_000)
    assert (sweep.sensor, sweep.time_ns) == ("scan", 250_000_000)
    assert sweep.ranges.tolist() == [1.0, np.inf]
    np.testing.assert_allclose(sweep.directions[:, 1], np.sin([-1.0, -0.5]), atol=1e-7)
    assert sweep.T_body_sensor.position.tolist() == [0.2, 0.0, 0.0]
    assert recording.track.at(np.array([sweep.time_ns]))[0].tolist() == [[10.25, 0.0, 0.0]]
    (sensor,) = recording.sensors
    assert (sensor.kind, sensor.frame) == ("laser", "laser")
    assert (sensor.range_min, sensor.range_max) == (np.float32(0.1), 10.0)
    assert recording.faults == {
        "range: below the minimum": 1,
        "range: beyond the maximum": 1,
        "range: not a number": 1,
    }
    assert recording.chosen == "/scan (laser); poses: frames odom -> base_link"


def test_a_laser_upside_down_has_its_left_to_the_right_and_its_maximum_is_no_return(tmp_path):
    bag = Bag("ros1")
    bag.drive([10.0, 11.0])
    mount = at(0.0, 0.0, 0.5, (0.0, 1.0, 0.0, 0.0))
    bag.tf("/base_link", "/laser", 10.4, mount)  # published again and again, on /tf
    ranges = [2.0, np.nan, 10.0, 9.99]
    bag.scan(10.1, ranges, frame="/laser", angle_min=np.pi / 2, time_increment=0.25)
    recording = opened(bag.write(tmp_path / "bag.bag"))
    (sweep,) = recording.sweeps()
    assert sweep.ranges.tolist() == [2.0, np.inf, np.float32(9.99)]
    assert sweep.beam_times_ns.tolist() == [0, 500_000_000, 750_000_000]
    assert not recording.sensors[0].missing_returns_known
    first = rotate(sweep.T_body_sensor.quaternion, sweep.directions[0] * 2.0)
    np.testing.assert_allclose(first, [0.0, -2.0, 0.0], atol=1e-6)


def unstamped(bag):
    return {"header": bag.build.header(0, "laser")}


@pytest.mark.parametrize(
    ("stamps", "more", "options", "times", "faults"),
    [
        ([9.9, 10.0, 12.0, 12.1], {}, {}, [0.0, 2.0], {"sweep: no pose at its time": 2}),
        # Its last beam is after the last pose.
        (
            [11.9], {"time_increment": 0.1, "scan_time": 0.3}, {}, [],
            {"sweep: no pose at its time": 1},
        ),
        ([9.9, 10.1, 11.0, 11.9, 12.1], {}, {"begin": 0.5, "end": 1.5}, [1.0], {}),
        (
            [12.0, 13.0, 14.0], {}, {}, [2.0, 4.0],
            {"pose: gap of more than 1 s": 1, "sweep: no pose at its time": 1},
        ),
        ([12.0, 13.0, 14.0], {}, {"max_gap": 2.0}, [2.0, 3.0, 4.0], {}),
        # Exchanged ones are put right, the last one is a clock set back.
        (
            [10.1, 10.3, 10.2, 10.4, 10.4], {}, {}, [0.1, 0.2, 0.3, 0.4],
            {"sweep: stamp out of order": 1},
        ),
        (
            [10.1, 10.2], unstamped, {}, [0.1, 0.2],
            {"sweep: without a stamp, taken as recorded": 2},
        ),
    ],
)  # fmt: skip
def test_a_sweep_is_taken_at_its_time_or_left_out_and_counted(
    tmp_path, stamps, more, options, times, faults
):
    bag = simple()
    if stamps[-1] == 14.0:
        bag.drive([14.0])
    for stamp in stamps:
        bag.scan(stamp, [1.0] * 3, **(more(bag) if callable(more) else more))
    recording = opened(bag.write(tmp_path / "bag"), **options)
    assert [sweep.time_ns for sweep in recording.sweeps()] == [round(1e9 * t) for t in times]
    assert recording.faults == faults


def test_a_folder_of_the_parts_of_a_bag_of_ros_1_is_one_bag(tmp_path):
    whole = Bag("ros1")
    whole.drive([10.0, 11.0])
    whole.tf("base_link", "laser", 10.0, at(), "/tf_static")
    parts = Bag("ros1"), Bag("ros1")
    for number in range(4):
        for bag in (whole, parts[number // 2]):
            bag.scan(10.2 + 0.2 * number, [1.0 + number])
    parts[0].messages[:0] = whole.messages[:3]
    folder = tmp_path / "parts"
    folder.mkdir()
    for number, part in enumerate(parts):
        part.write(folder / f"run_{number}.bag")
    one = [(sweep.time_ns, sweep.ranges.tolist()) for sweep in opened(folder).sweeps()]
    other = opened(whole.write(tmp_path / "whole.bag")).sweeps()
    assert one == [(sweep.time_ns, sweep.ranges.tolist()) for sweep in other]
    assert len(one) == 4


def test_a_bag_whose_files_are_packed_is_one_line(tmp_path):
    (tmp_path / "bag").mkdir()
    (tmp_path / "bag/bag_0.db3.zstd").write_bytes(b"\x28\xb5\x2f\xfd")
    with pytest.raises(InputError, match=r"'bag_0\.db3\.zstd' is packed, unpack it first"):
        opened(tmp_path / "bag")


def test_the_tree_of_frames_is_interpolated_in_time(tmp_path):
    bag = Bag()
    bag.tf("map", "odom", 10.0, at(100.0))
    bag.tf("map", "odom", 12.0, at(102.0))
    bag.drive([10.0, 11.0, 12.0])
    bag.tf("base_link", "mast", 0.0, at(0.0, 0.0, 1.0, (HALF, 0.0, 0.0, HALF)), "/tf_static")
    bag.tf("mast", "laser", 0.0, at(0.5), "/tf_static")
    bag.scan(11.0, [1.0])
    recording = opened(bag.write(tmp_path / "bag"))
    assert recording.chosen.endswith("frames map -> base_link")
    assert recording.track.positions[:, 0].tolist() == [110.0, 112.0, 114.0]
    (sweep,) = recording.sweeps()
    np.testing.assert_allclose(sweep.T_body_sensor.position, [0.0, 0.5, 1.0], atol=1e-15)
    lower = opened(tmp_path / "bag", pose="odom")
    assert lower.track.positions[:, 0].tolist() == [10.0, 11.0, 12.0]


def test_a_sensor_that_moves_on_the_body_is_placed_at_each_sweep(tmp_path):
    bag = Bag()
    bag.drive([10.0, 11.0, 12.0])
    for stamp in (10.2, 11.2):
        bag.tf("base_link", "laser", stamp, at(0.0, stamp))
    for stamp in (10.0, 10.7, 11.2):
        bag.scan(stamp, [1.0])
    recording = opened(bag.write(tmp_path / "bag"), body="base_link")
    placed = [sweep.T_body_sensor.position[1] for sweep in recording.sweeps()]
    assert placed == pytest.approx([10.7, 11.2])
    assert recording.faults == {"sweep: no transform at its time": 1}


@pytest.mark.parametrize("transforms", [True, False])
def test_clouds_registered_in_the_world_are_no_sweeps(tmp_path, transforms):
    bag = Bag()
    for stamp in (10.0, 10.5, 11.0):
        if transforms:
            bag.tf("camera_init", "body", stamp, at(stamp))
        bag.odometry(stamp, at(stamp), parent="camera_init", child="body")
    for frame in ("camera_init", "body"):
        bag.cloud(10.5, {axis: np.ones(2, np.float32) for axis in "xyz"}, f"/in_{frame}", frame)
    path = bag.write(tmp_path / "bag")
    said = "got sweeps in frame 'camera_init', in which 'body' moves, expected a frame on the body"
    with pytest.raises(InputError, match=said):
        opened(path, sensors=("/in_camera_init",))
    (sweep,) = opened(path, sensors=("/in_body",)).sweeps()
    assert sweep.T_body_sensor.position.tolist() == [0.0, 0.0, 0.0]


def robots(*namespaces):
    """Robots of the same frames, the k-th of which drives at y = k from x = 10 k m on."""
    bag = Bag()
    for number, name in enumerate(namespaces, 1):
        bag.tf("base_link", "laser", 0.0, at(0.1 * number), f"{name}/tf_static")
        for stamp in (10.0, 10.5, 11.0):
            moved = at(10.0 * number + stamp, number)
            bag.tf("odom", "base_link", stamp + 0.01 * number, moved, f"{name}/tf")
    return bag


@pytest.mark.parametrize(
    ("namespaces", "sensor", "own"),
    [
        (("/r1", "/r2"), "/r1/scan", 1),
        (("/r1", "/r2"), "/r2/front/scan", 2),
        (("", "/r2"), "/r2/scan", 2),
        (("", "/r2"), "/scan", 1),
        (("/r1",), "/scan", 1),
    ],
)
def test_of_several_robots_the_transforms_beside_the_sensor_count(
    tmp_path, namespaces, sensor, own
):
    bag = robots(*namespaces)
    bag.scan(10.6, [1.0], sensor)
    recording = opened(bag.write(tmp_path / "bag"))
    assert set(recording.track.positions[:, 1]) == {float(own)}
    (sweep,) = recording.sweeps()
    assert sweep.T_body_sensor.position.tolist() == [0.1 * own, 0.0, 0.0]


def test_of_several_robots_none_of_which_is_the_sensors_all_topics_are_listed(tmp_path):
    bag = robots("/r1", "/r2")
    bag.scan(10.6, [1.0])
    said = "several transforms from 'base_link' to 'laser'.*of /scan: /r1/tf, .*/r2/tf_static$"
    with pytest.raises(InputError, match=said):
        opened(bag.write(tmp_path / "bag"))


def test_a_tree_around_a_namespace_is_that_of_its_robot_too(tmp_path):
    bag = robots("/r1")
    for stamp in (10.0, 11.0):
        bag.tf("odom", "base_link", stamp, at(99.0))
        bag.tf("map", "odom", stamp, at(z=3.0))
    bag.scan(10.6, [1.0], "/r1/scan")
    recording = opened(bag.write(tmp_path / "bag"))
    assert recording.chosen.endswith("frames map -> base_link")
    assert recording.track.positions[0].tolist() == [20.0, 1.0, 3.0]


def test_odometry_alone_has_its_body_from_the_message(tmp_path):
    bag = Bag()
    for stamp in (10.0, 11.0):
        bag.odometry(stamp, at(stamp))
    bag.scan(10.5, [1.0])
    path = bag.write(tmp_path / "bag")
    with pytest.raises(InputError, match=r"no transform from 'base_link' to 'laser' \(frames: no"):
        opened(path)
    recording = opened(path, mount=(0.0, 0.0, 0.4))
    assert recording.chosen.endswith("topic /odom, body 'base_link'")
    (sweep,) = recording.sweeps()
    assert sweep.T_body_sensor.position.tolist() == [0.0, 0.0, 0.4]


def test_an_odometry_of_the_same_frames_is_no_other_choice_but_one_of_others_is(tmp_path):
    bag = simple()
    bag.scan(10.5, [1.0])
    bag.odometry(10.0, at(1.0))
    opened(bag.write(tmp_path / "one"))
    bag.odometry(10.0, at(1.0), "/lio", "lio", "imu")
    path = bag.write(tmp_path / "two")
    with pytest.raises(InputError, match="several sources, choose: frame odom, topic /lio"):
        opened(path)
    assert opened(path, pose="odom").track.positions[0, 0] == 1.0  # the topic, as it has the name
    with pytest.raises(InputError, match="unknown poses of the recording 'nothing'"):
        opened(path, pose="nothing")


@pytest.mark.parametrize(
    ("add", "said"),
    [
        (lambda bag: bag.drive([13.0]), "no LaserScan, PointCloud2, depth Image, CustomMsg"),
        (
            lambda bag: [bag.scan(10.5, [1.0], name) for name in ("/a", "/b")],
            r"several sensors, choose: /a \(LaserScan, 1\), /b \(LaserScan, 1\)",
        ),
        (lambda bag: bag.image(10.5, np.zeros((2, 2, 3), np.uint8), "rgb8"), "no LaserScan"),
        (
            lambda bag: bag.image(10.5, np.ones((2, 2), np.uint16), "16UC1"),
            r"no '/depth/camera_info' for '/depth/image_raw' \(CameraInfo: none\)",
        ),
        (
            lambda bag: bag.scan(10.5, [1.0], frame="nowhere"),
            "no transform from 'base_link' to 'nowhere'",
        ),
    ],
)
def test_what_there_is_no_one_choice_for_is_listed(tmp_path, add, said):
    bag = simple()
    add(bag)
    with pytest.raises(InputError, match=said):
        opened(bag.write(tmp_path / "bag"))


def test_chosen_sensors_come_in_order_of_time(tmp_path):
    bag = simple()
    for stamp in (10.3, 10.5):
        bag.scan(stamp, [1.0], "/a")
    for stamp in (10.2, 10.4):
        bag.scan(stamp, [1.0], "/b")
    recording = opened(bag.write(tmp_path / "bag"), sensors=("b", "/a"))
    assert [sweep.sensor for sweep in recording.sweeps()] == ["b", "a", "b", "a"]
    with pytest.raises(InputError, match="unknown sensor of the recording 'c'"):
        opened(tmp_path / "bag", sensors=("c",))


def test_a_depth_image_has_a_beam_for_every_so_many_pixels(tmp_path):
    bag = Bag("ros1")
    bag.drive([10.0, 11.0])
    bag.tf("base_link", "camera", 0.0, at(0.1), "/tf_static")
    bag.camera(10.0, (4, 6), 2.0)
    millimetres = np.full((4, 6), 2000, np.uint16)
    millimetres[0, 1] = 0
    bag.image(10.5, millimetres, "16UC1")
    metres = np.full((4, 6), 2.0, np.float32)
    metres[0, :3] = np.nan, np.inf, 3e38
    bag.image(10.6, metres, "32FC1")
    recording = opened(bag.write(tmp_path / "bag.bag"), pixel_stride=1)
    first, second = recording.sweeps()
    assert recording.sensors[0].kind == "depth"
    assert (len(first.ranges), len(second.ranges)) == (23, 22)
    assert np.isinf(second.ranges).tolist() == [False] * 21 + [True]
    # The first pixel's: (0 - 3) / 2, (0 - 2) / 2, 1, two metres deep.
    assert first.points[0].tolist() == [-3.0, -2.0, 2.0]
    assert first.ranges[0] == np.float32(np.sqrt(17.0))
    np.testing.assert_allclose(second.directions[-1] * np.sqrt(3.0), [-1.0, -1.0, 1.0], rtol=1e-6)
    assert recording.faults == {"pixel: no measurement": 2, "range: beyond the maximum": 1}
    assert len(next(opened(tmp_path / "bag.bag").sweeps()).ranges) == 1  # stride 4


def test_messages_of_sizes_that_do_not_agree_are_counted(tmp_path):
    bag = simple()
    bag.scan(10.1, [1.0])
    bag.scan(10.2, [1.0], range_max=20.0)
    bag.scan(10.3, [1.0], angle_increment=np.nan)
    bag.scan(10.4, [1.0] * 100, time_increment=1.0)
    bag.scan(10.5, [])
    recording = opened(bag.write(tmp_path / "bag"))
    assert len(list(recording.sweeps())) == 2
    assert recording.faults == {
        "message: cannot be read, the first: a scan of 1 beams from -1 by nan rad": 2,
        "sweep: nothing measured": 1,
    }


@pytest.mark.parametrize("kind", KINDS)
def test_a_bag_that_was_cut_is_read_up_to_there(tmp_path, kind):
    bag = simple(kind)
    for stamp in np.arange(10.0, 12.0, 0.01):
        bag.scan(stamp, [1.0] * 4000, angle_increment=0.0001)
    path = bag.write(tmp_path / KINDS[kind])
    file = path if path.is_file() else next(path.glob("*.mcap"), None) or next(path.glob("*.db3"))
    data = file.read_bytes()
    file.write_bytes(data[: len(data) * 2 // 3])
    if kind == "sqlite":
        with pytest.raises(InputError, match="no LaserScan"):
            opened(path)  # SQLite finds the damage before the first message
        return
    recording = opened(path)
    assert 50 < len(list(recording.sweeps())) < 150
    assert recording.faults == {"bag: cut short": 1}


@pytest.mark.parametrize(
    ("parent", "child", "z", "height"),
    [
        ("base_link", FOOTPRINT, -0.3, 0.3),
        (FOOTPRINT, "base_link", 0.3, 0.3),
        ("base_link", "tail", 0.3, None),
    ],
)
def test_the_height_of_the_body_is_that_above_its_footprint(tmp_path, parent, child, z, height):
    bag = Bag("mcap")
    for stamp in (10.0, 11.0):
        bag.tf("odom", parent, stamp, at(stamp, 0.0, 0.1))
    bag.tf(parent, child, 10.0, at(z=z), "/tf_static")
    bag.tf("base_link", "laser", 10.0, at(z=0.1), "/tf_static")
    bag.scan(10.5, [1.0] * 5)
    found = opened(bag.write(tmp_path / "bag")).body_height
    assert found == (None if height is None else pytest.approx(height))


def test_a_footprint_that_moves_below_the_body_bears_its_sensors(tmp_path):
    bag = Bag()
    bag.drive([10.0, 11.0])
    for stamp in (10.0, 11.0):
        bag.tf("base_link", FOOTPRINT, stamp, at(z=-0.01 * stamp))
    bag.scan(10.5, [1.0], frame="base_link")
    (sweep,) = opened(bag.write(tmp_path / "bag"), body=FOOTPRINT).sweeps()
    np.testing.assert_allclose(sweep.T_body_sensor.position, [0.0, 0.0, 0.105])


STAMPS = 1000.0 + 0.1 * np.arange(10)
SHARES = np.linspace(0.0, 1.0, 200)


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
