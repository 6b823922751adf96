"""Counts of decisions by action, label and reason, and of false reasons.

`python -m tests.tools.reasons LOG...` checks each reason against the map of its
decision; a folder stands for all logs below it.
"""

from __future__ import annotations

import argparse
import re
import sys
from collections import Counter
from collections.abc import Iterable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

from rich.console import Console
from rich.table import Table

from wayproof.harness.errors import InputError
from wayproof.harness.log.reader import open_log
from wayproof.harness.replay.audit.motion import is_malformed
from wayproof.harness.replay.audit.run import moments
from wayproof.harness.replay.reasons import ReasonCheck
from wayproof.harness.schema import wayproof_pb2 as pb

Row = tuple[str, str, str]

NUMBER = re.compile(r"-?\d+(\.\d+)?")

SHOWN = 20
"""Maximum number of listed false reasons."""


@dataclass
class Tally:
    """Decisions by action, label and reason.

    Attributes:
        logs: Number of logs.
        checked: Number of checked reasons.
        decisions: Number of decisions of each row.
        false: Number of those with a false reason.
        texts: Descriptions of false reasons.
    """

    logs: int = 0
    checked: int = 0
    decisions: Counter[Row] = field(default_factory=Counter)
    false: Counter[Row] = field(default_factory=Counter)
    texts: list[str] = field(default_factory=list)

    def add(self, other: Tally) -> None:
        """Add the counts of another tally."""
        self.logs += other.logs
        self.checked += other.checked
        self.decisions += other.decisions
        self.false += other.false
        self.texts += other.texts


def tally(path: Path, check: bool = True) -> Tally:
    """Count the decisions of one log.

    Args:
        path: Log with its sweeps. Reasons of formats before 5, which are only sentences, are
            counted without their numbers and not checked.
        check: Whether to check each reason against the map of its decision.

    Raises:
        InputError: It is no finished log, or has no sweeps.
    """
    log, found = open_log(path), Tally(logs=1)
    if not check:
        found.decisions.update(map(_row, log.decisions()))
        return found
    reasons = ReasonCheck()
    for moment in moments(log):
        decision = moment.decision
        found.decisions[_row(decision)] += 1
        if is_malformed(moment):
            continue
        texts = reasons.check(decision, moment.map, moment.config, moment.mission)
        found.false[_row(decision)] += bool(texts)
        found.texts += [f"{path}: decision {decision.sequence}: {text}" for text in texts]
    found.checked = reasons.checked
    return found


def _row(decision: pb.Decision) -> Row:
    return decision.action, decision.label, decision.predicate.kind


def logs_of(paths: Iterable[Path]) -> list[Path]:
    """Return the given logs and those below the given folders.

    Raises:
        InputError: A folder has none.
    """
    found: list[Path] = []
    for path in paths:
        below = sorted(path.rglob("*.mcap")) if path.is_dir() else [path]
        if not below:
            raise InputError(f"folder '{path}': no log in it, expected *.mcap")
        found += below
    return found


def tally_all(paths: Iterable[Path], check: bool, workers: int) -> Tally:
    """Count the decisions of logs and folders of logs; see `tally` and `logs_of`."""
    total, logs = Tally(), logs_of(paths)
    count = partial(tally, check=check)
    if workers == 1:
        found = list(map(count, logs))
    else:
        with ProcessPoolExecutor(workers) as pool:
            found = list(pool.map(count, logs))
    for one in found:
        total.add(one)
    return total


def show(found: Tally, console: Console) -> None:
    """Print the table and the false reasons."""
    table = Table("action", "label", "reason", "decisions", "false")
    for row, count in sorted(found.decisions.items(), key=lambda item: (-item[1], item[0])):
        table.add_row(*row, str(count), str(found.false[row]))
    console.print(table)
    for text in found.texts[:SHOWN]:
        console.print(text, highlight=False, soft_wrap=True, markup=False)
    counts = found.logs, found.decisions.total(), found.checked, found.false.total()
    text = "{} logs, {} decisions: {} reasons checked, {} false".format(*counts)
    console.print(text, highlight=False)


def main(arguments: list[str] | None = None) -> int:
    """Print the table; return 1 if a reason is false."""
    program = "python -m tests.tools.reasons"
    parser = argparse.ArgumentParser(program, description=__doc__)
    parser.add_argument("log", nargs="+", type=Path, help="a log, or a folder of them")
    parser.add_argument("--no-check", action="store_true", help="only count")
    parser.add_argument("--workers", type=int, default=1, help="processes (default 1)")
    options = parser.parse_args(arguments)
    try:
        if options.workers < 1:
            raise InputError(f"--workers: got {options.workers}, expected 1 or more")
        found = tally_all(options.log, not options.no_check, options.workers)
    except InputError as error:
        print(f"wayproof: {error}", file=sys.stderr)
        return 2
    show(found, Console())
    return 1 if found.false.total() else 0


if __name__ == "__main__":
    sys.exit(main())
