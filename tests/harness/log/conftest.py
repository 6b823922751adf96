"""Small committed log that the tests of logs share, and files with damaged content."""

import pytest

from tests.tools.small_log import COMMITTED


@pytest.fixture(scope="module")
def source():
    return COMMITTED


def damaged(tmp_path, data):
    """Write a log of these bytes."""
    path = tmp_path / "damaged.mcap"
    path.write_bytes(data)
    return path
