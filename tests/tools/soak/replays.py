"""`python -m tests.tools.soak.replays`: replay all logs named on standard input.

The first line of the output is the arithmetic of this process; each other line is the verdict on a
log. The simulator is not loaded, so that any Python with the packages of a replay will do.
"""

from __future__ import annotations

import ctypes
import hashlib
import math
import platform
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import msgspec
import numba
import numpy as np

from wayproof.harness.errors import InputError
from wayproof.harness.replay.replay import Replay, replay

MAPPED = Path("/proc/self/maps")
CORE_NAMES = ("scipy_openblas_get_corename64_", "openblas_get_corename64_", "openblas_get_corename")
SAMPLES = 20_000
MOST_NAMED = 3


@dataclass(frozen=True)
class Arithmetic:
    """Arithmetic of a process, as far as it depends on the processor."""

    python: str
    numpy: str
    blas: str
    vectors: tuple[str, ...]
    compiler: str
    library: str
    products: str


@dataclass(frozen=True)
class Verdict:
    """Verdict on the replay of one log."""

    log: str
    decisions: int
    differs: str
    chain: str


def arithmetic() -> Arithmetic:
    """Return the arithmetic of this process."""
    vectors = np.show_config(mode="dicts")["SIMD Extensions"]
    rng = np.random.default_rng(0)
    values = rng.uniform(0.01, 20.0, SAMPLES).tolist()
    functions: tuple[Callable[[float], float], ...] = (math.sin, math.cos, math.exp, math.log)
    results = np.array([function(value) for value in values for function in functions])
    factors = rng.normal(size=(2, SAMPLES, 3))
    products = np.array([a @ b for a, b in zip(*factors, strict=True)])
    return Arithmetic(
        python=platform.python_version(),
        numpy=np.__version__,
        blas=_blas(),
        vectors=tuple(vectors.get("found", ())),
        compiler=str(getattr(numba.config, "CPU_NAME", None) or "host"),
        library=_digest(results),
        products=_digest(products),
    )


def _blas() -> str:
    """Return the name of the kernels of the loaded OpenBLAS, found by Linux's list of maps."""
    if not MAPPED.exists():
        return ""
    loaded = {line.split()[-1] for line in MAPPED.read_text().splitlines() if "openblas" in line}
    for library in map(ctypes.CDLL, sorted(loaded)):
        for name in CORE_NAMES:
            function = getattr(library, name, None)
            if function is not None:
                function.restype = ctypes.c_char_p
                return str(function().decode())
    return ""


def _digest(values: np.ndarray[tuple[int, ...], np.dtype[np.float64]]) -> str:
    return hashlib.blake2b(values.tobytes(), digest_size=8).hexdigest()


def judge(log: Path) -> Verdict:
    """Replay one log."""
    try:
        found = replay(log)
    except InputError as error:
        return Verdict(str(log), 0, str(error), "")
    return Verdict(str(log), found.decisions, differing(found), found.chain)


def differing(found: Replay) -> str:
    """Return the first values that differ in a replay; empty if it is identical."""
    if found.identical:
        return ""
    if found.first_difference is not None:
        place, values = f"decision {found.first_difference}", found.differences
    else:
        place, values = "result", found.contradictions
    named = [f"{one.field}: {one.recorded} -> {one.recomputed}" for one in values]
    return f"{place}: {'; '.join(named[:MOST_NAMED]) or 'chain'}"


def main() -> int:
    """Print the arithmetic, then replay the logs named on standard input."""
    print(msgspec.json.encode(arithmetic()).decode(), flush=True)
    for line in sys.stdin:
        print(msgspec.json.encode(judge(Path(line.rstrip("\n")))).decode(), flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
