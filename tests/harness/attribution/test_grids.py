"""Widest ways through grids."""

from dataclasses import replace

import numpy as np
import pytest

from wayproof.harness.attribution.grids import Passage, clearances, distances_from


def test_grids_know_the_widest_way():
    walls = np.zeros((20, 11), bool)
    walls[10] = True
    walls[10, 3:8] = False  # five cells: 0.3 m from the middle one's centre to the walls' cells
    gaps = clearances(walls, 0.1)
    assert gaps[10, 5] == pytest.approx(0.3)
    way = Passage((4, 5), (16, 5), 0)
    assert way.leads(gaps > 0.29)
    assert not way.leads(gaps > 0.31)
    assert way.widest(gaps) == pytest.approx(0.3, abs=0.01)


def bent(width):
    """Cells of 0.1 m: a corridor of a width, m, with a bend of a right angle, between walls."""
    cells, free = round(width / 0.1), np.zeros((60, 60, 1), np.bool_)
    free[5:55, 5 : 5 + cells] = True
    free[55 - cells : 55, 5:55] = True
    return free


@pytest.mark.parametrize(("width", "passes"), [(1.2, False), (2.4, True)])
def test_a_long_body_has_to_turn_where_a_disc_gets_round(width, passes):
    """Discs of 0.3 m radius, the outer ones 0.9 m from the middle, in a bend."""
    distances = clearances(~bent(width), 0.1)
    start, goal = (12, 5 + round(width / 0.2), 0), (54 - round(width / 0.2), 45, 0)
    offsets = (-0.9, -0.45, 0.0, 0.45, 0.9)
    disc, long = Passage(start, goal, 2, 0.1), Passage(start, goal, 2, 0.1, offsets)
    assert disc.leads(distances > 0.3)
    assert long.leads(distances > 0.3) == passes
    room = long.widest(distances)
    assert (room > 0.3) == passes
    assert room <= disc.widest(distances)


def test_a_straight_corridor_lets_a_long_body_through_either_way():
    free = np.zeros((60, 12, 1), np.bool_)
    free[2:58, 2:10] = True
    distances = clearances(~free, 0.1)
    offsets = (-0.9, -0.45, 0.0, 0.45, 0.9)
    for start, goal in (((15, 6, 0), (44, 6, 0)), ((44, 6, 0), (15, 6, 0))):
        way = Passage(start, goal, 1, 0.1, offsets)
        assert way.leads(distances > 0.3)
        assert not way.leads(distances > 0.45)


def test_cells_that_share_a_corner_alone_are_connected_for_no_planner():
    free = np.zeros((12, 12, 1), np.bool_)
    free[1:6, 1:6] = free[6:11, 6:11] = True
    way = Passage((3, 3, 0), (8, 8, 0), 0)
    sides = replace(way, corners=False)
    assert way.leads(free)
    assert not sides.leads(free)
    free[6, 5] = True
    assert sides.leads(free)


def test_ways_are_as_long_as_their_cells():
    rng = np.random.default_rng(0)
    free = rng.random((9, 7, 3)) < 0.7
    free[0, 0, 0] = True
    lengths = distances_from(free, (0, 0, 0), 0, 0.1)
    assert lengths[0, 0, 0] == 0.0
    assert (lengths[~free] == np.inf).all()
    twice = distances_from(free, (0, 0, 0), 0, 0.2)
    assert np.allclose(twice[free], 2.0 * lengths[free])
