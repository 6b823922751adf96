import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.maps.exact_distances import framed, packed, scipy_squared
from wayproof.maps.costmap.distance_field import DistanceField

SHAPES = [(1, 1, 1), (1, 1, 70), (9, 1, 40), (1, 17, 5), (12, 9, 1), (7, 11, 63), (5, 6, 130)]


def brute_force(blocked, reach):
    """Squared distances counted one by one."""
    cells = np.argwhere(np.ones(blocked.shape)) + [int(n > 1) for n in blocked.shape]
    others = np.argwhere(framed(blocked))
    most = reach * reach
    nearest = [((others - cell) ** 2).sum(axis=1).min(initial=most) for cell in cells]
    return np.reshape(nearest, blocked.shape)


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("reach", [1, 2, 5, 12])
def test_distances_equal_those_counted_one_by_one(shape, reach):
    rng = np.random.default_rng(reach)
    for density in (0.0, 0.003, 0.1, 1.0):
        blocked = rng.random(shape) < density
        field = DistanceField(shape, reach)
        field.update(packed(blocked))
        np.testing.assert_array_equal(field.squared, brute_force(blocked, reach))


def test_the_distances_around_one_cell():
    field = DistanceField((9, 9, 9), 3)
    blocked = np.zeros((9, 9, 9), np.bool_)
    blocked[4, 4, 4] = True
    field.update(packed(blocked))
    assert field.squared[4, 4, 4] == 0
    assert field.squared[5, 5, 4] == 2
    assert field.squared[5, 5, 6] == 6
    assert field.squared[6, 6, 6] == 9  # 12, cut off
    assert field.squared[0, 4, 4] == 1  # the border
    field.update(packed(np.zeros_like(blocked)))
    assert field.squared[4, 4, 4] == 9


@settings(max_examples=25, deadline=None, derandomize=True)
@given(
    shape=st.tuples(st.integers(1, 25), st.integers(1, 25), st.integers(1, 70)),
    reach=st.integers(1, 30),
    seed=st.integers(0, 2**32 - 1),
)
def test_any_sequence_of_changed_boxes_of_columns(shape, reach, seed):
    rng = np.random.default_rng(seed)
    nx, ny, _ = shape
    field = DistanceField(shape, reach)
    blocked = np.zeros(shape, np.bool_)
    for _ in range(6):
        x0, y0 = rng.integers(0, nx), rng.integers(0, ny)
        x1, y1 = rng.integers(x0 + 1, nx + 1), rng.integers(y0 + 1, ny + 1)
        part = blocked[x0:x1, y0:y1]
        part[:] = rng.random(part.shape) < rng.choice([0.0, 0.01, 0.3, 1.0])
        field.update(packed(part), x0, y0)
        np.testing.assert_array_equal(field.squared, scipy_squared(blocked, reach))


@pytest.mark.parametrize(
    ("shape", "reach", "message"),
    [
        ((0, 5, 5), 3, r"shape: got \(0, 5, 5\), expected 1 cell or more"),
        ((5, 5, 5), 0, "reach: got 0 cells, expected 1 to 181"),
        ((5, 5, 5), 182, "reach: got 182 cells"),
    ],
)
def test_what_is_no_field_is_refused(shape, reach, message):
    with pytest.raises(ValueError, match=message):
        DistanceField(shape, reach)


@pytest.mark.parametrize(
    ("size", "place"), [((6, 5, 1), (0, 0)), ((2, 2, 2), (0, 0)), ((2, 2, 1), (4, 0))]
)
def test_columns_outside_the_window_are_refused(size, place):
    with pytest.raises(ValueError, match=r"expected within \(5, 5, 1\)"):
        DistanceField((5, 5, 5), 3).update(np.zeros(size, np.uint64), *place)


@pytest.mark.parametrize("reach", [178, 179, 180, 181])
def test_the_greatest_distances_fit_their_16_bits(reach):
    blocked = np.zeros((420, 1, 400), np.bool_)
    blocked[[10, 200], 0, [390, 30]] = True
    field = DistanceField(blocked.shape, reach)
    field.update(packed(blocked))
    np.testing.assert_array_equal(field.squared, scipy_squared(blocked, reach))
    assert field.squared.max() == reach * reach
