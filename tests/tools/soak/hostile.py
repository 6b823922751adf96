"""Time and memory that each command takes to refuse a hostile file.

Run by `python -m tests.tools.soak hostile`.
"""

from __future__ import annotations

import contextlib
import importlib
import io
import os
import resource
import tempfile
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

from tests.tools.soak.child import Ended, in_child, scratch
from tests.tools.soak.hostile_files import BOX, FILES, Maker
from tests.tools.soak.hostile_logs import LOGS
from wayproof.harness.bench.table import Progress
from wayproof.harness.cli.main import main

MOST_MEMORY_MIB = 1024.0
LONGEST_S = 5.0
"""Processor time limit in a process that has loaded the program, s."""

ADDRESS_SPACE = 8 * 2**30
"""Additional address space of a command, bytes, so that a failure does not fill the machine."""

CPU_S = 20
WALL_S = 300.0

LOADED = (
    "wayproof.harness.replay.verify",
    "wayproof.harness.explain",
    "wayproof.harness.study.report.report",
    "wayproof.harness.cli.metrics",
    "wayproof.models.world_files",
    "trimesh",
)
"""Modules that commands load lazily, loaded beforehand so that they do not count."""

PLAIN = "<mujoco><worldbody>" + BOX + "<geom size='.1' pos='-5 -5 1'/></worldbody></mujoco>"


def soak_hostile(count: int, seed: int, progress: Progress, first: int = 0) -> SimpleNamespace:
    """Give each hostile file to the command that reads it, in a watched process."""
    del seed
    chosen = list({**FILES, **LOGS}.items())[first : first + count]
    for name in LOADED:
        importlib.import_module(name)
    loaded = _take(_harmless_command)
    assert loaded.code == 0, loaded.lines
    taken, failures = [], []
    for name, make in chosen:
        found = _take(make)
        taken.append(found)
        failures += [f"{name}: {wrong}" for wrong in breaches(found)]
        progress(f"{name}: {found}")
    longest = max((one.cpu_s for one in taken), default=0.0)
    peak = max((one.peak_mib for one in taken), default=0.0)
    return SimpleNamespace(count=len(chosen), longest_s=longest, peak_mib=peak, failures=failures)


def _harmless_command(folder: Path) -> list[str]:
    (folder / "plain.xml").write_text(PLAIN)
    return ["import", str(folder / "plain.xml"), "--out", str(folder / "out.xml")]


def breaches(ended: Ended) -> list[str]:
    """Return the limits that a command broke; empty without any."""
    wrong = []
    if ended.cpu_s > LONGEST_S:
        wrong.append(f"{ended.cpu_s:.1f} s")
    if ended.peak_mib > MOST_MEMORY_MIB:
        wrong.append(f"{ended.peak_mib:.0f} MiB")
    if ended.code != 2 or len(ended.lines) != 1:
        last = "".join(ended.lines[-1:])[:200]
        wrong.append(f"exit code {ended.code} with {len(ended.lines)} lines, the last: {last}")
    return wrong


def _take(make: Maker) -> Ended:
    with tempfile.TemporaryDirectory(dir=scratch()) as given, tempfile.TemporaryDirectory() as own:
        arguments = make(Path(given))
        return in_child(lambda report: _run(arguments, Path(own), report), WALL_S)


def _run(arguments: list[str], folder: Path, report: Callable[[str], None]) -> None:
    """Run a command line in this child process, and report its stderr line by line."""
    os.chdir(folder)
    mapped = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (mapped + ADDRESS_SPACE, mapped + ADDRESS_SPACE))
    resource.setrlimit(resource.RLIMIT_CPU, (CPU_S, CPU_S))
    with tempfile.TemporaryFile("w+") as said:
        os.dup2(said.fileno(), 2)  # a library writes to the descriptor itself
        with (
            contextlib.redirect_stdout(io.StringIO()),
            contextlib.redirect_stderr(
                io.TextIOWrapper(os.fdopen(2, "wb", 0, closefd=False), write_through=True)
            ),
        ):
            code = main(arguments)
        said.seek(0)
        for line in said.read().splitlines():
            report(line)
    os._exit(code)
