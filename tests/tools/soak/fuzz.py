"""Fuzzing of logs, settings and scenes: each must be refused in a line, or read."""

from __future__ import annotations

import contextlib
import os
import sys
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np

from tests.tools.small_log import COMMITTED
from tests.tools.soak.cases import Report, judge_case, judged, limit_memory
from tests.tools.soak.child import scratch
from tests.tools.soak.mutate import forge, mutate, mutate_values
from wayproof.harness.bench.table import Progress
from wayproof.harness.config_document import from_json, to_json
from wayproof.harness.errors import InputError
from wayproof.harness.log.reader import Log, open_log
from wayproof.harness.log.recover import recover
from wayproof.harness.recompute.rebuild import rebuild
from wayproof.harness.replay.replay import replay
from wayproof.harness.stack.build import build_navigator

KINDS = ("bytes", "forged", "settings", "scene")


def soak_fuzz(count: int, seed: int, progress: Progress, first: int = 0) -> SimpleNamespace:
    """Mutate a small log `count` times: its bytes, content, settings and scene in turn."""
    with tempfile.TemporaryDirectory(dir=scratch()) as name:
        folder = Path(name)
        source = folder / "source.mcap"
        source.write_bytes(COMMITTED.read_bytes())
        replay(source)
        log = open_log(source)

        def case(kind: str, rng: np.random.Generator) -> None:
            run_case(kind, source, log, rng)

        return watched(
            case, KINDS, folder, numbers=range(first, first + count), seed=seed, progress=progress
        )


def watched(
    run: Callable[[str, np.random.Generator], None],
    kinds: Sequence[str],
    folder: Path,
    numbers: range,
    seed: int,
    progress: Progress,
    may_start: str = "",
) -> SimpleNamespace:
    """Run cases in children with limits on time, memory and the files that they touch."""
    (folder / "work").mkdir()
    work = partial(_cases, run, kinds, folder, seed, may_start)
    found = judged(work, kinds, numbers, name="fuzz", progress=progress)
    written = [f"file {one} written" for one in os.listdir(folder / "work")]
    found.failures += written
    return found


def _cases(
    run: Callable[[str, np.random.Generator], None],
    kinds: Sequence[str],
    folder: Path,
    seed: int,
    may_start: str,
    numbers: range,
    report: Report,
) -> None:
    """Run cases in this child process."""
    os.chdir(folder / "work")
    limit_memory()
    _watch_files(folder, report, may_start)
    for case in numbers:
        report(f"begin {case}")
        kind, rng = kinds[case % len(kinds)], np.random.default_rng((seed, case))
        judge_case(case, kind, partial(run, kind, rng), report)


def run_case(kind: str, source: Path, log: Log, rng: np.random.Generator) -> None:
    """Mutate and read once."""
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
            with contextlib.suppress(InputError):  # it may be whole
                recover(path, path.with_name("recovered.mcap"))
        replay(path)


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
