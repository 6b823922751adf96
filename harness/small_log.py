"""A log as small as they come; `python -m harness.small_log FILE` writes it.

One of each format version is committed with the tests, which open and replay it. When a change of
this version decides otherwise, that of the current version is written anew.
"""

from __future__ import annotations

import sys
from pathlib import Path

from harness.config import Config, override
from harness.episode import run_episode
from harness.log import FORMAT_VERSION
from harness.scenario import build
from harness.warm_up import warm_up

COMMITTED = Path(__file__).parents[1] / "tests" / "harness" / "logs"


def small_log(path: Path) -> Path:
    """A log of half a second in an empty world."""
    settings = ("episode.time_limit=0.5",)
    config = override(Config("empty", "quadruped", 0), settings)
    warm_up(config)
    run_episode(build(config), path)
    return path


def committed_name() -> str:
    """Name of the committed log of the current format version."""
    return f"format-{FORMAT_VERSION}.mcap"


if __name__ == "__main__":
    print(small_log(Path(sys.argv[1]) if len(sys.argv) > 1 else COMMITTED / committed_name()))
