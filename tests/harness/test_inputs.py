import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from wayproof.harness.errors import InputError
from wayproof.harness.input_messages import beams_from_info, decode_ranges, inputs_from_messages
from wayproof.harness.inputs import Beams, Pose, SweepInput
from wayproof.harness.listed_beams import CODEC
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.models.poses import Trail
from wayproof.models.sensors import codecs
from wayproof.models.sensors.beams import BeamTable, quantise


@pytest.fixture(scope="module", autouse=True)
def compiled():
    """Else the first example takes as long as the compiler."""
    codecs.warm_up()


@given(arrays(np.uint16, st.tuples(st.integers(1, 5), st.integers(1, 9))))
def test_codec_round_trip(image):
    rows, columns = image.shape
    data = codecs.encode_image(image.ravel(), rows)
    sweep = pb.Sweep(rows=rows, columns=columns, codec=CODEC, ranges=data)
    assert len(data) == 2 * image.size
    assert (decode_ranges(sweep) == image.ravel()).all()


@pytest.mark.parametrize(
    ("fields", "said"),
    [
        ({"codec": "raw", "ranges": bytes(4)}, "codec 'raw'"),
        ({"codec": CODEC, "ranges": bytes(3)}, "3 bytes, expected 4"),
    ],
)
def test_a_broken_sweep_is_refused(fields, said):
    with pytest.raises(InputError, match=said):
        decode_ranges(pb.Sweep(rows=1, columns=2, **fields))


def test_quantise_marks_misses_and_what_is_out_of_range():
    ranges = np.array([-1.0, 0.0, 0.0004, 1.2346, 10.0, 10.0001, 70.0])
    assert quantise(ranges, 10.0).tolist() == [65535, 1, 1, 1235, 10000, 65535, 65535]


HALF = np.sqrt(0.5)
QUARTER_TURN = np.array([HALF, 0.0, 0.0, HALF])  # to the left
AHEAD = np.array([[1.0, 0.0]])  # cos, sin
AROUND = np.array([[1.0, 0.0], [0.0, 1.0]])


def beams(scan_poses=1, **table):
    table = {"rows": AHEAD, "columns": AROUND, "beams": 2, "scan_poses": scan_poses, **table}
    return Beams(BeamTable(**table), 10.0, 10.0, np.array([0.2, 0.0, 0.1]), np.eye(3))


def test_a_sweep_is_placed_where_the_body_believes_to_be():
    pose = Pose(np.array([1.0, 2.0, 0.5]), QUARTER_TURN, 0.0)
    placed = beams().place(SweepInput("lidar", np.array([700, 65535], np.uint16)), pose, 3)
    np.testing.assert_allclose(placed.origins, [[1.0, 2.2, 0.6]], atol=1e-15)
    np.testing.assert_allclose(placed.directions, [[0, 1, 0], [-1, 0, 0]], atol=1e-15)
    assert placed.ranges_mm.tolist() == [700, 65535]
    assert placed.moments.tolist() == [0, 0]


def test_a_rolling_sweep_leaves_from_where_the_body_was():
    """Ten hertz, two moments: the first beam left 50 ms before the second, half a trail ago."""
    trail = Trail(
        np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 4.0, 0.0]]),
        np.stack([np.array([1.0, 0, 0, 0]), np.array([1.0, 0, 0, 0]), QUARTER_TURN]),
        0.05,
    )
    pose = Pose(trail.positions[-1], trail.quaternions[-1], 0.0, trail)
    placed = beams(2).place(SweepInput("lidar", np.array([700, 800], np.uint16)), pose, 0)
    np.testing.assert_allclose(placed.origins, [[1.2, 0.0, 0.1], [1.0, 4.2, 0.1]], atol=1e-15)
    np.testing.assert_allclose(placed.directions, [[1, 0, 0], [-1, 0, 0]], atol=1e-15)
    assert placed.moments.tolist() == [0, 1]


def test_beams_that_never_repeat_follow_the_sequence():
    table = {"order": "pairs", "beams": 1, "row_step": 1, "column_step": 1}
    sensor = beams(**table)
    pose = Pose(np.zeros(3), np.array([1.0, 0, 0, 0]), 0.0)
    sweep = SweepInput("lidar", np.array([700], np.uint16))
    assert sensor.place(sweep, pose, 0).directions.tolist() == [[1.0, 0.0, 0.0]]
    assert sensor.place(sweep, pose, 1).directions.tolist() == [[0.0, 1.0, 0.0]]
    assert sensor.place(sweep, pose, 2).directions.tolist() == [[1.0, 0.0, 0.0]]


def test_a_depth_becomes_a_range_along_the_ray():
    slopes = {"rows": np.array([[0.0]]), "columns": np.array([[0.75], [0.0]]), "measures": "depth"}
    pose = Pose(np.zeros(3), np.array([1.0, 0, 0, 0]), 0.0)
    placed = beams(**slopes).place(SweepInput("d", np.array([400, 0], np.uint16)), pose, 0)
    assert placed.ranges_mm.tolist() == [500, 0]


def test_a_sweep_of_another_size_is_refused():
    pose = Pose(np.zeros(3), np.array([1.0, 0, 0, 0]), 0.0)
    with pytest.raises(InputError, match="sweep of 'lidar': 3 beams, expected 2"):
        beams().place(SweepInput("lidar", np.ones(3, np.uint16)), pose, 0)


def test_a_rolling_sweep_without_a_trail_is_refused():
    pose = Pose(np.zeros(3), np.array([1.0, 0, 0, 0]), 0.0)
    with pytest.raises(InputError, match="without a trail"):
        beams(2).place(SweepInput("lidar", np.ones(2, np.uint16)), pose, 0)


def info(**changes):
    fields = {
        "name": "lidar",
        "range_m": 10.0,
        "rate_hz": 10.0,
        "row_width": 2,
        "rows": AHEAD.ravel().tolist(),
        "columns": AROUND.ravel().tolist(),
        "beams": 2,
        "order": "grid",
        "scan_poses": 1,
        "measures": "range",
        "position_base_sensor": [0.0, 0.0, 0.0],
        "rotation_base_sensor": np.eye(3).ravel().tolist(),
    }
    return pb.SensorInfo(**{**fields, **changes})


def test_a_logged_sensor_is_rebuilt():
    table = beams_from_info(info()).table
    assert (table.rows == AHEAD).all()
    assert (table.columns == AROUND).all()


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"row_width": 3}, "width 3"),
        ({"rate_hz": 0.0}, "rate 0 Hz"),
        ({"beams": 3}, "beams: got 3"),
        ({"order": "spiral"}, "order: got 'spiral'"),
        ({"scan_poses": 0}, "scan_poses: got 0"),
        ({"measures": "colour"}, "measures: got 'colour'"),
        ({"rows": [2.0, 0.0]}, "rows: expected"),
        ({"rotation_base_sensor": [1.0]}, "no mounting"),
    ],
)
def test_what_is_no_sensor_is_refused(changes, said):
    with pytest.raises(InputError, match=f"sensor 'lidar': .*{said}"):
        beams_from_info(info(**changes))


def test_a_broken_trail_is_refused():
    pose = pb.Pose(position=[0.0] * 3, quaternion=[1.0, 0, 0, 0], history_period_s=0.01)
    with pytest.raises(InputError, match="pose: trail"):
        inputs_from_messages(pose, [])
