"""Machine and software that a log is recorded with: processor, C library, packages, own code."""

from __future__ import annotations

import functools
import hashlib
import platform
from collections.abc import Mapping
from importlib import metadata
from pathlib import Path
from typing import NamedTuple

from wayproof.harness.decision import Difference

PACKAGES = ("mujoco", "numpy", "numba", "ompl", "ruckig", "mcap", "protobuf")
"""Packages whose versions a log records."""

CODE = "code"
"""Field of the metadata `run`: a hash of the source code that an episode follows from."""

KINDS = ("*.py", "*.onnx")
"""Files that decisions follow from: source code, and the policies of reference stacks."""

FOLDERS = ("harness", "maps", "models", "planners")

READ_ONLY = ("api", "bench", "cli", "explain", "lab", "map_files", "study", "tables", "viewer")
"""Folders of the harness from which nothing in a log follows: they read logs, or run many."""

ROOT = Path(__file__).parents[2]


@functools.cache
def installed_version(package: str) -> str:
    """Return the version of a package; the lookup lists all that is installed."""
    return metadata.version(package)


@functools.cache
def this_machine() -> Mapping[str, str]:
    """Return versions, processor and C library, as the metadata `run` records them."""
    from llvmlite import binding

    features = sorted(name for name, there in binding.get_host_cpu_features().items() if there)
    return {
        "wayproof": installed_version("wayproof"),
        CODE: code_digest(),
        "python": platform.python_version(),
        "machine": platform.machine(),
        "cpu": binding.get_host_cpu_name(),
        "cpu features": " ".join(features),
        "libc": " ".join(platform.libc_ver()),
        **{name: installed_version(name) for name in PACKAGES},
    }


@functools.cache
def code_digest() -> str:
    """Return 16 digits of the SHA-256 over the source files that decide, and their names."""
    digest = hashlib.sha256()
    files = [path for name in FOLDERS for kind in KINDS for path in (ROOT / name).rglob(kind)]
    for path in sorted(files):
        parts = path.relative_to(ROOT).parts
        if parts[0] == "harness" and parts[1] in READ_ONLY:
            continue
        data = path.read_bytes()
        digest.update(f"{'/'.join(parts)} {len(data)}\n".encode())
        digest.update(data)
    return digest.hexdigest()[:16]


class Program(NamedTuple):
    """A build of Wayproof.

    Attributes:
        version: Its version.
        code: Digest of its source code, as of `code_digest`.
    """

    version: str
    code: str


def other_program(run: Mapping[str, str]) -> Program | None:
    """Return the program that wrote a log with this metadata `run`; None if it is this one."""
    recorded = Program(run.get("wayproof", "unknown"), run.get(CODE, "unknown"))
    return None if recorded.code == code_digest() else recorded


def other_than_here(run: Mapping[str, str]) -> list[Difference]:
    """Return the fields of `run` that differ on this machine, or that it lacks."""
    return [
        Difference(name, run.get(name, "not recorded"), here)
        for name, here in this_machine().items()
        if run.get(name) != here
    ]
