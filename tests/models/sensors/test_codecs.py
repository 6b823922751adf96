import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from wayproof.models.sensors import codecs

SWEEPS = arrays(np.uint16, st.tuples(st.integers(1, 5), st.integers(1, 9)))


@pytest.fixture(scope="module", autouse=True)
def compiled():
    """Else the first example takes as long as the compiler."""
    codecs.warm_up()


def naive(image):
    """Differences along each row, whole numbers modulo 2^16, split into low and high bytes."""
    low, high = [], []
    for row in image.tolist():
        for before, now in zip([0, *row], row, strict=False):
            low.append((now - before) % 65536 % 256)
            high.append((now - before) % 65536 // 256)
    return bytes(low + high)


@given(SWEEPS)
def test_compiled_interpreted_and_naive_packing_agree(image):
    rows = len(image)
    packed = codecs.encode_image(image.ravel(), rows)
    assert packed == naive(image)
    planes, again = np.empty((2, *image.shape), np.uint8), np.empty_like(image)
    with np.errstate(over="ignore"):  # it wraps around
        codecs.write_differences.py_func(image, planes)
        codecs.add_differences.py_func(planes, again)
    assert planes.tobytes() == packed
    assert (again == image).all()
    assert (codecs.decode_image(packed, rows) == image.ravel()).all()


def test_rows_that_do_not_come_out_even_are_refused():
    with pytest.raises(ValueError, match="reshape"):
        codecs.encode_image(np.zeros(5, np.uint16), 2)
    with pytest.raises(ValueError, match="reshape"):
        codecs.decode_image(bytes(10), 2)


def unit(count, seed=1):
    vectors = np.random.default_rng(seed).normal(size=(count, 3))
    return vectors / np.sqrt(np.square(vectors).sum(axis=1))[:, None]


def test_directions_come_back_within_a_millionth_of_a_radian_and_of_unit_length():
    directions = unit(5000)
    data = codecs.encode_directions(directions.astype(np.float32))
    again = codecs.decode_directions(data, len(directions))
    assert len(data) == 12 * len(directions)
    assert np.abs(again - directions).max() < 1e-6
    assert np.abs(np.square(again).sum(axis=1) - 1.0).max() < 1e-14


@pytest.mark.parametrize("axis", [[1, 0, 0], [0, -1, 0], [0, 0, 1]])
def test_a_direction_along_an_axis_is_exact(axis):
    data = codecs.encode_directions(np.array([axis], np.float32))
    assert codecs.decode_directions(data, 1).tolist() == [axis]


def test_ranges_of_32_bits_come_back():
    ranges = np.array([0, 1, 65534, 65535, 65536, 1_000_000, 2**32 - 1], np.uint32)
    data = codecs.encode_ranges(ranges)
    assert np.array_equal(codecs.decode_ranges(data, len(ranges)), ranges)


@pytest.mark.parametrize("data", [b"", bytes(11), bytes(13)])
def test_a_wrong_size_is_refused(data):
    with pytest.raises(ValueError, match="expected 12 each"):
        codecs.decode_directions(data, 1)


def test_a_direction_of_no_length_is_refused():
    with pytest.raises(ValueError, match="unit length"):
        codecs.decode_directions(bytes(12), 1)
