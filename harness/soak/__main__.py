"""`python -m harness.soak kill|fuzz|episodes|studies --count N`: exit code 0 if nothing broke."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from dataclasses import asdict

import msgspec

from harness.soak.episodes import Tally, soak_episodes
from harness.soak.fuzz import Fuzzed, soak_fuzz
from harness.soak.kill import Killed, soak_kill
from harness.soak.studies import Disturbed, soak_studies

SOAKS: dict[str, Callable[..., Killed | Fuzzed | Tally | Disturbed]] = {
    "kill": soak_kill,
    "fuzz": soak_fuzz,
    "episodes": soak_episodes,
    "studies": soak_studies,
}
"""Name on the command line -> what it runs; each takes a count and a seed."""


def main() -> int:
    """Run one soak and print what it found as one JSON document."""
    parser = argparse.ArgumentParser(prog="python -m harness.soak", description=__doc__)
    parser.add_argument("soak", choices=SOAKS)
    parser.add_argument("--count", type=int, default=100)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()

    def progress(text: str) -> None:
        print(text, file=sys.stderr)

    findings = SOAKS[options.soak](options.count, options.seed, progress)
    print(msgspec.json.format(msgspec.json.encode(asdict(findings)), indent=1).decode())
    return 1 if findings.failures else 0


if __name__ == "__main__":
    sys.exit(main())
