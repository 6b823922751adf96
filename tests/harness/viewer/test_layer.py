"""One layer of a costmap, the age and probability of its cells, and tiles of a map that changed."""

import numpy as np
import pytest

from wayproof.harness.viewer.evidence import evidence_at
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
from wayproof.harness.viewer.tiles import TILE, Tiles
from wayproof.maps import FREE, OCCUPIED, UNKNOWN, Costmap, CostmapConfig, MapConfig, VoxelMap

LOW, HIGH = (0.0, 0.0, 0.0), (4.0, 4.0, 1.0)


def seen_map():
    """Free from x = 0 to 2 m, one obstacle in it, unknown beyond."""
    config = MapConfig(resolution=0.1, half_life=0.0)
    a_map = VoxelMap(config)
    a_map.mark_free((0.0, 0.0, 0.0), (2.0, 4.0, 1.0), 0)
    beam, ranges_mm = np.array([[1.0, 0.0, 0.0]]), np.array([500], np.uint16)
    for sweep in range(8):
        a_map.integrate((0.55, 2.05, 0.55), beam, ranges_mm, 2.0, sweep)
    return a_map, Costmap(CostmapConfig(), a_map, LOW, HIGH, "air", 0.15, 0.2, 0.0)


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


class Body:
    """What a mission says of its body."""

    def __init__(self, planar):
        self.planar, self.step_height, self.height = planar, 0.1, 1.0


def test_only_known_cells_have_an_age_and_a_probability_and_of_a_column_the_worst():
    a_map, costmap = seen_map()
    layer = layer_at(costmap, 0.55)
    flat, high = (
        evidence_at(a_map, costmap, layer, Body(planar), 3_000_000_000) for planar in (False, True)
    )
    states = costmap.state[:, :, layer]
    assert (states == UNKNOWN).any()
    for values in flat:
        np.testing.assert_array_equal(np.isnan(values), states == UNKNOWN)
    assert (flat.probability[states == FREE] < 0.5).all()
    assert (flat.probability[states == OCCUPIED] > 0.5).all()
    np.testing.assert_allclose(flat.age_s[states != UNKNOWN], 3.0, atol=1e-6)
    known = states != UNKNOWN
    assert (high.probability[known] >= flat.probability[known]).all()


def test_tiles_report_a_change_once():
    a_map, _ = seen_map()
    tiles = Tiles(LOW, HIGH, 0.1)
    (tile,) = tiles.changed(a_map)
    centres = tiles.centres(tile)
    assert tile.name == "0_0"
    assert TILE * 0.1 > 2.1
    np.testing.assert_allclose(centres, [[1.05, 2.05, centres[0, 2]]])
    assert abs(centres[0, 2] - 0.55) < 0.1
    assert tiles.changed(a_map) == []
