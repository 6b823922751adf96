"""Confusion matrix of planted causes and attributed ones.

`python -m tests.tools.faults.confusion` prints it.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from collections import Counter
from pathlib import Path

from rich.console import Console
from rich.table import Table

from tests.tools.faults.fault_scenarios import FAULTS, make_fault_scenario
from wayproof.harness.attribution.finding import CAUSES
from wayproof.harness.result import Result
from wayproof.harness.runner import run_episode

Matrix = Counter[tuple[str, str]]
"""Counts by planted cause and attributed cause."""


def confusion(causes: list[str], seeds: range, console: Console | None = None) -> Matrix:
    """Run every scenario and count the attributed causes."""
    counts: Matrix = Counter()
    with tempfile.TemporaryDirectory() as folder:
        for cause in causes:
            for seed in seeds:
                result = run_planted(cause, seed, Path(folder) / "planted.mcap")
                found = result.cause or result.outcome
                counts[cause, found] += 1
                if console is not None:
                    console.print(
                        f"{cause} {seed}: {found} ({result.outcome}, {result.sim_time_s:.1f} s): "
                        f"{result.cause_evidence}",
                        soft_wrap=True,
                    )
    return counts


def run_planted(cause: str, seed: int, path: Path) -> Result:
    """Run one scenario."""
    planted = make_fault_scenario(cause, seed)
    scenario, delays = planted.scenario, planted.delays
    return run_episode(scenario, path, delays=delays, record="full", stack=planted.stack)


def table(counts: Matrix) -> Table:
    """Return a table with planted causes as rows and attributed ones as columns."""
    found = [c for c in CAUSES if any(key[1] == c for key in counts)]
    found += sorted({key[1] for key in counts} - set(CAUSES))
    lines = Table("planted", *(name.replace("_", "\n") for name in found))
    for planted in dict.fromkeys(key[0] for key in counts):
        lines.add_row(planted, *(str(counts[planted, name] or ".") for name in found))
    return lines


def right(counts: Matrix) -> float:
    """Return the fraction of scenarios whose planted cause was attributed."""
    return sum(counts[cause, cause] for cause in CAUSES) / max(counts.total(), 1)


def main() -> None:
    """Run the scenarios and print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=20, help="scenarios of each cause")
    parser.add_argument("--first", type=int, default=0, help="seed of the first one")
    parser.add_argument("--cause", action="append", choices=list(FAULTS), help="of this cause only")
    options = parser.parse_args()
    console, began = Console(width=130, markup=False), time.process_time()
    seeds = range(options.first, options.first + options.count)
    counts = confusion(options.cause or list(FAULTS), seeds, console)
    console.print(table(counts))
    console.print(
        f"{right(counts):.1%} of {counts.total()} right, "
        f"{time.process_time() - began:.0f} s of processor time"
    )


if __name__ == "__main__":
    main()
