"""Widening along x and y, against plain loops and in a costmap."""

import numpy as np
import pytest
from scipy import ndimage

from wayproof.maps import Costmap, CostmapConfig, MapConfig, VoxelMap
from wayproof.maps.columns import pack, unpack
from wayproof.maps.costmap.widening import reached, widened
from wayproof.maps.states import FREE, OCCUPIED


def bits(cells, flat):
    """Cells (nx, ny, nz) in rows of bits, along y where flat (nz = 1), else along z."""
    rows = cells[:, None, :, 0] if flat else cells
    return pack(np.pad(rows, ((0, 0), (0, 0), (0, -rows.shape[2] % 64))))


@pytest.mark.parametrize("flat", [True, False])
@pytest.mark.parametrize("cells", [(3, 0), (0, 2), (2, 1), (40, 0)])
def test_each_cell_is_as_bad_as_the_worst_within_reach(flat, cells):
    rng = np.random.default_rng(3)
    shape = (21, 70, 1) if flat else (13, 9, 70)
    occupied = rng.random(shape) < 0.02
    free = ~occupied & (rng.random(shape) < 0.9)
    rows = (shape[0], 1, shape[1]) if flat else shape
    made = widened(bits(free, flat), bits(occupied, flat), rows, flat, cells)
    box = np.ones((2 * cells[0] + 1, 2 * cells[1] + 1, 1), bool)
    blocked = ndimage.binary_dilation(np.pad(occupied, 41, constant_values=True), box)
    not_free = ndimage.binary_dilation(np.pad(~free, 41, constant_values=True), box)
    inner = (slice(41, -41),) * 3
    if not flat:  # above and below nothing is widened
        blocked, not_free = (
            ndimage.binary_dilation(
                np.pad(one, ((41, 41), (41, 41), (0, 0)), constant_values=True), box
            )
            for one in (occupied, ~free)
        )
        inner = (slice(41, -41), slice(41, -41), slice(None))
    expected = bits(~not_free[inner], flat), bits(blocked[inner], flat)
    for got, plain in zip(made, expected, strict=True):
        assert got.dtype == np.uint64
        np.testing.assert_array_equal(
            unpack(got, 64 * got.shape[2]), unpack(plain, 64 * got.shape[2])
        )


def test_a_change_reaches_as_far_as_the_widening():
    box = slice(3, 5), slice(0, 1)
    assert reached(box, (6, 1, 9), (2, 1)) == (slice(1, 6), slice(0, 1))


@pytest.fixture
def room():
    """A map of a free floor of 6 x 4 m, and its costmap."""
    a_map = VoxelMap(MapConfig(resolution=0.1))
    a_map.mark_floor((0.0, 0.0), (6.0, 4.0), 0)
    a_map.mark_free((0.0, 0.0, 0.05), (6.0, 4.0, 1.0), 0)
    low, high = (0.0, 0.0, -0.5), (6.0, 4.0, 1.5)
    costmap = Costmap(CostmapConfig(), a_map, low, high, "ground", 0.3, 0.5, 0.05)
    return a_map, costmap


def test_a_margin_along_x_leaves_the_room_beside(room):
    _, costmap = room
    costmap.update(0.1)
    without = costmap.clearance[:, :, 0].copy()
    costmap.update(0.1, widening=(8, 0))
    assert costmap.clearance[7, 20, 0] == 0  # the end of the area is 0.8 m nearer
    assert costmap.clearance[30, 20, 0] == without[30, 20]  # the sides are not
    assert costmap.state[7, 20, 0] == FREE  # the map's cells stay as they are
    assert costmap.states_between(np.array([7, 20, 0]), np.array([8, 21, 1]))[0, 0, 0] == OCCUPIED
    costmap.update(0.1)
    np.testing.assert_array_equal(costmap.clearance[:, :, 0], without)


def test_what_changes_later_is_widened_too(room):
    a_map, costmap = room
    costmap.update(0.1, widening=(5, 0))
    back, ranges_mm = np.array([[-1.0, 0.0, 0.0]]), np.array([2000], np.uint16)
    a_map.integrate((4.05, 2.05, 0.3), back, ranges_mm, 3.0, 1)  # a post at (2.05, 2.05)
    costmap.update(0.1, widening=(5, 0))
    fresh = Costmap(
        CostmapConfig(), a_map, (0.0, 0.0, -0.5), (6.0, 4.0, 1.5), "ground", 0.3, 0.5, 0.05
    )
    fresh.update(0.1, widening=(5, 0))
    np.testing.assert_array_equal(costmap.clearance, fresh.clearance)
    np.testing.assert_array_equal(costmap.obstacle_clearance, fresh.obstacle_clearance)
    assert costmap.obstacle_clearance[16, 20, 0] == 0 < costmap.obstacle_clearance[20, 24, 0]
