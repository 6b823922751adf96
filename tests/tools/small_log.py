"""The smallest useful log: half a second in an empty world.

It is committed with the tests, which replay it. After a change of decisions `python -m
tests.tools.small_log` writes it again; with a file name it writes one there.
"""

from __future__ import annotations

import sys
from pathlib import Path

from wayproof.harness.config import Config
from wayproof.harness.config_document import override
from wayproof.harness.runner import run_episode
from wayproof.harness.scenario.scenario import build
from wayproof.harness.warm_up import warm_up

COMMITTED = Path(__file__).resolve().parents[1] / "harness" / "logs" / "small.mcap"


def small_log(path: Path) -> Path:
    """Write a log of half a second in an empty world."""
    settings = ("episode.time_limit=0.5",)
    config = override(Config("empty", "quadruped", 0), settings)
    warm_up(config)
    run_episode(build(config), path)
    return path


if __name__ == "__main__":
    print(small_log(Path(sys.argv[1]) if len(sys.argv) > 1 else COMMITTED))
