"""`python -m tests.tools.soak SOAK --count N`: 0 if nothing broke.

Progress is a line each, for episodes one JSON document; the last line is the summary, in JSON.
"""

from __future__ import annotations

import argparse
import sys
from functools import partial

import msgspec

from tests.tools.soak.episodes import soak_episodes
from tests.tools.soak.fuzz import soak_fuzz
from tests.tools.soak.hostile import soak_hostile
from tests.tools.soak.imports import soak_imports
from tests.tools.soak.kill import soak_kill
from tests.tools.soak.processors import soak_processors
from tests.tools.soak.recordings import soak_recordings
from tests.tools.soak.worlds import soak_worlds

SOAKS = {
    "kill": soak_kill,
    "fuzz": soak_fuzz,
    "imports": soak_imports,
    "episodes": soak_episodes,
    "worlds": soak_worlds,
    "processors": soak_processors,
    "hostile": soak_hostile,
    "recordings": soak_recordings,
}
"""Name on the command line -> function of (count, seed, progress, number of the first)."""


def main() -> int:
    """Run one soak and print its results as one JSON document."""
    parser = argparse.ArgumentParser(prog="python -m tests.tools.soak", description=__doc__)
    parser.add_argument("soak", choices=SOAKS)
    parser.add_argument("--count", type=int, default=100)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--from", dest="first", type=int, default=0, help="number of the first")
    parser.add_argument("--jobs", type=int, default=2, help="episodes at once")
    options = parser.parse_args()
    more = {"jobs": options.jobs} if options.soak in ("episodes", "processors") else {}
    progress = partial(print, flush=True)
    found = SOAKS[options.soak](options.count, options.seed, progress, options.first, **more)
    print(msgspec.json.encode(vars(found)).decode())
    return 1 if found.failures else 0


if __name__ == "__main__":
    sys.exit(main())
