import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from harness.errors import InputError
from harness.inputs import CODEC, decode_ranges, encode_ranges, rotation_matrix
from harness.schema import wayproof_pb2 as pb
from models.beams import DepthCamera, Lidar, beam_directions, quantise, rotate


@given(arrays(np.uint16, st.tuples(st.integers(1, 5), st.integers(1, 9))))
def test_codec_round_trip(image):
    rows, columns = image.shape
    data = encode_ranges(image.ravel(), rows)
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


def test_lidar_directions_by_hand():
    lidar = Lidar("l", "s", 3, 4, -np.pi / 4, np.pi / 4, 10.0, 10.0, "test")
    directions = beam_directions(*lidar.beam_tables()).reshape(3, 4, 3)
    np.testing.assert_allclose(directions[1, 2], [1, 0, 0], atol=1e-15)
    np.testing.assert_allclose(directions[1, 3], [0, 1, 0], atol=1e-15)
    np.testing.assert_allclose(directions[2, 2], np.array([1, 0, 1]) / np.sqrt(2), atol=1e-15)


def test_depth_camera_directions_by_hand():
    camera = DepthCamera("c", "s", 2, 2, np.pi / 2, np.pi / 2, 5.0, 10.0, "test")
    directions = beam_directions(*camera.beam_tables())
    expected = np.array([[1, 0.5, 0.5], [1, -0.5, 0.5], [1, 0.5, -0.5], [1, -0.5, -0.5]])
    np.testing.assert_allclose(directions, expected / np.sqrt(1.5), rtol=1e-15)


def test_rotation_matrix_is_a_quarter_turn():
    half = np.sqrt(0.5)
    R = rotation_matrix(np.array([half, 0, 0, half]))
    np.testing.assert_allclose(R @ [1, 0, 0], [0, 1, 0], atol=1e-15)
    np.testing.assert_allclose(rotate(R, np.array([[0.0, 1.0, 2.0]])), [[-1, 0, 2]], atol=1e-15)
