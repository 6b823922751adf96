"""The cell of the map, and its state, for which a cell of a costmap blocks."""

import numpy as np
import pytest

from tests.maps.costmap.test_class_margins import BOX, seen
from tests.maps.costmap.test_costmap import FLOOR, HIGH, LOW, StateArray, air, ground
from wayproof.maps import FREE, OCCUPIED, UNKNOWN, ClassMargins, Costmap, CostmapConfig, states_in

AT = (10, 8)


@pytest.fixture
def states():
    cells = np.full((30, 20, 15), UNKNOWN, np.uint8)
    cells[:, :, FLOOR] = OCCUPIED
    cells[:, :, FLOOR + 1 :] = FREE
    return cells


def named(costmap, x, y, z=0):
    return costmap.blocker(costmap.origin + (np.array([x, y, z]) + 0.5) * costmap.resolution)


@pytest.mark.parametrize("slope", [0.0, 0.3])
@pytest.mark.parametrize(
    ("layer", "state", "at", "words"),
    [
        (6, OCCUPIED, 6, "occupied"),
        (7, UNKNOWN, 7, "unknown"),
        (FLOOR, UNKNOWN, FLOOR, "floor not seen"),
    ],
)
def test_a_column_is_blocked_by_the_cell_that_is_as_it_says(states, slope, layer, state, at, words):
    states[(*AT, layer)] = state
    found = named(ground(StateArray(states), max_slope=slope), *AT)
    assert found.state == words
    assert found.centre == pytest.approx((1.05, 0.85, LOW[2] + 0.1 * (at + 0.5)))


def test_a_hole_has_no_floor(states):
    states[(*AT, slice(0, FLOOR + 1))] = FREE
    found = named(ground(StateArray(states)), *AT)
    assert found.state == "no floor"
    assert found.centre[2] == pytest.approx(LOW[2] + 0.1 * (FLOOR + 0.5))


def test_in_the_air_a_cell_blocks_by_itself(states):
    states[(*AT, 9)] = OCCUPIED
    costmap = air(StateArray(states))
    assert named(costmap, *AT, 9).state == "occupied"
    states[(*AT, 9)] = UNKNOWN
    assert named(air(StateArray(states)), *AT, 9).state == "unknown"


def test_a_widened_cell_names_the_one_that_it_is_widened_from(states):
    states[(*AT, 6)] = OCCUPIED
    costmap = ground(StateArray(states))
    costmap.update(0.0, widening=(3, 0))
    found = named(costmap, AT[0] + 3, AT[1])
    assert (found.state, found.centre[0]) == ("occupied", pytest.approx(1.05))
    assert named(costmap, 1, 2).state == "outside"
    assert HIGH[0] > found.centre[0]


def test_a_cell_near_an_object_of_a_class_says_so():
    voxel_map, layer = seen(3, sweeps=4)
    plain = Costmap(CostmapConfig(), voxel_map, *BOX, "air", 0.1, height=0.2, step_height=0.0)
    margined = ClassMargins(voxel_map, layer, {1: 0.3})
    costmap = Costmap(CostmapConfig(), margined, *BOX, "air", 0.1, height=0.2, step_height=0.0)
    grown = np.argwhere((costmap.state == OCCUPIED) & (plain.state != OCCUPIED))
    assert len(grown)
    assert named(costmap, *grown[0]).state == "class margin"
    as_seen = np.argwhere(plain.state == OCCUPIED)[0]
    found = named(costmap, *as_seen)
    assert found.state == "occupied"
    centre = np.array(found.centre)
    assert (states_in(voxel_map, centre - 0.02, centre + 0.02) == OCCUPIED).all()
