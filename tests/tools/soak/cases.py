"""Numbered cases in watched children; one that ends its child is a failure, and the next goes on.

A child reports `begin N`, then a line of the verdict on case N: `refused` or `read` with a name, as
it should be, or anything else.
"""

from __future__ import annotations

import resource
import signal
import traceback
from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path
from types import SimpleNamespace

from tests.tools.soak.child import in_child
from wayproof.harness.bench.table import Progress
from wayproof.harness.errors import InputError

BATCH = 100
"""Number of cases of a child."""

SILENCE_S = 60.0
"""Wall time limit of one case on a loaded machine, s."""

LONGEST_S = 5.0
"""Processor time limit of one case, in user mode, s."""

MOST_MEMORY_MIB = 1024.0
"""Memory that a case may take, MiB."""

Report = Callable[[str], None]


def judged(
    work: Callable[[range, Report], None],
    kinds: Sequence[str],
    numbers: range,
    name: str,
    progress: Progress,
) -> SimpleNamespace:
    """Run cases in children, batch by batch."""
    found = Counter[tuple[str, str]]()
    failures: list[str] = []
    peak = longest = 0.0
    case = numbers.start
    while case < numbers.stop:
        batch = range(case, min(case + BATCH, numbers.stop))
        ended = in_child(lambda report: work(batch, report), SILENCE_S)  # noqa: B023
        peak, last = max(peak, ended.peak_mib), case
        for line in ended.lines:
            verdict, _, rest = line.partition(" ")
            if verdict in ("refused", "read"):
                kind, _, took = rest.rpartition(" ")
                found[verdict, kind] += 1
                longest = max(longest, float(took))
            elif verdict == "begin":
                last = int(rest)
            else:
                failures.append(line)
        if ended.code < 0 or ended.overdue:
            failures.append(f"case {last}: ended by signal {-ended.code} (26 is a hang)")
        case = batch.stop if ended.code >= 0 else last + 1
        progress(f"{name}: up to {case}, {len(failures)} failures, {peak:.0f} MiB")
    if peak > MOST_MEMORY_MIB:
        failures.append(f"memory: {peak:.0f} MiB")
    refused, read = ({kind: found[one, kind] for kind in kinds} for one in ("refused", "read"))
    return SimpleNamespace(
        count=len(numbers),
        refused=refused,
        read=read,
        peak_mib=peak,
        longest_s=longest,
        failures=failures,
    )


def judge_case(number: int, kind: str, read: Callable[[], None], report: Report) -> None:
    """Read the failures of a case, within its processor time, and report the verdict."""
    signal.setitimer(signal.ITIMER_VIRTUAL, LONGEST_S)  # its default is to end the process
    try:
        read()
        verdict = f"read {kind}"
    except InputError as error:
        lines = 1 + str(error).count("\n")
        verdict = f"refused {kind}" if lines == 1 else f"case {number} {kind}: {lines} lines"
    except Exception:
        text = " | ".join(traceback.format_exc().splitlines()[-6:])
        verdict = f"case {number} {kind}: traceback: {text}"
    left, _ = signal.setitimer(signal.ITIMER_VIRTUAL, 0)
    report(f"{verdict} {LONGEST_S - left:.2f}")


def limit_memory() -> None:
    """Limit the address space to the present one and the memory of a case."""
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    most = pages * resource.getpagesize() + int(MOST_MEMORY_MIB * 2**20)
    resource.setrlimit(resource.RLIMIT_AS, (most, most))
