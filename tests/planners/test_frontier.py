import numpy as np
import pytest

from wayproof.planners import FreeSpace, best_frontier

NOWHERE = np.empty((0, 3))


def space(free):
    """A flat space of 10 cm cells, free where given."""
    field = np.where(free, 100, 0).astype(np.uint16)[:, :, None]
    return FreeSpace(field, np.zeros(3), 0.1, 4, np.zeros(101))


def at(x, y):
    return np.array([0.1 * x + 0.05, 0.1 * y + 0.05, 0.05])


@pytest.fixture
def corridor():
    """Ten free cells in a row, then unknown ones up to a goal; all else is blocked."""
    admitted, passable = np.zeros((20, 5), bool), np.zeros((20, 5), bool)
    admitted[2:12, 2] = True
    passable[1:19, 2] = True
    return admitted, passable


def test_the_frontier_towards_the_goal_comes_first(corridor):
    chosen = best_frontier(*map(space, corridor), at(5, 2), at(18, 2), NOWHERE)
    np.testing.assert_allclose(chosen, at(11, 2))


def test_a_visited_frontier_leaves_the_other_end(corridor):
    visited = np.vstack([at(11, 2), np.full(3, np.inf)])
    chosen = best_frontier(*map(space, corridor), at(5, 2), at(18, 2), visited)
    np.testing.assert_allclose(chosen, at(2, 2))


def test_no_frontier_where_all_is_known_or_out_of_reach(corridor):
    admitted, passable = corridor
    assert best_frontier(space(admitted), space(admitted), at(5, 2), at(18, 2), NOWHERE) is None
    assert best_frontier(space(admitted), space(passable), at(0, 0), at(18, 2), NOWHERE) is None
    admitted[8, 2] = passable[8, 2] = False  # a wall: only the end on this side is in reach
    chosen = best_frontier(space(admitted), space(passable), at(5, 2), at(18, 2), NOWHERE)
    np.testing.assert_allclose(chosen, at(2, 2))
