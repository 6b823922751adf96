import pytest

from planners import FreeSpace
from tests.planners import worlds


@pytest.fixture(scope="session")
def maze() -> FreeSpace:
    return worlds.make_maze()


@pytest.fixture(scope="session")
def boxes() -> FreeSpace:
    return worlds.make_boxes()


@pytest.fixture(scope="session")
def room() -> FreeSpace:
    return worlds.make_room()
