"""Extra distance by class: cells that grow, against a slow count, and a costmap that follows."""

import numpy as np
import pytest

from tests.maps.sweeps import scattered
from wayproof.maps import (
    FREE,
    OCCUPIED,
    ClassMargins,
    Costmap,
    CostmapConfig,
    MapConfig,
    SemanticLayer,
    VoxelMap,
    states_in,
)
from wayproof.maps.columns import unpack

BOX = (-2.0, -2.0, -0.3), (2.0, 2.0, 1.5)


def seen(seed, sweeps=1):
    """A map, and a layer of three classes, of the same sweeps."""
    voxel_map = VoxelMap(MapConfig(half_life=0.0, memory_mib=16))
    layer = SemanticLayer(0.1, 3)
    for k in range(sweeps):
        look(voxel_map, layer, seed + k)
    return voxel_map, layer


def look(voxel_map, layer, seed):
    rng = np.random.default_rng(seed)
    directions, ranges_mm = scattered(rng, 60, 400, 2000)
    labels = rng.integers(0, 3, 60).astype(np.uint8)
    voxel_map.integrate((0.0, 0.0, 0.5), directions, ranges_mm, 3.0, seed)
    layer.integrate_sweep((0.0, 0.0, 0.5), directions, ranges_mm, (0.3, 3.0), labels)


def slow(voxel_map, layer, margins):
    """States of the box's cells, in which each cell of a class is a ball."""
    states = states_in(voxel_map, *BOX)
    first = np.array([-20, -20, -2])  # centres from -0.225 m on
    places = np.stack(np.indices(states.shape), axis=-1)
    grown = states.copy()
    cells, labels = layer.labelled(np.ones(3, bool))
    for cell, label in zip(cells - first, labels, strict=True):
        if label not in margins:
            continue
        point = (cell + first + [0.5, 0.5, -0.25]) * 0.1
        if voxel_map.state_at(point[None])[0] != OCCUPIED:
            continue
        apart = ((places - cell) ** 2).sum(axis=-1)
        grown[apart <= (margins[label] / 0.1) ** 2 + 1e-6] = OCCUPIED
    return states, grown


@pytest.mark.parametrize("margins", [{1: 0.3}, {0: 0.0, 2: 0.25}, {}])
def test_cells_of_a_class_grow_by_its_margin(margins):
    voxel_map, layer = seen(1, 3)
    plain, expected = slow(voxel_map, layer, margins)
    margined = ClassMargins(voxel_map, layer, margins)
    np.testing.assert_array_equal(states_in(margined, *BOX), plain)
    grown = unpack(margined.keep_out((-20, -20, -2), (40, 40, 1)), plain.shape[2])
    np.testing.assert_array_equal(np.where(grown, OCCUPIED, plain), expected)
    assert grown.any() == bool(margins)


def test_margins_in_the_air_outlive_changes_above_the_window():
    voxel_map, layer = VoxelMap(MapConfig(half_life=0.0, memory_mib=16)), SemanticLayer(0.1, 3)
    ahead, ranges_mm = np.array([[1.0, 0.0, 0.0]]), np.array([1000], np.uint16)
    voxel_map.integrate((1.05, 1.05, 1.0), ahead, ranges_mm, 3.0, 0)
    layer.integrate_sweep((1.05, 1.05, 1.0), ahead, ranges_mm, (0.3, 3.0), np.ones(1, np.uint8))
    margined = ClassMargins(voxel_map, layer, {1: 0.5})
    body = (0.0, 0.0, 0.5), (10.0, 10.0, 4.0), "air", 0.15, 0.3, 0.1
    costmap = Costmap(CostmapConfig(), margined, *body)
    assert (costmap.state == OCCUPIED).sum() > 500
    for origin in ((8.55, 9.05, 1.0), (0.05, 1.05, 6.5)):  # in the window, and above it
        voxel_map.integrate(origin, ahead, ranges_mm, 3.0, 0)
    costmap.update(0.1)
    anew = Costmap(CostmapConfig(), ClassMargins(voxel_map, layer, {1: 0.5}), *body)
    anew.update(0.1)
    np.testing.assert_array_equal(costmap.state, anew.state)
    np.testing.assert_array_equal(costmap.obstacle_clearance, anew.obstacle_clearance)


@pytest.mark.parametrize(("motion", "slope"), [("ground", 0.0), ("ground", 0.3), ("air", 0.0)])
def test_a_costmap_that_follows_is_one_made_anew(motion, slope):
    voxel_map, layer = seen(5)
    margined = ClassMargins(voxel_map, layer, {1: 0.2, 2: 0.1})
    body = CostmapConfig(max_slope=slope), margined, *BOX, motion, 0.15, 0.4, 0.1
    following = Costmap(*body)
    for seed in range(6, 12):
        look(voxel_map, layer, seed)
        following.update(0.1)
        anew = Costmap(*body[:1], ClassMargins(voxel_map, layer, {1: 0.2, 2: 0.1}), *body[2:])
        np.testing.assert_array_equal(following.state, anew.state)
        np.testing.assert_array_equal(following.clearance, anew.clearance)
    plain = Costmap(body[0], voxel_map, *body[2:])
    assert (following.obstacle_clearance < plain.obstacle_clearance).any()
    assert (following.obstacle_clearance <= plain.obstacle_clearance).all()


def test_a_person_is_passed_farther_away_than_a_crate():
    voxel_map, layer = VoxelMap(MapConfig(half_life=0.0, memory_mib=16)), SemanticLayer(0.1, 2)
    voxel_map.mark_free((-2.0, -2.0, 0.0), (2.0, 2.0, 1.5), 0)
    voxel_map.mark_floor((-2.0, -2.0), (2.0, 2.0), 0)
    sides, ranges_mm = np.array([[0.0, 1.0, 0.0], [0.0, -1.0, 0.0]]), np.full(2, 1000, np.uint16)
    for k in range(3):
        voxel_map.integrate((0.05, 0.05, 0.35), sides, ranges_mm, 3.0, k)
    labels = np.array([0, 1], np.uint8)
    layer.integrate_sweep((0.05, 0.05, 0.35), sides, ranges_mm, (0.3, 3.0), labels)
    body = (-1.5, -1.5, -0.3), (1.5, 1.5, 1.5), "ground", 0.15, 0.5, 0.1
    reach = []
    for margins in ({}, {1: 0.3}):
        costmap = Costmap(CostmapConfig(), ClassMargins(voxel_map, layer, margins), *body)
        blocked = costmap.state[15, :, 0] == OCCUPIED
        reach.append(np.flatnonzero(blocked).tolist())
    assert reach == [[5, 25], [2, 3, 4, 5, 6, 7, 8, 25]]
    assert (costmap.state[15, 9:25, 0] == FREE).all()


def test_bad_margins_are_refused():
    voxel_map, layer = seen(1)
    with pytest.raises(ValueError, match=r"^margins: got class 3, expected 0 to 2$"):
        ClassMargins(voxel_map, layer, {3: 0.1})
    with pytest.raises(ValueError, match=r"^resolution: got 0.2 m, expected the map's, 0.1$"):
        ClassMargins(voxel_map, SemanticLayer(0.2, 3), {})
    with pytest.raises(
        ValueError, match=r"^costmap.class_margins.person: got -1, expected 0 to 5 m$"
    ):
        CostmapConfig(class_margins={"person": -1.0})
