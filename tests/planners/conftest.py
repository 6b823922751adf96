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
