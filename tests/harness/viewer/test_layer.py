"""Images of one layer of a costmap."""

import numpy as np
import pytest

from tests.harness.viewer.seen_map import seen_map
from wayproof.harness.viewer.layer import (
    CHEAP,
    COLOURS,
    DEAR,
    FRONTIER,
    INFLATED,
    kinds,
    layer_at,
    shades,
)
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


def test_only_a_cost_of_zero_is_free_and_the_rest_is_unknown():
    colours = [tuple(one) for one in shades(np.arange(256, dtype=np.uint8).view(np.int8)).tolist()]
    assert [cost for cost in range(256) if colours[cost] == COLOURS[FREE]] == [0]
    assert [cost for cost in range(256) if colours[cost] == COLOURS[OCCUPIED]] == [100]
    unknown = {cost for cost in range(256) if colours[cost] == COLOURS[UNKNOWN]}
    assert unknown == {*range(101, 256)}
    assert (colours[1], colours[99]) == (CHEAP, DEAR)
    assert len({colours[cost] for cost in range(1, 100)}) == 99
