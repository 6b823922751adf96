"""Fuzzing of logs, settings and scenes: each must be refused in a line, or read."""

from __future__ import annotations

import contextlib
import tempfile
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np

from tests.tools.small_log import COMMITTED
from tests.tools.soak.cases import watched
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

        return watched(case, KINDS, folder, range(first, first + count), seed, progress)


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
