import numpy as np
import pytest

from maps import MapConfig, VoxelMap
from maps.grid import Grid, grid_shape

ROOM = ((0.0, 0.0, 0.0), (10.0, 10.0, 3.0))


def test_a_room_has_2_4_million_cells_at_5_cm_and_125_times_as_many_at_1_cm():
    assert np.prod(grid_shape(*ROOM, 0.05)) == 2_400_000
    assert np.prod(grid_shape(*ROOM, 0.01)) == 125 * 2_400_000


@pytest.mark.parametrize("resolution", [0.02, 0.05, 0.1, 0.2, 0.5])
def test_the_floor_lies_at_three_quarters_of_its_layer(resolution):
    grid = Grid.covering((-1.0, 2.0, -0.3), (4.0, 5.0, 2.0), resolution)
    bottom = grid.origin[2] + grid.floor_layer * resolution
    assert bottom == pytest.approx(-0.75 * resolution)
    assert grid.origin[:2].tolist() == [-1.0, 2.0]
    assert -0.3 - resolution < grid.origin[2] <= -0.3 + 1e-9
    assert np.all(
        grid.origin + np.array(grid.shape) * resolution >= np.array([4.0, 5.0, 2.0]) - 1e-6
    )


def test_points_find_their_cells():
    grid = Grid.covering((0.0, 0.0, 0.0), (1.0, 1.0, 1.0), 0.1)
    cells, inside = grid.indices([[0.05, 0.95, 0.1], [-0.01, 0.5, 0.5], [np.nan, 0.5, 0.5]])
    assert inside.tolist() == [True, False, False]
    assert cells[0].tolist() == [0, 9, 1]  # z: the layer of the floor is [-0.075, 0.025)


def test_a_box_holds_the_cells_whose_centres_it_holds():
    grid = Grid.covering((0.0, 0.0, -0.075), (1.0, 1.0, 1.0), 0.1)
    first, end = grid.box((0.04, 0.06, -9.0), (0.26, 0.26, 9.0))
    assert first.tolist() == [0, 1, 0]
    assert end.tolist() == [3, 3, grid.shape[2]]


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
        VoxelMap(MapConfig(), low, high)
