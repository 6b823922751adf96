"""Where compiled kernels are kept: in a folder named by the sources of all of them.

Numba keeps a kernel until its own file changes, and keeps the old code of a callee, and the
old value of a constant, from another file. With another folder for each state of the sources, no
kernel is ever out of date. Numba knows a kernel by the folder of its file, too; ours are known by
their module, so that every checkout and every environment of the same sources finds them.
"""

from __future__ import annotations

import contextlib
import functools
import hashlib
import os
import re
import sys
import time

PACKAGES = ("harness", "maps", "models", "planners")

COMPILER = "kernel_compiler"
"""Module beside the packages that every file with kernels imports."""

OURS = re.compile(
    rb"^(?:from|import) wayproof\.([\w.]+)(?: import (?:\(([\w,\s]+)\)|([\w, ]+)))?", re.MULTILINE
)
"""What a file imports of ours."""

COMPILING = "compiling kernels (a minute the first time, then cached)"

KEPT_S = 14 * 24 * 3600.0
"""Caches that no process has used for so long are deleted, s."""


def use_kernel_cache() -> None:
    """Name numba's cache folder for this process and its children, unless it is named already.

    Where it cannot be written, numba caches beside the sources, by their own times alone.
    """
    if "NUMBA_CACHE_DIR" in os.environ:
        return
    caches = os.environ.get("XDG_CACHE_HOME") or os.path.join(os.path.expanduser("~"), ".cache")
    folder = os.path.join(caches, "wayproof", f"kernels-{kernel_digest(os.path.dirname(__file__))}")
    os.environ["NUMBA_CACHE_DIR"] = folder
    if "numba" in sys.modules:  # it has read its environment
        sys.modules["numba"].config.CACHE_DIR = folder
    with contextlib.suppress(OSError):  # numba then takes its own place
        if not os.path.isdir(folder):
            os.makedirs(folder, exist_ok=True)
            delete_unused(os.path.dirname(folder))
        os.utime(folder)


@functools.cache
def can_write(folder: str) -> bool:
    """Return whether a folder is there, or can be made, and takes files."""
    import tempfile  # numba has loaded it

    try:
        os.makedirs(folder, exist_ok=True)
        tempfile.TemporaryFile(dir=folder).close()
    except OSError:
        return False
    return True


def cache_of(module: str) -> str:
    """Return the folder with the compiled kernels of one of our modules."""
    digest = kernel_digest(os.path.dirname(__file__))
    package = module.rpartition(".")[0]
    return os.path.join(os.environ["NUMBA_CACHE_DIR"], f"{digest}-{package}")


_missed: list[str] = []
"""Modules of the kernels that were not in the cache of this process."""


def any_missed() -> bool:
    """Return whether this process has compiled a kernel of ours, or is about to."""
    return bool(_missed)


def note_missed(module: str) -> None:
    """Note that a kernel of a module has to be compiled; of the first, say so on stderr."""
    if not _missed:
        print(f"wayproof: {COMPILING}", file=sys.stderr, flush=True)
    _missed.append(module)


@functools.cache
def kernel_digest(root: str) -> str:
    """Hash of every file with kernels in the packages of a folder, and of all that these import."""
    sources = _sources(root)
    mark = f"{COMPILER} import".encode()
    taken = {path for path, text in sources.items() if mark in text}
    left = list(taken)
    while left:
        imported = (_imported(sources[left.pop()]) & sources.keys()) - taken
        taken |= imported
        left += imported
    digest = hashlib.blake2b(digest_size=8)
    for path in sorted(taken):
        digest.update(f"{path} {len(sources[path])}\n".encode())
        digest.update(sources[path])
    return digest.hexdigest()


def _sources(root: str) -> dict[str, bytes]:
    """Text of the compiler and of every module of the packages, by its path without the ending."""
    with open(f"{root}/{COMPILER}.py", "rb", buffering=0) as source:
        found = {COMPILER: source.read()}
    folders = list(PACKAGES)
    while folders:
        folder = folders.pop()
        for entry in os.scandir(f"{root}/{folder}"):
            if entry.name.endswith(".py"):
                with open(entry.path, "rb", buffering=0) as source:
                    found[f"{folder}/{entry.name[:-3]}"] = source.read()
            elif entry.name != "__pycache__" and entry.is_dir():
                folders.append(f"{folder}/{entry.name}")
    return found


def _imported(text: bytes) -> set[str]:
    """Paths of the modules that a module may import: each name may be one of its own."""
    paths = set()
    for module, several, names in OURS.findall(text):
        path = module.decode().replace(".", "/")
        paths |= {path, f"{path}/__init__"}
        paths |= {f"{path}/{name.strip()}" for name in (several or names).decode().split(",")}
    return paths


def delete_unused(caches: str) -> None:
    """Delete the caches of other sources that no process has used of late."""
    import shutil

    oldest = time.time() - KEPT_S
    for entry in os.scandir(caches):
        if entry.name.startswith("kernels-") and entry.stat().st_mtime < oldest:
            shutil.rmtree(entry.path, ignore_errors=True)
