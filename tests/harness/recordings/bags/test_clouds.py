import numpy as np
import pytest

from tests.harness.recordings.bags.making import Bag, at
from wayproof.harness.recordings.formats import open_recording

POINTS = np.array([[1.0, 0.0, 0.0], [0.0, 2.0, 0.0], [3.0, 4.0, 0.0]], np.float32)


def columns(points=POINTS, **more):
    x, y, z = np.array(points).T
    return {"x": x, "y": y, "z": z, **more}


def sweeps(tmp_path, *clouds, stamp=1000.5):
    """The sweeps and faults of a bag with clouds: columns, and changed fields of the message."""
    bag = Bag()
    bag.tf("base_link", "lidar", 0.0, at(0.0, 0.0, 0.5), "/tf_static")
    bag.drive([1000.0, 1001.0, 1002.0])
    for k, (fields, changed) in enumerate(clouds):
        bag.cloud(stamp + 0.1 * k, fields, **changed)
    recording = open_recording(bag.write(tmp_path / "bag"))
    return list(recording.sweeps()), recording


def test_points_keep_their_bits(tmp_path):
    (sweep,), recording = sweeps(tmp_path, (columns(intensity=np.zeros(3, np.uint8)), {}))
    assert sweep.points.tolist() == POINTS.tolist()
    assert sweep.ranges.tolist() == [1.0, 2.0, 5.0]
    assert sweep.directions.tolist() == [
        [1, 0, 0],
        [0, 1, 0],
        [np.float32(0.6), np.float32(0.8), 0],
    ]
    assert sweep.beam_times_ns is None
    assert recording.sensors[0].kind == "points"
    assert not recording.sensors[0].missing_returns_known
    assert recording.faults == {}


@pytest.mark.parametrize("kind", [np.float64, ">f4", np.int16])
def test_points_of_other_types_and_orders(tmp_path, kind):
    fields = {name: column.astype(kind) for name, column in columns().items()}
    (sweep,), _ = sweeps(tmp_path, (fields, {"is_bigendian": kind == ">f4"}))
    assert sweep.points.tolist() == POINTS.tolist()


@pytest.mark.parametrize(
    ("kind", "package"), [("mcap", "livox_ros_driver2"), ("ros1", "livox_ros_driver")]
)
def test_a_cloud_of_livox_has_the_times_of_its_points(tmp_path, kind, package):
    bag = Bag(kind)
    bag.tf("base_link", "lidar", 0.0, at(0.0, 0.0, 0.5), "/tf_static")
    bag.drive([1000.0, 1001.0, 1002.0])
    points = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 0.0], [3.0, 4.0, 0.0]])
    for stamp in (1000.1, 1000.2, 1000.3):
        bag.livox(stamp, points, [0, 40_000_000, 90_000_000], package)
    recording = open_recording(bag.write(tmp_path / ("bag.bag" if kind == "ros1" else "bag")))
    found = list(recording.sweeps())
    assert [sweep.ranges.tolist() for sweep in found] == [[1.0, 5.0]] * 3
    assert found[0].beam_times_ns.tolist() == [0, 90_000_000]
    assert recording.faults == {}


def test_an_organised_cloud_with_holes_and_padded_rows(tmp_path):
    points = np.full((2, 3, 3), np.nan, np.float32)
    points[0, 1], points[1, 2] = [1.0, 0.0, 0.0], [0.0, 0.0, 0.0]
    padded = np.zeros((2, 48), np.uint8)
    padded[:, :36] = points.reshape(2, 9).view(np.uint8)
    shape = {"height": 2, "width": 3, "row_step": 48, "data": padded.reshape(-1)}
    (sweep,), recording = sweeps(tmp_path, (columns(points.reshape(6, 3)), shape))
    assert sweep.points.tolist() == [[1.0, 0.0, 0.0]]
    assert recording.faults == {"point: not finite": 4, "range: below the minimum": 1}


