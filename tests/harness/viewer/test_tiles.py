"""Tiles of a map that changed."""

import numpy as np

from tests.harness.viewer.seen_map import HIGH, LOW, seen_map
from wayproof.harness.viewer.tiles import TILE, Tiles


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
