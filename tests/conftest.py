import os

import pytest


@pytest.fixture(scope="session")
def common(tmp_path_factory):
    """A folder that all workers of one run of the tests have in common."""
    base = tmp_path_factory.getbasetemp()
    folder = (base.parent if "PYTEST_XDIST_WORKER" in os.environ else base) / "common"
    folder.mkdir(exist_ok=True)
    return folder
