"""Fuzzing of logs, settings and scenes: each must be refused in a line, or read."""

from __future__ import annotations

import os
import resource
import signal
import sys
import tempfile
import traceback
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from wayproof.harness.bench.maintain.small_log import COMMITTED, committed_name
from wayproof.harness.bench.soak.child import in_child, scratch
from wayproof.harness.bench.soak.mutate import forge, mutate, mutate_values
from wayproof.harness.bench.table import Progress
from wayproof.harness.config import from_json, to_json
from wayproof.harness.errors import InputError
from wayproof.harness.log.reader import Log, open_log
from wayproof.harness.log.recover import recover
from wayproof.harness.recompute.rebuild import rebuild
from wayproof.harness.replay.replay import replay
from wayproof.harness.stack.build import build_navigator

LONGEST_S = 5
"""Processor time limit of one case, s."""

SILENCE_S = 60.0
"""Wall time limit of one case on a loaded machine, s."""

MOST_MEMORY_MIB = 1024.0

BATCH = 250
"""Number of cases in one child process."""

KINDS = ("bytes", "forged", "settings", "scene")


@dataclass(frozen=True)
class Fuzzed:
    """Results of mutated input.

    Attributes:
        count: Number of cases.
        refused: Kind -> number of cases refused in a line.
        read: Kind -> number of cases that were read.
        peak_mib: Greatest resident memory of a child, MiB.
        failures: Tracebacks, hangs, crashes, excess memory, files touched elsewhere.
    """

    count: int
    refused: dict[str, int]
    read: dict[str, int]
    peak_mib: float
    failures: tuple[str, ...]


def soak_fuzz(count: int, seed: int, progress: Progress, first: int = 0) -> Fuzzed:
    """Mutate a small log `count` times: its bytes, content, settings and scene in turn.

    Args:
        count: Number of cases.
        seed: Seed of all random choices.
        progress: Called with a line about the progress.
        first: Number of the first case.
    """
    with tempfile.TemporaryDirectory(dir=scratch()) as name:
        folder = Path(name)
        source = folder / "source.mcap"
        source.write_bytes((COMMITTED / committed_name()).read_bytes())
        replay(source)
        log = open_log(source)

        def case(kind: str, rng: np.random.Generator) -> None:
            run_case(kind, source, log, rng)

        return watched(case, KINDS, folder, range(first, first + count), seed, progress)


def watched(
    run: Callable[[str, np.random.Generator], None],
    kinds: Sequence[str],
    folder: Path,
    numbers: range,
    seed: int,
    progress: Progress,
    may_start: str = "",
) -> Fuzzed:
    """Run cases in children with limits on time, memory and the files that they touch.

    Args:
        run: Run one case of a kind, in `work` in the folder; an InputError refuses it.
        kinds: Taken in turn.
        folder: Cases may write below it.
        numbers: Of the cases.
        seed: Seed of all random choices.
        progress: Called with a line about the progress.
        may_start: Program that a case may start.
    """
    tally: Counter[tuple[str, str]] = Counter()
    failures: list[str] = []
    peak = 0.0
    (folder / "work").mkdir()
    case, last_case = numbers.start, numbers.stop
    while case < last_case:
        batch = range(case, min(case + BATCH, last_case))
        work = partial(_cases, run, kinds, folder, seed, batch, may_start)
        ended = in_child(work, SILENCE_S)
        peak = max(peak, ended.peak_mib)
        last = case
        for line in ended.lines:
            verdict, _, rest = line.partition(" ")
            if verdict in ("refused", "read"):
                tally[verdict, rest] += 1
            elif verdict == "begin":
                last = int(rest)
            else:
                failures.append(line)
        if ended.code < 0 or ended.overdue:
            failures.append(f"case {last}: ended by signal {-ended.code} (26 is a hang)")
        case = batch.stop if ended.code >= 0 else last + 1
        progress(f"fuzz: up to {case}, {len(failures)} failures, {peak:.0f} MiB")
    failures += [f"file {one} written" for one in os.listdir(folder / "work")]
    if peak > MOST_MEMORY_MIB:
        failures.append(f"memory: {peak:.0f} MiB")
    refused = {kind: tally["refused", kind] for kind in kinds}
    read = {kind: tally["read", kind] for kind in kinds}
    return Fuzzed(len(numbers), refused, read, peak, tuple(failures))


def _cases(
    run: Callable[[str, np.random.Generator], None],
    kinds: Sequence[str],
    folder: Path,
    seed: int,
    numbers: range,
    may_start: str,
    report: Callable[[str], None],
) -> None:
    """Run cases in this child process."""
    os.chdir(folder / "work")
    limit_memory()
    _watch_files(folder, report, may_start)
    for case in numbers:
        report(f"begin {case}")
        signal.setitimer(signal.ITIMER_VIRTUAL, LONGEST_S)  # its default is to end the process
        kind = kinds[case % len(kinds)]
        rng = np.random.default_rng((seed, case))
        try:
            run(kind, rng)
            report(f"read {kind}")
        except InputError as error:
            lines = str(error).count("\n")
            report(f"refused {kind}" if lines == 0 else f"case {case}: {lines + 1} lines")
        except Exception:
            text = " | ".join(traceback.format_exc().splitlines()[-6:])
            report(f"case {case} {kind}: traceback: {text}")
        signal.setitimer(signal.ITIMER_VIRTUAL, 0)


def run_case(kind: str, source: Path, log: Log, rng: np.random.Generator) -> None:
    """Mutate and read once.

    Raises:
        InputError: The mutated input is refused, as it should be.
    """
    if kind == "settings":
        config = from_json(mutate_values(to_json(log.config).decode(), rng).encode())
        build_navigator(config, log.mission, log.beams)
        return
    if kind == "scene":
        rebuild(replace(log, scene=mutate_values(log.scene, rng)))
        return
    with tempfile.TemporaryDirectory(dir=source.parent) as name:
        path = Path(name) / "mutated.mcap"
        path.write_bytes(mutate(source.read_bytes(), rng) if kind == "bytes" else b"")
        if kind == "forged":
            forge(source, path, rng)
        else:
            recover(path)
        replay(path)


def limit_memory() -> None:
    """Limit the address space to the present one and the memory of a case."""
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    most = pages * resource.getpagesize() + int(MOST_MEMORY_MIB * 2**20)
    resource.setrlimit(resource.RLIMIT_AS, (most, most))


def _watch_files(folder: Path, report: Callable[[str], None], may_start: str) -> None:
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
