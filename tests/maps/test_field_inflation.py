import numpy as np
import pytest
from scipy.ndimage import distance_transform_edt

from wayproof.maps.columns import layer_bits, unpack
from wayproof.maps.costmap.inflation import inflate
from wayproof.maps.parallel import ThreadTeam


def packed(cells):
    nx, ny, nz = cells.shape
    weights = np.uint64(1) << np.arange(64, dtype=np.uint64)
    return (cells.reshape(nx, ny, nz // 64, 64) * weights).sum(axis=3, dtype=np.uint64)


@pytest.mark.parametrize("shape", [(1, 1, 64), (9, 1, 128), (1, 12, 64), (21, 17, 192)])
@pytest.mark.parametrize("squared_radius", [0, 1, 2, 3, 13, 49, 50, 400])
def test_inflation_equals_a_threshold_on_exact_distances(shape, squared_radius):
    rng = np.random.default_rng(squared_radius)
    for density in (0.0005, 0.01, 0.5):
        cells = rng.random(shape) < density
        cells[0, 0, 63] = True
        words = packed(cells)
        expected = np.rint(distance_transform_edt(~cells) ** 2) <= squared_radius
        inflated = inflate(words, squared_radius)
        np.testing.assert_array_equal(unpack(inflated, shape[2]), expected)
        np.testing.assert_array_equal(inflate(words, squared_radius, ThreadTeam(3)), inflated)
    assert not inflate(np.zeros_like(words), squared_radius).any()


def test_a_ball_of_radius_2_has_33_cells():
    cells = np.zeros((7, 7, 64), np.bool_)
    cells[3, 3, 10] = True
    assert unpack(inflate(packed(cells), 4), 64).sum() == 33


@pytest.mark.parametrize("squared_radius", [-1, 181 * 181 + 1])
def test_a_radius_out_of_range_is_refused(squared_radius):
    with pytest.raises(ValueError, match=f"squared_radius: got {squared_radius}"):
        inflate(np.zeros((2, 2, 1), np.uint64), squared_radius)


def test_layer_bits_are_the_cells_from_first_to_end():
    assert layer_bits(1, 3, 64).tolist() == [6]
    assert layer_bits(63, 66, 70).tolist() == [1 << 63, 3]
    assert layer_bits(5, 5, 10).tolist() == [0]
    assert unpack(layer_bits(62, 65, 66).reshape(1, 1, 2), 66).ravel().nonzero()[0].tolist() == [
        62,
        63,
        64,
    ]