@pytest.mark.parametrize(
    ("name", "times", "text"),
    [
        ("t", np.array([0, 40_000_000, 90_000_000], np.uint32), "'t', ns since the stamp"),
        ("t", np.array([0, 40_000, 90_000], np.uint32), "'t', us since the stamp"),
        ("time", np.array([0.0, 0.04, 0.09], np.float32), "'time', s since the stamp"),
        (
            "timestamp",
            1000.5 + np.array([0.0, 0.04, 0.09]),
            "'timestamp', s since the epoch",
        ),
        (
            "timestamp",
            1000.5e9 + np.array([0.0, 4e7, 9e7]),
            "'timestamp', ns since the epoch",
        ),
    ],
)
def test_times_of_points_in_the_units_of_the_drivers(tmp_path, name, times, text):
    (sweep,), recording = sweeps(tmp_path, (columns(**{name: times}), {}))
    np.testing.assert_allclose(sweep.beam_times_ns, [0, 40_000_000, 90_000_000], atol=300)
    assert sweep.time_ns == 500_000_000
    assert text in recording.chosen


@pytest.mark.parametrize(
    "first",
    [
        columns(POINTS[:0], t=np.empty(0, np.uint32)),
        columns(np.full((3, 3), np.nan, np.float32), t=np.zeros(3, np.uint32)),
        columns(POINTS[:2], t=np.array([0, 50_000], np.uint32)),  # ns, as few us
    ],
)
def test_the_clouds_of_a_driver_that_starts_up_give_no_unit_of_times(tmp_path, first):
    times = np.array([0, 40_000_000, 90_000_000], np.uint32)
    found, recording = sweeps(tmp_path, (first, {}), (columns(t=times), {}))
    assert found[-1].beam_times_ns.tolist() == [0, 40_000_000, 90_000_000]
    assert "'t', ns since the stamp" in recording.chosen


def test_a_stamp_at_the_end_of_the_sweep_is_moved_to_the_first_beam(tmp_path):
    times = np.array([-0.1, -0.05, 0.0], np.float32)
    (sweep,), _ = sweeps(tmp_path, (columns(time=times), {}))
    assert sweep.time_ns == pytest.approx(400_000_000, abs=10)
    np.testing.assert_allclose(sweep.beam_times_ns, [0, 50_000_000, 100_000_000], atol=10)


@pytest.mark.parametrize(
    ("fields", "changed"),
    [
        (columns(), {"width": 2**31}),
        (columns(), {"height": 2**31, "width": 2**31}),
        (columns(), {"point_step": 0}),
        (columns(), {"point_step": 4}),
        (columns(), {"height": 2, "row_step": 2**31}),
        ({"x": POINTS[:, 0], "y": POINTS[:, 1]}, {}),
    ],
)
def test_sizes_that_the_data_does_not_have_are_counted(tmp_path, fields, changed):
    found, recording = sweeps(tmp_path, (columns(), {}), (fields, changed))
    assert len(found) == 1
    (kind,) = recording.faults
    assert kind.startswith("message: cannot be read, the first: a ")


def test_empty_clouds_and_far_points_are_counted(tmp_path):
    empty = {"width": 0, "row_step": 0, "data": np.empty(0, np.uint8)}
    most = np.finfo(np.float32).max  # whose length is beyond 32 bits: not a beam without return
    far = columns(np.array([[most] * 3, [1e30, 0, 0], [2e5, 0, 0], [1, 0, 0]], np.float32))
    found, recording = sweeps(tmp_path, (far, {}), (columns(), empty))
    assert [sweep.ranges.tolist() for sweep in found] == [[1.0]]
    assert recording.faults == {"range: beyond the maximum": 3, "sweep: nothing measured": 1}


def test_times_far_from_the_stamp_are_counted(tmp_path):
    good = columns(t=np.array([0, 1, 2], np.uint32))
    late = columns(t=np.array([0, 1, 4_294_967_295], np.uint32))  # after the last pose
    over = columns(time=np.array([0, 1, 30], np.float32))
    found, recording = sweeps(tmp_path, (good, {}), (late, {}), (over, {}))
    assert len(found) == 1
    assert recording.faults == {
        "message: cannot be read, the first: a cloud of points of other times": 2,
        "point: time far from the others": 1,
    }
