import numpy as np
import pytest

from wayproof.models.sensors import list_codec


def unit(count, seed=1):
    vectors = np.random.default_rng(seed).normal(size=(count, 3))
    return vectors / np.sqrt(np.square(vectors).sum(axis=1))[:, None]


def test_directions_come_back_within_a_millionth_of_a_radian_and_of_unit_length():
    directions = unit(5000)
    data = list_codec.encode_directions(directions.astype(np.float32))
    again = list_codec.decode_directions(data, len(directions))
    assert len(data) == 12 * len(directions)
    assert np.abs(again - directions).max() < 1e-6
    assert np.abs(np.square(again).sum(axis=1) - 1.0).max() < 1e-14


@pytest.mark.parametrize("axis", [[1, 0, 0], [0, -1, 0], [0, 0, 1]])
def test_a_direction_along_an_axis_is_exact(axis):
    data = list_codec.encode_directions(np.array([axis], np.float32))
    assert list_codec.decode_directions(data, 1).tolist() == [axis]


def test_ranges_of_32_bits_come_back():
    ranges = np.array([0, 1, 65534, 65535, 65536, 1_000_000, 2**32 - 1], np.uint32)
    data = list_codec.encode_ranges(ranges)
    assert np.array_equal(list_codec.decode_ranges(data, len(ranges)), ranges)


@pytest.mark.parametrize("data", [b"", bytes(11), bytes(13)])
def test_a_wrong_size_is_refused(data):
    with pytest.raises(ValueError, match="expected 12 each"):
        list_codec.decode_directions(data, 1)


def test_a_direction_of_no_length_is_refused():
    with pytest.raises(ValueError, match="unit length"):
        list_codec.decode_directions(bytes(12), 1)
