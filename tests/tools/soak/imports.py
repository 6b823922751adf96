"""Broken files of every imported format, each read in a watched process or refused in a line."""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path
from types import SimpleNamespace

import numpy as np

from tests.tools.soak.cases import watched
from tests.tools.soak.child import scratch
from tests.tools.soak.fuzz import mutate, mutate_values
from tests.tools.soak.import_sources import SOURCES
from wayproof.harness.bench.table import Progress
from wayproof.harness.errors import InputError
from wayproof.models.world_files import ImportOptions, WorldFileError
from wayproof.models.world_files.importer import import_world

TEXTS = (".world", ".urdf", ".dae", ".gltf", ".obj", ".yaml")
"""Endings of the files whose numbers and strings are exchanged, besides bytes."""


def soak_imports(count: int, seed: int, progress: Progress, first: int = 0) -> SimpleNamespace:
    """Break small sound files of all formats in turn, and import them."""
    with tempfile.TemporaryDirectory(dir=scratch()) as name:
        folder = Path(name)

        def case(kind: str, rng: np.random.Generator) -> None:
            run_case(kind, folder, rng)

        for kind in SOURCES:  # libraries are loaded before anything is watched
            import_whole(kind, folder)
        numbers = range(first, first + count)
        kinds = tuple(SOURCES)
        return watched(case, kinds, folder, numbers, seed, progress, may_start=sys.executable)


def import_whole(kind: str, folder: Path) -> list[str]:
    """Import the sound file of a format; return the notes."""
    with tempfile.TemporaryDirectory(dir=folder) as inner:
        files = SOURCES[kind]()
        for name, data in files.items():
            (Path(inner) / name).write_bytes(data)
        return import_world(Path(inner) / next(iter(files)), _options(kind), *_ENDS)[1]


def run_case(kind: str, folder: Path, rng: np.random.Generator) -> None:
    """Break one of the files of a format and import."""
    files = SOURCES[kind]()
    chosen = list(files)[int(rng.integers(len(files)))]
    if chosen.endswith(TEXTS) and rng.integers(2):
        files[chosen] = mutate_values(files[chosen].decode(), rng).encode()
    else:
        files[chosen] = mutate(files[chosen], rng)
    with tempfile.TemporaryDirectory(dir=folder) as inner:
        for name, data in files.items():
            (Path(inner) / name).write_bytes(data)
        ends = _ENDS if rng.integers(2) else (None, None)
        try:
            import_world(Path(inner) / next(iter(files)), _options(kind), *ends)
        except WorldFileError as error:
            raise InputError(str(error)) from None


def _options(kind: str) -> ImportOptions:
    """Return the options of a format: the first cell of an OctoMap's space is far below 0."""
    return ImportOptions(floor=-3276.8 if kind in ("bt", "ot") else None)


_ENDS = ((0.0, 0.0, 0.0), (4.0, 0.0, 0.0))
