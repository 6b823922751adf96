import numpy as np
import pytest

from tests.planners import worlds
from wayproof.planners import FreeSpace


@pytest.fixture(scope="session")
def maze() -> FreeSpace:
    return worlds.make_maze()


@pytest.fixture(scope="session")
def boxes() -> FreeSpace:
    return worlds.make_boxes()


@pytest.fixture(scope="session")
def room() -> FreeSpace:
    return worlds.make_room()


@pytest.fixture(scope="session")
def bend() -> FreeSpace:
    """A lane 0.9 m wide that bends by a right angle over a chamfer; the body's disc needs 1.1 m."""
    blocked = np.ones((60, 60, 1), dtype=bool)
    blocked[5:40, 10:19] = False
    blocked[31:40, 10:55] = False
    for k in range(8):
        blocked[23 + k : 32, 19 + k] = False
    return worlds.long_space(blocked)


@pytest.fixture(scope="session")
def gap() -> FreeSpace:
    """A wall of 1 m with a gap of 0.9 m: the disc about the body, of 1 m across, does not fit."""
    blocked = np.zeros((80, 60, 1), dtype=bool)
    blocked[35:45] = True
    blocked[35:45, 26:35] = False
    return worlds.long_space(blocked)
