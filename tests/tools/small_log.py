"""The smallest useful log: half a second in an empty world.

One of each format version is committed with the tests, which open it, and replay that of the
current version. After a change of decisions `python -m tests.tools.small_log`
writes that one and its packed form again; with a file name it writes one log there.
"""

from __future__ import annotations

import sys
from pathlib import Path

from wayproof.harness.config import Config
from wayproof.harness.config_document import override
from wayproof.harness.log.copy import thin
from wayproof.harness.log.writer import FORMAT_VERSION
from wayproof.harness.runner import run_episode
from wayproof.harness.scenario.scenario import build
from wayproof.harness.warm_up import warm_up

COMMITTED = Path(__file__).resolve().parents[1] / "harness" / "logs"


def small_log(path: Path) -> Path:
    """Write a log of half a second in an empty world."""
    settings = ("episode.time_limit=0.5",)
    config = override(Config("empty", "quadruped", 0), settings)
    warm_up(config)
    run_episode(build(config), path)
    return path


def committed_name(version: str = FORMAT_VERSION, packed: bool = False) -> str:
    """Return the name of the committed log of a format version, by default the current one."""
    return f"format-{version}-packed.mcap" if packed else f"format-{version}.mcap"


def write_committed() -> None:
    """Write the log of the current format version and its packed form."""
    full = small_log(COMMITTED / committed_name())
    packed = full.with_name(committed_name(packed=True))
    packed.write_bytes(full.read_bytes())
    thin(packed)


if __name__ == "__main__":
    if len(sys.argv) > 1:
        print(small_log(Path(sys.argv[1])))
    else:
        write_committed()
