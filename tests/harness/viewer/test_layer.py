"""Images of one layer of a costmap."""

import numpy as np
import pytest

from tests.harness.viewer.seen_map import seen_map
from wayproof.harness.viewer.layer import COLOURS, FRONTIER, INFLATED, kinds, layer_at, pixels
from wayproof.maps import FREE, OCCUPIED, UNKNOWN


@pytest.mark.parametrize("wider", [0, 9])
def test_kinds_are_those_of_each_cell_alone(wider):
    _, costmap = seen_map()
    layer, limit = layer_at(costmap, 0.55), costmap.collision_distance_sq + wider
    found, states = kinds(costmap, layer, limit), costmap.state[:, :, layer]
    field = costmap.obstacle_clearance[:, :, layer]
    nx, ny = found.shape
    for x, y in np.ndindex(nx, ny):
        around = [(x + 1, y), (x - 1, y), (x, y + 1), (x, y - 1)]
        unknown = any(states[i, j] == UNKNOWN for i, j in around if 0 <= i < nx and 0 <= j < ny)
        expected = states[x, y]
        if expected == FREE and field[x, y] <= limit:
            expected = INFLATED
        elif expected == FREE and unknown:
            expected = FRONTIER
        assert found[x, y] == expected
    assert set(np.unique(found)) == {UNKNOWN, FREE, OCCUPIED, INFLATED, FRONTIER}


def test_an_image_has_x_to_the_right_and_y_up():
    found = np.zeros((3, 2), np.uint8)
    found[2, 1] = OCCUPIED
    image = pixels(found)
    assert image.shape == (2, 3, 3)
    assert tuple(image[0, 2]) == COLOURS[OCCUPIED]
    assert tuple(image[1, 2]) == COLOURS[int(found[2, 0])]
