import numpy as np
import pytest

from wayproof.harness.errors import InputError
from wayproof.harness.input_messages import beams_from_info, inputs_from_messages
from wayproof.harness.listed_beams import CODEC, WIDE_CODEC, read_list, write_list
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.models.sensors.beams import NO_RETURN

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
AHEAD, LEFT = [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]


def sweep(ranges, directions=None, **poses):
    message = pb.Sweep(sensor="laser")
    beams = np.array([AHEAD] * len(ranges) if directions is None else directions)
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
    found = placed(sweep([1000, 2000], [AHEAD, LEFT]), pose((5.0, 0.0, 0.0)))
    assert found.origins.tolist() == [[6.0, 0.0, 0.0]]
    assert found.directions.tolist() == [AHEAD, LEFT]


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


def test_an_older_sweep_without_a_trail_is_refused():
    with pytest.raises(InputError, match="without a trail"):
        placed(sweep([1000], ages_ns=(10_000_000,)), pose())


def test_a_quaternion_off_unit_length_is_scaled_before_the_map_sees_it():
    found = placed(sweep([1000]), pose(quaternion=(1.0 - 9e-4, 0.0, 0.0, 0.0)))
    assert np.abs(np.square(found.directions).sum(axis=1) - 1.0).max() < 1e-12


@pytest.mark.parametrize(
    ("spoil", "text"),
    [
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
        inputs_from_messages(pose(), [message])


def test_a_sensor_with_tables_has_no_list():
    assert read_list(pb.Sweep(rows=1, columns=1)) is None
