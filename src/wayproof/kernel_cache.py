"""Where compiled kernels are kept: in a folder named by the sources of all of them.

Numba keeps a kernel until its own file changes, and goes on with the old code of a callee, and the
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
from typing import Any

PACKAGES = ("harness", "maps", "models", "planners")

DECORATOR = b"_jit import"
"""In every file with kernels."""

OURS = re.compile(
    rb"^(?:from|import) wayproof\.([\w.]+)(?: import (?:\(([\w,\s]+)\)|([\w, ]+)))?", re.MULTILINE
)
"""What a file imports of ours."""

OURS_PREFIX = "wayproof."
"""Start of the names of our modules."""

ALWAYS_USED = "wayproof.maps.kernels.beams"
"""Every episode runs kernels of this package."""

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
def share_between_checkouts() -> None:
    """Let numba keep our kernels by their module and the digest of the sources.

    The digest counts even in a folder that the user or another checkout has named.
    """
    from numba.core import caching

    implementation: Any = caching.CacheImpl
    named: Any = caching.UserProvidedCacheLocator

    class ByModule(named):  # type: ignore[misc]
        """Where the kernels of one of our modules are."""

        def __init__(self, kernel: Any, source: str) -> None:
            super().__init__(kernel, source)
            self._cache_path = cache_of(kernel.__module__)

        @classmethod
        def from_function(cls, kernel: Any, source: str) -> Any:
            ours = kernel.__module__.startswith(OURS_PREFIX)
            return super().from_function(kernel, source) if ours else None

    implementation._locator_classes = [ByModule, *implementation._locator_classes]


def cache_of(module: str) -> str:
    """Return the folder with the compiled kernels of one of our modules."""
    digest = kernel_digest(os.path.dirname(__file__))
    package = module.rpartition(".")[0]
    return os.path.join(os.environ["NUMBA_CACHE_DIR"], f"{package}-{digest}")


def any_cached() -> bool:
    """Return whether any kernel of these sources has been compiled and kept."""
    try:
        return any(name.endswith(".nbi") for name in os.listdir(cache_of(ALWAYS_USED)))
    except FileNotFoundError:
        return False


def load_without_compiler() -> None:
    """Let numba load our kernels from its cache without what only a compiler needs, scipy among it.

    Numba imports and registers its implementation of the language before it looks into the cache,
    in every process again. It does so before it compiles, too, so a kernel that is not in the cache
    finds all of it. Kernels of others are loaded as numba does: a ufunc needs all of it.
    """
    from numba.core.caching import Cache
    from numba.core.runtime.nrt import rtsys

    load_with_compiler: Any = Cache.load_overload

    def load_overload(self: Any, sig: Any, target_context: Any) -> Any:
        if not self._py_func.__module__.startswith(OURS_PREFIX):
            return load_with_compiler(self, sig, target_context)
        rtsys.initialize(target_context)  # what compiled code allocates arrays with
        with self._guard_against_spurious_io_errors():
            return self._load_overload(sig, target_context)

    cache: Any = Cache
    cache.load_overload = load_overload
    _parse_when_linked()
    _name_modules_of_numba()


def _parse_when_linked() -> None:
    """Parse the intermediate code of a cached kernel when one is compiled that calls it.

    Numba parses it when it loads the kernel, for the names of its symbols. Those that are looked up
    are in the symbol table of the machine code, too.
    """
    from llvmlite.binding import parse_bitcode
    from numba.core.codegen import CPUCodeLibrary, JitEngine

    library_class: Any = CPUCodeLibrary
    engine_class: Any = JitEngine
    unserialize = library_class._unserialize.__func__
    module_for_linking = library_class._get_module_for_linking
    is_symbol_defined = engine_class.is_symbol_defined
    loaded: list[bytes] = []

    def load(cls: Any, codegen: Any, state: Any) -> Any:
        name, kind, data = state
        if kind != "object":
            return unserialize(cls, codegen, state)
        library = codegen.create_library(name)
        library.enable_object_caching()
        library._set_compiled_object(data[0])
        library._finalize_final_module()
        library.unparsed = data[1]
        loaded.append(data[0])
        return library

    def parse(self: Any) -> Any:
        if self._shared_module is None and hasattr(self, "unparsed"):
            self._shared_module = parse_bitcode(self.unparsed)
        return module_for_linking(self)

    def is_defined(self: Any, name: str) -> bool:
        ended = name.encode() + b"\0"
        return is_symbol_defined(self, name) or any(ended in code for code in reversed(loaded))

    library_class._unserialize = classmethod(load)
    library_class._get_module_for_linking = parse
    engine_class.is_symbol_defined = is_defined


def _name_modules_of_numba() -> None:
    """Load functions of numba in a cached kernel without their modules, of which one imports scipy.

    Compiled code refers to an environment of constants and of a module; it uses the constants.
    """
    from numba.core import environment as numba_environment

    environment: Any = numba_environment
    rebuild = environment._rebuild_env

    @functools.wraps(rebuild)  # by whose name it is in the cache
    def rebuild_env(module: str, constants: Any, name: str) -> Any:
        known = environment.lookup_environment(name)
        if known is not None or not module.startswith("numba.") or module in sys.modules:
            return rebuild(module, constants, name)
        made = environment.Environment({"__name__": module})
        made.consts[:] = constants
        made.env_name = name
        environment.Environment._memo[name] = made
        return made

    environment._rebuild_env = rebuild_env


@functools.cache
def kernel_digest(root: str) -> str:
    """Hash of every file with kernels in the packages of a folder, and of all that these import."""
    sources = _sources(root)
    taken = {path for path, text in sources.items() if DECORATOR in text}
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
    """Text of every module of the packages, by its path without the ending."""
    found = {}
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
