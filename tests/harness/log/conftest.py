"""Small committed log that the tests of logs share."""

import pytest

from tests.tools.small_log import COMMITTED


@pytest.fixture(scope="module")
def source():
    return COMMITTED
