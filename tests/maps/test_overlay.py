"""Layers of what was not measured, and maps laid over them, against arrays of states."""

import numpy as np
import pytest

from tests.maps.sweeps import scattered
from wayproof.maps import FREE, OCCUPIED, UNKNOWN, Costmap, CostmapConfig, MapConfig, VoxelMap
from wayproof.maps.columns import Window, unpack
from wayproof.maps.overlay import CellLayer, Overlaid

WINDOW = Window(0.1, (-7, 3, -5), (10, 12, 150))


def draw(rng, shape):
    """Random states of a box of cells."""
    return rng.choice(np.array([UNKNOWN, FREE, OCCUPIED], np.uint8), shape)


def layer_of(states, window=WINDOW):
    layer = CellLayer(window)
    layer.put(window.first, states)
    return layer


def states_of(source, first, shape):
    """States (nx, ny, 64 words) by what a source says of its columns."""
    occupied, free = source.columns(first, shape)
    assert not (occupied & free).any()
    cells = 64 * shape[2]
    return unpack(free, cells) * np.uint8(FREE) + unpack(occupied, cells) * np.uint8(OCCUPIED)


def expected(states, first, shape, window=WINDOW):
    """The same cell by cell; unknown outside of the window."""
    box = np.zeros((shape[0], shape[1], 64 * shape[2]), np.uint8)
    for place in np.ndindex(box.shape):
        there = np.add(first, place) - window.first
        if (there >= 0).all() and (there < states.shape).all():
            box[place] = states[tuple(there)]
    return box


@pytest.mark.parametrize("seed", range(6))
def test_a_box_of_a_layer_is_that_of_its_states(seed):
    rng = np.random.default_rng(seed)
    states = draw(rng, WINDOW.shape)
    first = tuple(int(one) for one in np.add(WINDOW.first, rng.integers(-80, 90, 3)))
    if seed < 3:
        first = (-9 + seed, 1 + seed, -5 + 61 * seed)
    shape = (7, 6, 2)
    np.testing.assert_array_equal(
        states_of(layer_of(states), first, shape), expected(states, first, shape)
    )


def test_a_part_that_is_put_replaces_what_was_there_and_no_more():
    rng = np.random.default_rng(1)
    states, part = draw(rng, WINDOW.shape), draw(rng, (5, 4, 70))
    layer = layer_of(states)
    before = layer.version()
    layer.put((-3, 10, 20), part)
    states[4:9, 7:11, 25:95] = part
    np.testing.assert_array_equal(
        states_of(layer, WINDOW.first, (10, 12, 3)), expected(states, WINDOW.first, (10, 12, 3))
    )
    boxes, now = layer.changed(1)
    assert boxes.tolist() == [[-3, 10, 20, 2, 14, 90]]
    assert now == 2
    assert layer.version() != before
    assert layer.version() == layer_of(states).version()


def test_a_box_beyond_the_window_is_refused():
    with pytest.raises(ValueError, match="expected within"):
        CellLayer(WINDOW).put((-8, 3, -5), np.zeros((2, 2, 2), np.uint8))


def test_the_map_above_wins_wherever_it_knows_anything():
    rng = np.random.default_rng(2)
    above, below = draw(rng, WINDOW.shape), draw(rng, WINDOW.shape)
    both = Overlaid(layer_of(above), layer_of(below))
    combined = np.where(above == UNKNOWN, below, above)
    shape = (10, 12, 3)
    np.testing.assert_array_equal(
        states_of(both, WINDOW.first, shape), expected(combined, WINDOW.first, shape)
    )


def test_other_cells_are_refused():
    layer = CellLayer(Window(0.05, (0, 0, 0), (4, 4, 4)))
    with pytest.raises(ValueError, match="resolution"):
        Overlaid(VoxelMap(MapConfig(resolution=0.1)), layer)


def test_changes_of_both_are_told_and_each_once():
    above, below = layer_of(np.zeros(WINDOW.shape, np.uint8)), CellLayer(WINDOW)
    both = Overlaid(above, below)
    boxes, first = both.changed(0)
    assert len(boxes) == 1
    below.put((0, 5, 0), np.ones((1, 1, 1), np.uint8))
    boxes, second = both.changed(first)
    assert boxes.tolist() == [[0, 5, 0, 1, 6, 1]]
    above.put((1, 5, 0), np.ones((1, 1, 1), np.uint8))
    boxes, third = both.changed(second)
    assert boxes.tolist() == [[1, 5, 0, 2, 6, 1]]
    assert len(both.changed(third)[0]) == 0
    assert len(both.changed(first)[0]) == 2


@pytest.mark.parametrize("motion", ["ground", "air"])
def test_a_costmap_of_both_is_that_of_the_combined_cells_after_every_sweep(motion):
    """A voxel map that sees part of a room over a layer, against a map of the combined states."""
    low, high = (0.0, 0.0, -0.3), (4.0, 3.0, 1.5)
    window = Window.covering(low, high, 0.1)
    layer = CellLayer(window)
    rng = np.random.default_rng(3)
    states = np.full(window.shape, FREE, np.uint8)
    states[:, :, : -window.first[2]] = UNKNOWN
    states[:, :, -window.first[2]] = OCCUPIED
    states[12:15, 5:22, 3:12] = OCCUPIED
    layer.put(window.first, states)
    voxel_map = VoxelMap(MapConfig(resolution=0.1), low, high)
    body = {"radius": 0.2, "height": 0.6, "step_height": 0.1}
    costs = CostmapConfig()
    both = Overlaid(voxel_map, layer)
    costmap = Costmap(costs, both, low, high, motion, **body)
    for step in range(4):
        directions, ranges = scattered(rng, 300, 300, 2500)
        voxel_map.integrate((2.0, 1.5, 0.5), directions, ranges, 3.0, step * 100_000_000)
        costmap.update(costs.localization_margin)
        fresh = Costmap(costs, Overlaid(voxel_map, layer), low, high, motion, **body)
        np.testing.assert_array_equal(costmap.state, fresh.state)
        np.testing.assert_array_equal(costmap.clearance, fresh.clearance)
        np.testing.assert_array_equal(costmap.obstacle_clearance, fresh.obstacle_clearance)
        seen = voxel_map.columns(window.first, (*window.shape[:2], 1))
        known = unpack(seen[0] | seen[1], window.shape[2]).astype(bool)
        assert known.any()
