"""`python -m tests.tools.soak SOAK --count N`: 0 if nothing broke.

Progress is a line each, for episodes one JSON document; the last line is the summary, in JSON.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Any

import msgspec

from tests.tools.soak.cases import Fuzzed
from tests.tools.soak.episodes import TIME_LIMIT_S, Tally, soak_episodes
from tests.tools.soak.estimators import Repeated, soak_estimators
from tests.tools.soak.fuzz import soak_fuzz
from tests.tools.soak.hostile import Refused, soak_hostile
from tests.tools.soak.imports import soak_imports
from tests.tools.soak.interface import Compared, soak_interface
from tests.tools.soak.kill import Killed, soak_kill
from tests.tools.soak.processors import Processors, soak_processors
from tests.tools.soak.race import Raced, soak_race
from tests.tools.soak.recordings import soak_recordings
from tests.tools.soak.stacks import Replayed, soak_stacks
from tests.tools.soak.studies import Disturbed, soak_studies
from tests.tools.soak.worlds import Drawn, soak_worlds

SOAKS: dict[
    str,
    Callable[
        ...,
        Killed
        | Fuzzed
        | Tally
        | Drawn
        | Disturbed
        | Processors
        | Raced
        | Refused
        | Replayed
        | Compared
        | Repeated,
    ],
] = {
    "kill": soak_kill,
    "fuzz": soak_fuzz,
    "imports": soak_imports,
    "episodes": soak_episodes,
    "worlds": soak_worlds,
    "studies": soak_studies,
    "processors": soak_processors,
    "race": soak_race,
    "hostile": soak_hostile,
    "recordings": soak_recordings,
    "stacks": soak_stacks,
    "interface": soak_interface,
    "estimators": soak_estimators,
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
    parser.add_argument(
        "--time-limit", type=float, default=TIME_LIMIT_S, help="for episodes: simulated time, s"
    )
    parser.add_argument(
        "--wide", action="store_true", help="for episodes: vary settings of any section"
    )
    parser.add_argument(
        "--python",
        action="append",
        default=[],
        help="for processors: another interpreter to replay with",
    )
    parser.add_argument(
        "--log",
        action="append",
        type=Path,
        default=[],
        help="for processors: a further log to replay",
    )
    parser.add_argument(
        "--compiled",
        action=argparse.BooleanOptionalAction,
        default=True,
        help="for processors: compile for one without extensions as well, which takes minutes",
    )
    options = parser.parse_args()

    def progress(text: str) -> None:
        print(text, flush=True)

    chosen = SOAKS[options.soak]
    more: dict[str, Any] = {}
    if chosen in (soak_episodes, soak_processors):
        more["jobs"] = options.jobs
    if chosen is soak_episodes:
        more |= {"time_limit_s": options.time_limit, "wide": options.wide}
    if chosen is soak_processors:
        more |= {"pythons": options.python, "given": options.log, "compiled": options.compiled}
    findings = chosen(options.count, options.seed, progress, options.first, **more)
    print(msgspec.json.encode(asdict(findings)).decode())
    return 1 if findings.failures else 0


if __name__ == "__main__":
    sys.exit(main())
