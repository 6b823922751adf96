"""Real episodes, recorded once for all tests that read logs."""

from pathlib import Path

import pytest

from harness.config import Config, override
from harness.episode import run_episode
from harness.scenario import build


@pytest.fixture(scope="session")
def recorded(tmp_path_factory):
    """Record an episode of given world, robot, seed and settings; each combination once."""
    folder = tmp_path_factory.mktemp("logs")
    results = {}

    def record(world, robot, seed, *settings):
        key = (world, robot, seed, settings)
        if key not in results:
            config = override(Config(world, robot, seed), settings)
            path = Path(folder) / f"{len(results)}.mcap"
            results[key] = run_episode(build(config), path)
        return results[key]

    return record
