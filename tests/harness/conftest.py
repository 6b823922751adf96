"""Real episodes, recorded once for all tests that read logs, whichever worker they run in."""

import hashlib
import pickle

import pytest

from tests.sharing import alone
from wayproof.harness.config import Config, override
from wayproof.harness.runner import run_episode
from wayproof.harness.scenario.scenario import build


@pytest.fixture(scope="session")
def once(common):
    """Have a log made for a key by the first that asks for it; what the making told, for all."""

    def made(key, make):
        path = common / hashlib.sha256(repr(key).encode()).hexdigest()[:16]
        with alone(path.with_suffix(".lock")):
            if not path.exists():
                path.write_bytes(pickle.dumps(make(path.with_suffix(".mcap"))))
        return pickle.loads(path.read_bytes())

    return made


@pytest.fixture(scope="session")
def recorded(once):
    """Record an episode of given world, robot, seed and settings; each combination once."""

    def record(world, robot, seed, *settings):
        config = override(Config(world, robot, seed), settings)
        return once((world, robot, seed, settings), lambda log: run_episode(build(config), log))

    return record
