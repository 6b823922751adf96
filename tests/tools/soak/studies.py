"""Soak of studies whose parent or workers are killed: finished, they must have the same chains."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from types import SimpleNamespace

import numpy as np

from wayproof.harness.bench.table import Progress
from wayproof.harness.study.file import read_study
from wayproof.harness.study.plan import plan_episodes
from wayproof.harness.study.store import Store
from wayproof.harness.study.study import read_rows

STUDY = """
name = "killed"
worlds = ["empty"]
robots = ["drone"]
seeds = {seeds}
[set]
"episode.time_limit" = 3
[axes]
"costmap.unknown_policy" = ["forbid", "allow"]
"""

SEEDS = 3
LONGEST_S = 600.0
"""Wall time limit of one run of the study on a loaded machine, s."""


def soak_studies(count: int, seed: int, progress: Progress, first: int = 0) -> SimpleNamespace:
    """Kill a worker and the parent in turn at random times, `count` times in all.

    Each study gets one kill, and is started again if its parent died; then its chains are compared.
    """
    rng = np.random.default_rng([seed, first])
    failures: list[str] = []
    done = {"worker": 0, "parent": 0}
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        file = folder / "study.toml"
        file.write_text(STUDY.format(seeds=SEEDS))
        began = time.monotonic()
        _run(file, folder / "whole")
        lasts = time.monotonic() - began
        expected = chains(file, folder / "whole")
        trial = 0
        while sum(done.values()) < count:
            out = folder / f"trial-{trial}"
            target = ("worker", "parent")[trial % 2]
            done[target] += _disturb(file, out, target, float(rng.uniform(0.05, 0.9)) * lasts)
            if target == "parent":
                _run(file, out)
            if chains(file, out) != expected:
                failures.append(f"trial {trial}: other chains than the undisturbed study")
            trial += 1
            progress(f"studies: {sum(done.values())} kills of {count}, {len(failures)} failures")
            if trial > 10 * count:
                failures.append(f"only {sum(done.values())} kills in {trial} studies")
                break
    return SimpleNamespace(count=count, **done, episodes=len(expected), failures=failures)


def chains(file: Path, out: Path) -> dict[str, str]:
    """Return the chain of each finished episode by its key."""
    planned = plan_episodes(read_study(str(file)))
    return {row.key: row.chain for row in read_rows(planned, Store(out))}


def _command(file: Path, out: Path) -> list[str]:
    command = [sys.executable, "-m", "wayproof", "study", str(file), "--jobs", "2"]
    return [*command, "--out", str(out), "--json"]


def _run(file: Path, out: Path) -> None:
    """Run or finish the study."""
    subprocess.run(_command(file, out), stdout=subprocess.DEVNULL, check=True, timeout=LONGEST_S)


def _disturb(file: Path, out: Path, target: str, after_s: float) -> bool:
    """Start the study and kill the parent or a worker after a while; return whether it lived."""
    process = subprocess.Popen(_command(file, out), stdout=subprocess.DEVNULL)
    time.sleep(after_s)
    killed = False
    victims = workers_of(process.pid) if target == "worker" else [process.pid]
    if process.poll() is None and victims:
        os.kill(victims[0], signal.SIGKILL)
        killed = True
    process.wait(LONGEST_S)
    _wait_for_workers(process.pid)
    return killed


def workers_of(parent: int) -> list[int]:
    """Return the worker processes of a study's process."""
    found = []
    for entry in Path("/proc").iterdir():
        if not entry.name.isdigit():
            continue
        try:
            above = int((entry / "stat").read_text().rsplit(")", 1)[1].split()[1])
            command = (entry / "cmdline").read_bytes()
        except OSError:
            continue
        if above == parent and b"spawn_main" in command:
            found.append(int(entry.name))
    return sorted(found)


def _wait_for_workers(parent: int) -> None:
    """Wait until no worker is left that could still write."""
    time.sleep(0.5)
    while workers_of(parent):
        time.sleep(0.1)
