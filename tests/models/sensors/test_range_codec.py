import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from wayproof.models.sensors import range_codec

SWEEPS = arrays(np.uint16, st.tuples(st.integers(1, 5), st.integers(1, 9)))


@pytest.fixture(scope="module", autouse=True)
def compiled():
    """Else the first example takes as long as the compiler."""
    range_codec.warm_up()


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
    packed = range_codec.encode(image.ravel(), rows)
    assert packed == naive(image)
    planes, again = np.empty((2, *image.shape), np.uint8), np.empty_like(image)
    with np.errstate(over="ignore"):  # it wraps around
        range_codec.write_differences.py_func(image, planes)
        range_codec.add_differences.py_func(planes, again)
    assert planes.tobytes() == packed
    assert (again == image).all()
    assert (range_codec.decode(packed, rows) == image.ravel()).all()


def test_rows_that_do_not_come_out_even_are_refused():
    with pytest.raises(ValueError, match="reshape"):
        range_codec.encode(np.zeros(5, np.uint16), 2)
    with pytest.raises(ValueError, match="reshape"):
        range_codec.decode(bytes(10), 2)
