"""Numbered cases in watched children; one that ends its child is a failure, and the next goes on.

A child reports `begin N`, then a line of the verdict on case N: `refused` or `read` with a name, as
it should be, or anything else.
"""

from __future__ import annotations

import os
import resource
import signal
import sys
import traceback
from collections import Counter
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np

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

Case = Callable[[str, np.random.Generator], None]
"""Function of the kind and a random generator that breaks something and reads it."""


def watched(
    case: Case,
    kinds: Sequence[str],
    folder: Path,
    numbers: range,
    seed: int,
    progress: Progress,
    may_start: str = "",
) -> SimpleNamespace:
    """Run cases in children with limits on time, memory and the files that they touch."""
    (folder / "work").mkdir()
    work = partial(_cases, case, kinds, folder, seed, may_start)
    found = Counter[tuple[str, str]]()
    failures: list[str] = []
    peak = longest = 0.0
    number = numbers.start
    while number < numbers.stop:
        batch = range(number, min(number + BATCH, numbers.stop))
        ended = in_child(partial(work, batch), SILENCE_S)
        peak, last = max(peak, ended.peak_mib), number
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
        number = batch.stop if ended.code >= 0 else last + 1
        progress(f"up to {number}, {len(failures)} failures, {peak:.0f} MiB")
    if peak > MOST_MEMORY_MIB:
        failures.append(f"memory: {peak:.0f} MiB")
    failures += [f"file {one} written" for one in os.listdir(folder / "work")]
    refused, read = ({kind: found[one, kind] for kind in kinds} for one in ("refused", "read"))
    return SimpleNamespace(
        count=len(numbers),
        refused=refused,
        read=read,
        peak_mib=peak,
        longest_s=longest,
        failures=failures,
    )


def _cases(
    case: Case,
    kinds: Sequence[str],
    folder: Path,
    seed: int,
    may_start: str,
    numbers: range,
    report: Report,
) -> None:
    """Run cases in this child process."""
    os.chdir(folder / "work")
    # The address space may grow by the memory of a case.
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    most = pages * resource.getpagesize() + int(MOST_MEMORY_MIB * 2**20)
    resource.setrlimit(resource.RLIMIT_AS, (most, most))
    _watch_files(folder, report, may_start)
    for number in numbers:
        report(f"begin {number}")
        kind, rng = kinds[number % len(kinds)], np.random.default_rng((seed, number))
        _judge(number, kind, partial(case, kind, rng), report)


def _judge(number: int, kind: str, read: Callable[[], None], report: Report) -> None:
    """Read what a case broke, within its processor time, and report the verdict."""
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


def _watch_files(folder: Path, report: Report, may_start: str) -> None:
    """Report every file that is opened, renamed or removed outside the allowed folders."""
    readable = [sys.prefix, sys.base_prefix, str(Path(__file__).resolve().parents[3])]
    writable = [str(folder), os.environ["NUMBA_CACHE_DIR"]]
    readable += writable

    def inside(path: Any, roots: list[str]) -> bool:
        if not isinstance(path, (str, bytes, os.PathLike)):
            return True  # a descriptor that is open already
        full = os.path.abspath(os.fsdecode(path))
        return any(full.startswith(root) for root in roots) or "__pycache__" in full

    def hook(event: str, arguments: tuple[Any, ...]) -> None:
        if event == "open":
            path, _, flags = arguments
            written = bool(flags & (os.O_WRONLY | os.O_RDWR | os.O_CREAT))
            if not inside(path, writable if written else readable):
                report(f"file {path!r} opened, flags {flags:o}")
        elif event in ("os.rename", "os.remove", "os.mkdir", "os.rmdir", "os.link", "os.symlink"):
            if not inside(arguments[0], writable):
                report(f"{event} of {arguments[0]!r}")
        elif event == "subprocess.Popen" and may_start and arguments[0] == may_start:
            return
        elif event in ("subprocess.Popen", "os.system", "os.exec", "socket.connect"):
            report(f"{event} {arguments!r}")

    sys.addaudithook(hook)
