import numpy as np
import pytest

from wayproof.maps import MapConfig, VoxelMap
from wayproof.maps.columns import Window, layer_bits, pack, region_of_interest, unpack


def test_a_window_has_the_states_of_its_cells():
    voxel_map = VoxelMap(MapConfig(half_life=0.0))
    voxel_map.mark_free((0.0, 0.0, 0.2), (0.3, 0.3, 0.4), 0)
    voxel_map.mark_floor((0.0, 0.0), (0.3, 0.1), 0)
    window = Window.covering((-0.2, 0.0, -0.175), (0.4, 0.5, 0.825), 0.1)
    assert window.shape == (6, 5, 10)
    assert window.floor_layer == 1
    np.testing.assert_allclose(window.origin, [-0.2, 0.0, -0.175])
    occupied, free = (
        unpack(words, 10) for words in voxel_map.columns(np.array(window.first), (6, 5, 1))
    )
    assert np.argwhere(occupied).tolist() == [[2, 0, 1], [3, 0, 1], [4, 0, 1]]
    assert np.argwhere(free).min(axis=0).tolist() == [2, 0, 4]
    assert np.argwhere(free).max(axis=0).tolist() == [4, 2, 5]
    assert free.sum() == 3 * 3 * 2


@pytest.mark.parametrize(
    ("low", "high", "message"),
    [
        ((0, 0, 0), (1, 0, 1), "expected low < high"),
        ((0, 0, np.nan), (1, 1, 1), "low: got"),
        ((0, 0), (1, 1, 1), "low: got"),
        ((0, 0, 0), (1, 1, np.inf), "high: got"),
        ((0, 0, -0.075), (100, 100, 29.9), r"got 300000000 cells .* expected at most 200000000"),
    ],
)
def test_bad_bounds_are_refused(low, high, message):
    with pytest.raises(ValueError, match=message):
        Window.covering(low, high, 0.1)


def test_layer_bits_are_the_cells_from_first_to_end():
    assert layer_bits(1, 3, 64).tolist() == [6]
    assert layer_bits(63, 66, 70).tolist() == [1 << 63, 3]
    assert layer_bits(5, 5, 10).tolist() == [0]
    set_bits = unpack(layer_bits(62, 65, 66).reshape(1, 1, 2), 66).ravel().nonzero()[0]
    assert set_bits.tolist() == [62, 63, 64]


def test_packed_cells_are_unpacked_again():
    cells = np.random.default_rng(1).random((3, 4, 128)) < 0.5
    words = pack(cells)
    assert (words.dtype, words.shape) == (np.uint64, (3, 4, 2))
    assert bool(words[1, 2, 1] >> np.uint64(5) & np.uint64(1)) == cells[1, 2, 69]
    np.testing.assert_array_equal(unpack(words, 128), cells)


def test_a_region_of_interest_has_both_corners_or_none():
    assert region_of_interest(None, None, 0.1) is None
    window = region_of_interest((0.0, 0.0, 0.0), (1.0, 1.0, 1.0), 0.1)
    assert window == Window.covering((0.0, 0.0, 0.0), (1.0, 1.0, 1.0), 0.1)
    with pytest.raises(ValueError, match=r"^low, high: got None and .*, expected both corners"):
        region_of_interest(None, (1.0, 1.0, 1.0), 0.1)
