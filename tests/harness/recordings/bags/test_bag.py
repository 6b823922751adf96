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


def test_the_maximum_itself_says_that_nothing_came_back(tmp_path):
    bag = simple()
    bag.scan(10.5, [1.0, 10.0, 9.99])
    recording = opened(bag.write(tmp_path / "bag"))
    (sweep,) = recording.sweeps()
    assert sweep.ranges.tolist() == [1.0, np.inf, np.float32(9.99)]
    assert not recording.sensors[0].missing_returns_known


def test_a_laser_upside_down_has_its_left_to_the_right(tmp_path):
    bag = Bag()
    bag.drive([10.0, 11.0])
    bag.tf("base_link", "laser", 10.0, at(0.0, 0.0, 0.5, (0.0, 1.0, 0.0, 0.0)), "/tf_static")
    bag.scan(10.5, [2.0, np.nan], angle_min=np.pi / 2)
    (sweep,) = opened(bag.write(tmp_path / "bag")).sweeps()
    ends = rotate(sweep.T_body_sensor.quaternion, sweep.directions * sweep.ranges[:, None])
    np.testing.assert_allclose(ends, [[0.0, -2.0, 0.0]], atol=1e-6)


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


def test_the_beams_of_a_scan_may_be_apart_in_time(tmp_path):
    bag = simple()
    bag.scan(10.5, [1.0, np.nan, 1.0], time_increment=0.25)
    (sweep,) = opened(bag.write(tmp_path / "bag")).sweeps()
    assert sweep.beam_times_ns.tolist() == [0, 500_000_000]


def test_a_sweep_without_pose_or_transform_is_left_out_and_counted(tmp_path):
    bag = simple()
    for stamp in (9.9, 10.0, 12.0, 12.1):
        bag.scan(stamp, [1.0])
    bag.scan(
        11.9, [1.0] * 3, time_increment=0.1, scan_time=0.3
    )  # its last beam is after the last pose
    recording = opened(bag.write(tmp_path / "bag"))
    assert [sweep.time_ns for sweep in recording.sweeps()] == [0, 2_000_000_000]
    assert recording.faults == {"sweep: no pose at its time": 3}


def test_a_sweep_outside_the_times_chosen_is_no_fault(tmp_path):
    bag = simple()
    for stamp in (9.9, 10.1, 11.0, 11.9, 12.1):
        bag.scan(stamp, [1.0])
    recording = opened(bag.write(tmp_path / "bag"), begin=0.5, end=1.5)
    assert [sweep.time_ns for sweep in recording.sweeps()] == [1_000_000_000]
    assert recording.faults == {}


def test_a_gap_of_the_track_is_counted_and_bridged_by_no_sweep(tmp_path):
    bag = simple()
    bag.drive([14.0])
    for stamp in (12.0, 13.0, 14.0):
        bag.scan(stamp, [1.0])
    recording = opened(bag.write(tmp_path / "bag"))
    assert [sweep.time_ns for sweep in recording.sweeps()] == [2_000_000_000, 4_000_000_000]
    assert recording.faults == {"pose: gap of more than 1 s": 1, "sweep: no pose at its time": 1}
    assert len(list(opened(tmp_path / "bag", max_gap=2.0).sweeps())) == 3


def test_exchanged_scans_are_put_right_and_a_clock_set_back_is_counted(tmp_path):
    bag = simple()
    for stamp in (10.1, 10.3, 10.2, 10.4, 10.4):
        bag.scan(stamp, [1.0])
    recording = opened(bag.write(tmp_path / "bag"))
    times = [sweep.time_ns for sweep in recording.sweeps()]
    assert times == [100_000_000, 200_000_000, 300_000_000, 400_000_000]
    assert recording.faults == {"sweep: stamp out of order": 1}


def test_scans_without_a_stamp_are_taken_as_recorded(tmp_path):
    bag = simple()
    for stamp in (10.1, 10.2):
        bag.scan(stamp, [1.0], header=bag.build.header(0, "laser"))
    recording = opened(bag.write(tmp_path / "bag"))
    assert [sweep.time_ns for sweep in recording.sweeps()] == [100_000_000, 200_000_000]
    assert recording.faults == {"sweep: without a stamp, taken as recorded": 2}


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


def test_a_footprint_that_moves_below_the_body_bears_its_sensors(tmp_path):
    bag = Bag()
    bag.drive([10.0, 11.0])
    for stamp in (10.0, 11.0):
        bag.tf("base_link", FOOTPRINT, stamp, at(z=-0.01 * stamp))
    bag.scan(10.5, [1.0], frame="base_link")
    (sweep,) = opened(bag.write(tmp_path / "bag"), body=FOOTPRINT).sweeps()
    np.testing.assert_allclose(sweep.T_body_sensor.position, [0.0, 0.0, 0.105])


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


def test_transforms_of_ros_1_that_never_change_are_fixed(tmp_path):
    bag = Bag("ros1")
    bag.drive([10.0, 11.0])
    bag.tf("/base_link", "/laser", 10.4, at(0.3))  # published again and again, on /tf
    bag.scan(10.1, [1.0], frame="/laser")
    (sweep,) = opened(bag.write(tmp_path / "bag.bag")).sweeps()
    assert sweep.T_body_sensor.position.tolist() == [0.3, 0.0, 0.0]


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


def test_bytes_of_another_type_are_counted(tmp_path):
    bag = simple()
    bag.scan(10.1, [1.0])
    path = bag.write(tmp_path / "bag")
    file = next(path.glob("*.mcap"))
    data = file.read_bytes()
    place = data.index(b"sensor_msgs/msg/LaserScan", 100)  # in the schema of the channel
    named = data[:place] + b"sensor_msgs/msg/PointClou" + data[place + 25 :]
    file.write_bytes(named)
    with pytest.raises(InputError, match="no LaserScan, PointCloud2, depth Image, CustomMsg"):
        opened(path)


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
    ("parent", "child", "z"), [("base_link", FOOTPRINT, -0.3), (FOOTPRINT, "base_link", 0.3)]
)
def test_the_height_of_the_body_is_that_above_its_footprint(tmp_path, parent, child, z):
    bag = Bag("mcap")
    if child == FOOTPRINT:
        bag.drive([10.0, 11.0])
        bag.tf(parent, child, 10.0, at(z=z), "/tf_static")
    else:
        for stamp in (10.0, 11.0):
            bag.tf("odom", parent, stamp, at(stamp, 0.0, 0.1))
        bag.tf(parent, child, 10.0, at(z=z), "/tf_static")
    bag.tf("base_link", "laser", 10.0, at(z=0.1), "/tf_static")
    bag.scan(10.5, [1.0] * 5)
    bag.write(tmp_path / "bag")
    assert open_recording(tmp_path / "bag").body_height == pytest.approx(0.3)


def test_the_height_of_the_body_is_unknown_without_a_footprint(tmp_path):
    bag = Bag("mcap")
    bag.drive([10.0, 11.0])
    bag.tf("base_link", "laser", 10.0, at(z=0.1), "/tf_static")
    bag.scan(10.5, [1.0] * 5)
    bag.write(tmp_path / "bag")
    assert open_recording(tmp_path / "bag").body_height is None
