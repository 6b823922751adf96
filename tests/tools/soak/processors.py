"""Soak of replays on emulated processors.

Results depend on a processor through the choices of libraries: OpenBLAS chooses kernels, the C
library and numpy choose variants of functions, numba chooses instructions. Environment variables
make each of them choose as on another processor.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from types import SimpleNamespace

import msgspec
import numpy as np

from tests.tools.soak.child import scratch
from tests.tools.soak.kinds import draw
from tests.tools.soak.replays import Arithmetic, Verdict, arithmetic
from wayproof.harness.bench.table import Progress
from wayproof.harness.runner import run_episode
from wayproof.harness.warm_up import warm_up
from wayproof.harness.worker_pool import WorkerPool

ROOT = Path(__file__).resolve().parents[3]
AVX_512 = "X86_V4"
EXTENSIONS = (
    *("AVX", "AVX2", "FMA", "FMA4", "AVX512F", "AVX512VL", "AVX512BW", "AVX512DQ"),
    *("AVX2_Usable", "FMA_Usable", "FMA4_Usable"),  # as older C libraries call them
)
PLAIN_LIBRARY = "glibc.cpu.hwcaps=" + ",".join(f"-{name}" for name in EXTENSIONS)
BLAS_CORES = {
    "Prescott": ("Prescott", "Katmai"),
    "Haswell": ("Haswell",),
    "Zen": ("Zen", "Haswell"),
    "SkylakeX": ("SkylakeX",),
}
"""Requested kernels of OpenBLAS -> names that it may report: a build may lack some."""


@dataclass(frozen=True)
class Emulation:
    """Emulation of another processor in a child process."""

    name: str
    environment: dict[str, str]
    shows: Callable[[Arithmetic, Arithmetic], bool]
    refused: str = ""


@dataclass
class Emulated:
    """Results of replays under one emulation."""

    replays: int = 0
    identical: int = 0
    decisions: int = 0
    arithmetic: Arithmetic | None = None
    skipped: str = ""


def emulations(caches: Path, compiled: bool = True) -> list[Emulation]:
    """Return all emulations that this processor allows, and this processor itself."""
    found = np.show_config(mode="dicts")["SIMD Extensions"].get("found", [])
    lacking = "" if AVX_512 in found else "OpenBLAS's kernels for it need AVX-512"
    made = [
        Emulation("as it is", {}, lambda child, own: child == own),
        Emulation(
            "C library without FMA and AVX",
            {"GLIBC_TUNABLES": PLAIN_LIBRARY},
            lambda child, own: child.library != own.library,
        ),
        Emulation(
            "numpy at its baseline",
            {"NPY_DISABLE_CPU_FEATURES": " ".join(found)},
            lambda child, own: not child.vectors and bool(own.vectors),
            refused="" if found else "numpy uses its baseline alone here",
        ),
    ]
    made += [_blas(core, lacking if core == "SkylakeX" else "") for core in BLAS_CORES]
    if compiled:
        generic = {"NUMBA_CPU_NAME": "generic", "NUMBA_CPU_FEATURES": ""}
        generic["NUMBA_CACHE_DIR"] = str(caches / "generic")
        made.insert(
            0, Emulation("numba generic", generic, lambda child, own: child.compiler == "generic")
        )
    return made


def _blas(core: str, refused: str) -> Emulation:
    environment = {"OPENBLAS_CORETYPE": core}
    names = BLAS_CORES[core]
    return Emulation(
        f"OpenBLAS {core}", environment, lambda child, own: child.blas in names, refused=refused
    )


def soak_processors(
    count: int,
    seed: int,
    progress: Progress,
    first: int = 0,
    jobs: int = 2,
) -> SimpleNamespace:
    """Record short episodes of every kind and replay each on every emulated processor."""
    found = SimpleNamespace(count=count, kinds={}, emulations={}, failures=[])
    with tempfile.TemporaryDirectory(dir=scratch()) as name:
        folder = Path(name)
        recorded = _record_all(range(first, first + count), seed, folder, jobs)
        found.kinds = dict(Counter(kind for kind, _ in recorded))
        logs = [path for _, path in recorded]
        progress(f"recorded {count} logs of {len(found.kinds)} kinds")
        own = arithmetic()

        def replayed(emulation: Emulation) -> list[str]:
            result = found.emulations[emulation.name] = Emulated(skipped=emulation.refused)
            failures = [] if emulation.refused else replay_all(emulation, logs, own, result)
            progress(f"{emulation.name}: {result.identical} of {result.replays} {result.skipped}")
            return failures

        chosen = emulations(folder)
        with ThreadPoolExecutor(jobs) as pool:
            found.failures = [*chain.from_iterable(pool.map(replayed, chosen))]
    return found


def replay_all(
    emulation: Emulation, logs: Sequence[Path], own: Arithmetic, result: Emulated
) -> list[str]:
    """Replay all logs under one emulation, in one child process; return the failures."""
    paths = os.pathsep.join(filter(None, (str(ROOT / "src"), os.environ.get("PYTHONPATH", ""))))
    done = subprocess.run(
        [sys.executable, "-m", "tests.tools.soak.replays"],
        input="".join(f"{log}\n" for log in logs),
        env={**os.environ, "PYTHONPATH": paths, **emulation.environment},
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    first, *lines = done.stdout.splitlines() or [""]
    if done.returncode or not first:
        return [f"{emulation.name}: exit code {done.returncode}: {done.stderr[-2000:]}"]
    result.arithmetic = msgspec.json.decode(first, type=Arithmetic)
    verdicts = [msgspec.json.decode(line, type=Verdict) for line in lines]
    failures = []
    if not emulation.shows(result.arithmetic, own):
        failures.append(f"{emulation.name}: not in effect: {result.arithmetic}")
    if len(verdicts) != len(logs):
        failures.append(f"{emulation.name}: {len(verdicts)} of {len(logs)} logs replayed")
    result.replays = len(verdicts)
    result.identical = sum(not verdict.differs for verdict in verdicts)
    result.decisions = sum(verdict.decisions for verdict in verdicts)
    wrong = [verdict for verdict in verdicts if verdict.differs]
    return failures + [f"{emulation.name}: {one.log}: {one.differs}" for one in wrong]


def _record_all(numbers: range, seed: int, folder: Path, jobs: int) -> list[tuple[str, Path]]:
    with WorkerPool(jobs) as pool:
        return list(pool.run_in_order(record, [(number, seed, folder) for number in numbers]))


def record(number: int, seed: int, folder: Path) -> tuple[str, Path]:
    """Record the episode of a number; return its kind and its log."""
    drawn = draw(number, seed)
    config = drawn.scenario.config
    warm_up(config)
    path = folder / f"{number}-{drawn.kind}-{config.world}-{config.robot}-{config.seed}.mcap"
    run_episode(drawn.scenario, path)
    return drawn.kind, path
