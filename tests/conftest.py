"""What all tests share: a folder, and real episodes that are recorded once for all workers."""

import gc
import hashlib
import os
import pickle
from collections import Counter
from pathlib import Path

import pytest

from tests.sharing import alone


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items):
    """Leave the cases of a test beyond its `few(N)` to `make test-all`."""
    taken = Counter()
    for item in items:
        few = item.get_closest_marker("few")
        if few is not None:
            taken[item.function] += 1
            if taken[item.function] > few.args[0]:
                item.add_marker(pytest.mark.large)


def pytest_collection_finish():
    """Spare the garbage collector the modules and tests, which stay until the end."""
    gc.collect()
    gc.freeze()


def pytest_sessionfinish():
    """Let modules be garbage at exit: OMPL's bindings warn of those that are frozen."""
    gc.unfreeze()


@pytest.fixture(scope="session")
def common(tmp_path_factory):
    """A folder that all workers of one run of the tests have in common."""
    base = tmp_path_factory.getbasetemp()
    folder = (base.parent if "PYTEST_XDIST_WORKER" in os.environ else base) / "common"
    folder.mkdir(exist_ok=True)
    return folder


@pytest.fixture(scope="session")
def once(common):
    """Make a log for a key once, by whichever worker comes first; return what `make` returned."""

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
    from wayproof.harness.config import Config
    from wayproof.harness.config_document import override
    from wayproof.harness.runner import run_episode
    from wayproof.harness.scenario.scenario import build

    def record(world, robot, seed, *settings):
        config = override(Config(world, robot, seed), settings)
        return once((world, robot, seed, settings), lambda log: run_episode(build(config), log))

    return record


@pytest.fixture(scope="session")
def planted(once):
    """Log and result of an episode with one planted fault, by cause and seed; each run once."""
    from tests.tools.faults.fault_scenarios import run_planted

    def run(cause, seed):
        result = once(("planted", cause, seed), lambda log: run_planted(cause, seed, log))
        return Path(result.log), result

    return run
