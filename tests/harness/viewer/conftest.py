"""Logs that the tests of the viewers share."""

from pathlib import Path

import pytest


@pytest.fixture(scope="module")
def log(recorded):
    return Path(recorded("empty", "drone", 1).log)


@pytest.fixture(scope="module")
def failed(recorded):
    return Path(recorded("empty", "drone", 1, "episode.time_limit=1").log)
