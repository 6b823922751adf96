import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from models import range_codec

SWEEPS = arrays(np.uint16, st.tuples(st.integers(1, 5), st.integers(1, 9)))


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
    rows, columns = image.shape
    packed = range_codec.encode(image.ravel(), rows)
    assert packed == naive(image)
    planes, again = np.empty((2, image.size), np.uint8), np.empty(image.size, np.uint16)
    with np.errstate(over="ignore"):  # it wraps around
        range_codec.write_differences.py_func(image.ravel(), columns, planes)
        range_codec.add_differences.py_func(planes, columns, again)
    assert planes.tobytes() == packed
    assert (again == image.ravel()).all()
    assert (range_codec.decode(packed, rows) == image.ravel()).all()
