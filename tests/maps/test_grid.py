import numpy as np
import pytest

from wayproof.maps.grid import cell_box, cells_at, centres


def test_points_find_their_cells():
    points = [[0.05, 0.95, 0.1], [-0.01, 0.5, 0.5], [np.nan, 0.5, 0.5], [0.0, 1e7, 0.0]]
    cells, inside = cells_at(points, 0.1)
    assert inside.tolist() == [True, True, False, False]
    assert cells[:2].tolist() == [[0, 9, 1], [-1, 5, 5]]  # the floor's layer is [-0.075, 0.025)


@pytest.mark.parametrize("resolution", [0.02, 0.05, 0.1, 0.2, 0.5])
def test_the_floor_lies_at_three_quarters_of_its_layer(resolution):
    layers = cells_at([[0.0, 0.0, z * resolution] for z in (-0.76, -0.74, 0.24, 0.26)], resolution)
    assert layers[0][:, 2].tolist() == [-1, 0, 0, 1]


def test_the_middle_of_a_cell_lies_in_it():
    cells = np.random.default_rng(0).integers(-1000, 1000, (50, 3))
    found, inside = cells_at(centres(cells, 0.05), 0.05)
    np.testing.assert_array_equal(found, cells)
    assert inside.all()


def test_a_box_holds_the_cells_whose_centres_it_holds():
    first, end = cell_box((0.04, 0.06, -0.12), (0.26, 0.26, 0.08), 0.1)
    assert first.tolist() == [0, 1, 0]
    assert end.tolist() == [3, 3, 2]
    first, end = cell_box((0.0, 0.0, 0.0), (0.01, 1.0, 1.0), 0.1)
    assert end[0] == first[0]  # none


@pytest.mark.parametrize("corner", [(np.nan, 0, 0), (0, np.inf, 0), (0, 0), (0, 0, 2e6)])
def test_a_corner_must_be_finite(corner):
    with pytest.raises(ValueError, match="low: got"):
        cell_box(corner, (1, 1, 1), 0.1)
