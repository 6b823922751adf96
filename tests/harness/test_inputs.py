"""Sweeps and poses as the log holds them: placed beams, tables, lists, and what is none."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from wayproof.harness.errors import InputError
from wayproof.harness.input_messages import beams_from_info, decode_ranges, inputs_from_messages
from wayproof.harness.inputs import Beams, Pose, SweepInput
from wayproof.harness.listed_beams import CODEC, WIDE_CODEC, read_list, write_list
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.models.poses import Trail
from wayproof.models.sensors import codecs
from wayproof.models.sensors.beams import NO_RETURN, BeamTable, quantise


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


@pytest.mark.parametrize(
    ("count", "scan_poses", "said"),
    [(3, 1, "sweep of 'lidar': 3 beams, expected 2"), (2, 2, "without a trail")],
)
def test_a_sweep_that_does_not_fit_its_sensor_is_refused(count, scan_poses, said):
    pose = Pose(np.zeros(3), np.array([1.0, 0, 0, 0]), 0.0)
    with pytest.raises(InputError, match=said):
        beams(scan_poses).place(SweepInput("lidar", np.ones(count, np.uint16)), pose, 0)


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


INFO = pb.SensorInfo(
    name="laser",
    kind="lidar",
    range_m=100.0,
    rate_hz=10.0,
    order="list",
    measures="range",
    scan_poses=1,
    position_base_sensor=[1.0, 0.0, 0.0],
    rotation_base_sensor=np.eye(3).ravel().tolist(),
)
FRONT, LEFT = [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]


def sweep(ranges, directions=None, **poses):
    message = pb.Sweep(sensor="laser")
    beams = np.array([FRONT] * len(ranges) if directions is None else directions)
    write_list(message, beams, np.array(ranges, np.uint32), **poses)
    return message


def pose(position=(0.0, 0.0, 0.0), quaternion=(1.0, 0.0, 0.0, 0.0), history=()):
    message = pb.Pose(position=position, quaternion=quaternion)
    if history:
        message.history_positions.extend(np.ravel(history).tolist())
        message.history_quaternions.extend([1.0, 0.0, 0.0, 0.0] * len(history))
        message.history_period_s = 0.1
    return message


def placed(message, at):
    inputs = inputs_from_messages(at, [message])
    return beams_from_info(INFO).place(inputs.sweeps[0], inputs.pose, 0)


def test_ranges_beyond_65_metres_have_32_bits_and_others_16():
    assert sweep([65534, NO_RETURN, 0]).codec == CODEC
    far = sweep([80_000, NO_RETURN, 0])
    assert far.codec == WIDE_CODEC
    assert placed(far, pose()).ranges_mm.tolist() == [80_000, NO_RETURN, 0]


def test_beams_leave_from_the_mount():
    found = placed(sweep([1000, 2000], [FRONT, LEFT]), pose((5.0, 0.0, 0.0)))
    assert found.origins.tolist() == [[6.0, 0.0, 0.0]]
    assert found.directions.tolist() == [FRONT, LEFT]


def test_a_mount_of_the_sweep_takes_the_place_of_the_sensors():
    message = sweep([1000])
    half = np.sqrt(0.5)
    message.mount.extend([0.0, 2.0, 0.0, half, 0.0, 0.0, half])  # turned to the left
    found = placed(message, pose())
    assert found.origins.tolist() == [[0.0, 2.0, 0.0]]
    np.testing.assert_allclose(found.directions, [LEFT], atol=1e-12)


def test_each_beam_leaves_from_the_pose_of_its_own_time():
    message = sweep([1000, 1000, 1000], poses=np.array([0, 1, 1]), ages_ns=(200_000_000, 0))
    history = [(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (2.0, 0.0, 0.0)]
    found = placed(message, pose((2.0, 0.0, 0.0), history=history))
    assert found.origins[found.moments][:, 0].tolist() == [1.0, 3.0, 3.0]


def test_a_quaternion_off_unit_length_is_scaled_before_the_map_sees_it():
    found = placed(sweep([1000]), pose(quaternion=(1.0 - 9e-4, 0.0, 0.0, 0.0)))
    assert np.abs(np.square(found.directions).sum(axis=1) - 1.0).max() < 1e-12


@pytest.mark.parametrize(
    ("spoil", "text"),
    [
        (lambda m: m.ages_ns.__setitem__(slice(None), [10_000_000]), "without a trail"),
        (lambda m: m.ages_ns.append(-1), "0 to 10 s old"),
        (lambda m: m.ages_ns.extend([0] * 257), "at most 256"),
        (lambda m: setattr(m, "beam_poses", b"\x01\x00"), "below 1"),
        (lambda m: setattr(m, "directions", m.directions[:-1]), "expected 12 each"),
        (lambda m: setattr(m, "columns", 2**31), "expected 1 to"),
        (lambda m: m.mount.extend([0.0] * 7), "unit length"),
        (lambda m: m.mount.extend([0.0] * 6), "expected 7"),
    ],
)
def test_beams_that_are_none_are_refused_in_one_line(spoil, text):
    message = sweep([1000, 1000])
    spoil(message)
    with pytest.raises(InputError, match=text):
        placed(message, pose())


def test_a_sensor_with_tables_has_no_list():
    assert read_list(pb.Sweep(rows=1, columns=1)) is None
