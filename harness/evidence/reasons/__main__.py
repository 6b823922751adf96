"""How often decisions have which action, label and reason, and how often the reason is false.

`python -m harness.evidence.reasons LOG...` checks each reason against the map of its decision.
"""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from pathlib import Path

from rich.console import Console
from rich.table import Table

from harness.errors import InputError
from harness.evidence.audit import audit
from harness.logs.reader import open_log

Row = tuple[str, str, str]


def tally(paths: list[Path]) -> tuple[Counter[Row], Counter[Row]]:
    """Decisions by action, label and kind of reason: all of them, and those with a false one.

    Args:
        paths: Logs with their sweeps. Of a log of before format 5 the kind is empty, and nothing is
            checked.

    Raises:
        InputError: One is no finished log.
    """
    counts: Counter[Row] = Counter()
    false: Counter[Row] = Counter()
    for path in paths:
        log = open_log(path)
        rows = {one.sequence: (one.action, one.label, one.grounds.kind) for one in log.decisions()}
        counts.update(rows.values())
        if not log.not_compared:
            broken = {one.sequence for one in audit(path).violations if one.rule == "reason"}
            false.update(rows[sequence] for sequence in broken)
    return counts, false


def main() -> int:
    """Print the table; 1 if a reason is false."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("log", nargs="+", type=Path)
    try:
        counts, false = tally(parser.parse_args().log)
    except InputError as error:
        print(f"wayproof: {error}", file=sys.stderr)
        return 2
    table = Table("action", "label", "reason", "decisions", "false")
    for row, count in counts.most_common():
        table.add_row(*row, str(count), str(false[row]))
    Console().print(table)
    return 1 if false else 0


if __name__ == "__main__":
    sys.exit(main())
