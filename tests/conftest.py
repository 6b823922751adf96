import gc
import os

import pytest


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
