"""Sampling of placed grids on the lattice of a map."""

import math

import numpy as np
import pytest

from wayproof.harness.geometry import least_box
from wayproof.harness.prior.grid import UNTURNED, Grid, Placement, resampled
from wayproof.maps import FREE, OCCUPIED, UNKNOWN
from wayproof.maps.columns import Window

WINDOW = Window(0.1, (-10, -5, -3), (40, 30, 20))


def random_states(shape, seed=0):
    choices = np.array([UNKNOWN, FREE, OCCUPIED], np.uint8)
    return np.random.default_rng(seed).choice(choices, shape)


def test_cells_of_the_same_lattice_are_taken_as_they_are():
    states = random_states(WINDOW.shape)
    grid = Grid(states, WINDOW.origin, 0.1)
    np.testing.assert_array_equal(resampled(grid, UNTURNED, WINDOW), states)
    moved = resampled(grid, Placement(0.3, -0.2, 0.1, 0.0), WINDOW)
    np.testing.assert_array_equal(moved[3:, :-2, 1:], states[:-3, 2:, :-1])
    assert (moved[:3] == UNKNOWN).all()


def test_a_quarter_turn_turns_the_cells():
    states = random_states((6, 4, 5))
    turned = resampled(
        Grid(states, np.array([0.0, 0.0, -0.075]), 0.1),
        Placement(1.0, 0.0, 0.0, 0.5 * math.pi),
        WINDOW,
    )
    # x of the grid runs along y, and y against x, from x = 1 m.
    for i, j, k in np.ndindex(states.shape):
        assert turned[20 - 1 - j, 5 + i, 3 + k] == states[i, j, k]


def test_an_occupied_cell_of_a_finer_map_is_not_lost_and_a_coarser_one_fills_its_cells():
    fine = np.full((8, 8, 8), FREE, np.uint8)
    fine[1, 2, 3] = OCCUPIED  # its centre is not that of a coarser cell
    found = resampled(Grid(fine, np.zeros(3), 0.025), UNTURNED, WINDOW)
    assert np.argwhere(found == OCCUPIED).tolist() == [[10, 5, 3 + 1]]
    coarse = np.full((2, 2, 2), UNKNOWN, np.uint8)
    coarse[0, 1, 0] = OCCUPIED
    found = resampled(Grid(coarse, np.array([0.0, 0.0, -0.075]), 0.4), UNTURNED, WINDOW)
    assert np.count_nonzero(found == OCCUPIED) == 64
    assert (found[10:14, 9:13, 3:7] == OCCUPIED).all()


def test_a_flat_map_stands_on_the_floor_up_to_its_height():
    states = np.full((5, 4, 1), FREE, np.uint8)
    states[2, 1], states[3] = OCCUPIED, UNKNOWN
    grid = Grid(states, np.array([0.2, 0.1, 0.0]), 0.1, height=0.5)
    found = resampled(grid, UNTURNED, WINDOW)
    floor = 3
    assert (found[:, :, :floor] == UNKNOWN).all()
    assert (found[12, 6, floor], found[12, 6, floor + 1]) == (OCCUPIED, FREE)
    assert (found[14, 7, floor : floor + 6] == OCCUPIED).all()
    assert (found[14, 7, floor + 6 :] == UNKNOWN).all()
    assert (found[15, 6:10] == UNKNOWN).all()


def test_placements_follow_each_other():
    """A quarter turn takes (1, 3) to (-3, 1), and a shift by (5, 2) that to (2, 3)."""
    first, then = Placement(1.0, 3.0, 0.2, 0.3), Placement(5.0, 2.0, 0.1, 0.5 * math.pi)
    both = then.after(first)
    assert (both.x, both.y, both.z, both.yaw) == pytest.approx((2.0, 3.0, 0.3, 0.3 + 0.5 * math.pi))


def test_a_cell_is_what_holds_its_centre():
    """Of a grid with five cells to an edge it is the third one along each axis, wherever it is."""
    window = Window(0.1, (2, 3, 1), (4, 3, 2))
    fine = np.random.default_rng(1).choice(np.array([UNKNOWN, FREE], np.uint8), (20, 15, 10))
    found = resampled(Grid(fine, np.zeros(3), 0.02), Placement(0.2, 0.3, 0.025, 0.0), window)
    np.testing.assert_array_equal(found, fine[2::5, 2::5, 2::5])


def test_the_known_box_is_the_least_one():
    states = np.zeros((5, 6, 7), np.uint8)
    assert states[least_box(states != 0)].shape == (1, 1, 1)
    states[1, 2, 3] = states[3, 2, 5] = FREE
    assert least_box(states != 0) == (slice(1, 4), slice(2, 3), slice(3, 6))
