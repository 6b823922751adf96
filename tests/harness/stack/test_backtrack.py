"""Breadcrumbs of the way travelled, and the path back along them."""

import numpy as np
import pytest

from tests.harness.stack.make_input import at_rest, make_input, make_states, place
from wayproof.harness.stack.manoeuvres.recovery import (
    BACKTRACK_LENGTH,
    backtrack_path,
    record_breadcrumb,
)
from wayproof.harness.stack.types import BehaviourConfig

CRUMBS = np.array([place(x, 2.05) for x in np.linspace(1.05, 3.05, 21)])
END = (3.05, 2.05)


def path_back(states=None, crumbs=CRUMBS, position=END, **state):
    """The path back of a robot at rest."""
    input = make_input(states, position=position)
    state = at_rest(position, breadcrumbs=crumbs, **state)
    return backtrack_path(input, state, state.trajectory.at(input.effect_ns))


def test_a_breadcrumb_is_dropped_at_each_spacing():
    state = at_rest()
    for x, count in ((1.0, 1), (1.09, 1), (1.11, 2), (1.2, 2), (1.22, 3)):
        state = record_breadcrumb(state, make_input(position=(x, 2.05)))
        assert len(state.trails.breadcrumbs) == count
    np.testing.assert_array_equal(state.trails.breadcrumbs[:, 0], [1.0, 1.11, 1.22])


def test_the_path_back_is_the_breadcrumbs_reversed_for_the_backtrack_length():
    path = path_back()
    np.testing.assert_array_equal(path[0], place(*END))
    assert (np.diff(path[:, 0]) < 0.0).all()
    assert path[-1, 0] == pytest.approx(END[0] - BACKTRACK_LENGTH)
    np.testing.assert_allclose(path[:, 1], 2.05)


def test_the_path_back_takes_the_latest_breadcrumbs_first_round_the_corners_of_the_way():
    across = np.array([place(3.05, y) for y in np.arange(2.15, 2.7, 0.1)])
    path = path_back(crumbs=np.vstack([CRUMBS, across]), position=(3.05, 2.75))
    np.testing.assert_allclose(path[:7, 0], 3.05)
    assert (np.diff(path[:7, 1]) < 0.0).all()
    np.testing.assert_allclose(path[-1], place(3.05 - 0.3, 2.05))  # 0.7 m back, 0.3 m aside


def test_the_path_back_ends_where_it_is_no_longer_traversable():
    path = path_back(make_states(occupied=[(1.9, 2.1, 0.0, 4.0)]))
    assert 2.4 <= path[-1, 0] < 2.5  # 0.3 m from the wall
    assert path_back(make_states(occupied=[(2.4, 2.6, 0.0, 4.0)])) is None  # less than 0.3 m


def test_there_is_no_path_back_without_breadcrumbs_or_after_the_last_backtrack():
    assert path_back(crumbs=np.empty((0, 3))) is None
    assert path_back(crumbs=CRUMBS[-1:]) is None
    most = BehaviourConfig().max_backtracks
    assert path_back(backtracks=most - 1) is not None
    assert path_back(backtracks=most) is None
