"""`python -m tests.tools.faults PART --count N`: faults that are planted, and the causes found.

`rooms` are small rooms whose robot cannot reach its goal; `worlds` are episodes of the registered
worlds that reach their goal until one thing is changed; `stacks` are broken stacks on trial. The
last line counts the right causes; the exit code is 1 if fewer than 95 % are or anything broke.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path

from rich.console import Console
from rich.table import Table

from tests.tools.faults import breaks, failures, fault_scenarios, on_trial
from tests.tools.faults.judged import Judged
from tests.tools.soak.child import scratch
from wayproof.harness.attribution.finding import CAUSES

PARTS = {
    "rooms": fault_scenarios.FAULTS,
    "worlds": breaks.KINDS,
    "stacks": on_trial.KINDS,
}
"""Part -> its kinds of faults."""


def judge(part: str, kind: str, count: int, first: int, checked: bool) -> Iterator[Judged]:
    """Yield the episodes of one kind of fault."""
    with tempfile.TemporaryDirectory(dir=scratch()) as folder:
        if part == "worlds":
            yield from failures.judge_kind(kind, count, first, Path(folder), checked)
        elif part == "stacks":
            yield from on_trial.judge_kind(kind, count, first, Path(folder))
        else:
            for seed in range(first, first + count):
                yield fault_scenarios.judge_planted(kind, seed, Path(folder) / "planted.mcap")


def table(every: Sequence[Judged]) -> Table:
    """Return a table with planted faults as rows and causes found as columns."""
    counts = Counter((one.planted, one.found) for one in every)
    others = sorted({one.found for one in every} - set(CAUSES))
    found = [name for name in (*CAUSES, *others) if any(name == one.found for one in every)]
    lines = Table("planted", *(name.replace("_", "\n") for name in found))
    for planted in dict.fromkeys(one.planted for one in every):
        lines.add_row(planted, *(str(counts[planted, name] or ".") for name in found))
    return lines


def main() -> int:
    """Run the episodes and print the table."""
    parser = argparse.ArgumentParser(prog="python -m tests.tools.faults", description=__doc__)
    parser.add_argument("part", choices=PARTS)
    parser.add_argument("--count", type=int, default=5, help="episodes of each kind")
    parser.add_argument("--first", type=int, default=None, help="seed of the first one")
    parser.add_argument("--kind", action="append", help="of this kind only")
    parser.add_argument("--half", type=int, choices=(0, 1), help="even seeds or odd ones only")
    parser.add_argument("--check", action="store_true", help="of worlds: count the checks")
    options = parser.parse_args()
    if unknown := set(options.kind or ()) - PARTS[options.part].keys():
        parser.error(f"--kind: got {min(unknown)}, expected {', '.join(PARTS[options.part])}")
    console = Console(width=150, markup=False, highlight=False)
    first = options.first
    if first is None:
        first = failures.FIRST_SEED if options.part == "worlds" else 0
    every = []
    for kind in options.kind or PARTS[options.part]:
        for one in judge(options.part, kind, options.count, first, options.check):
            if options.half in (None, one.seed % 2):
                every.append(one)
                console.print(one.line(), soft_wrap=True)
    console.print(table(every))
    right = sum(one.right for one in every)
    troubled = sum(bool(one.troubles) for one in every)
    console.print(f"{right} of {len(every)} causes right; {troubled} with troubles")
    return 1 if troubled or right < 0.95 * len(every) else 0


if __name__ == "__main__":
    sys.exit(main())
