"""How kernels are compiled, kept and loaded.

Numba makes a library of each kernel, with a door for Python, and optimises it together with all
that it calls; so what is called lowest is optimised again at every level above it, and most doors
are never used. Here a kernel that another calls is a part of that one's code, optimised with it.
"""

from __future__ import annotations

import functools
import inspect
import sys
from collections.abc import Callable
from typing import Any, TypeVar

import numba
from llvmlite.binding import parse_bitcode
from numba.core import compiler, config, environment, registry, sigutils, types, typing
from numba.core.caching import CompileResultCacheImpl, FunctionCache, _CacheLocator
from numba.core.codegen import CPUCodeLibrary, JITCodeLibrary, JitEngine
from numba.core.runtime.nrt import rtsys

from wayproof.kernel_cache import cache_of, can_write, note_missed

Function = TypeVar("Function", bound=Callable[..., Any])

OPTIONS: dict[str, Any] = {
    "nopython": True,
    "boundscheck": None,  # as the environment says
    # Divisions have no branch for zero. There is no `fastmath`: it would let the compiler reorder
    # arithmetic, and two machines could then build two maps.
    "error_model": "numpy",
    "nogil": True,
    "no_cfunc_wrapper": True,  # none is called from C
}

locator_class: Any = _CacheLocator
files_class: Any = CompileResultCacheImpl
cache_class: Any = FunctionCache
library_class: Any = JITCodeLibrary
dispatcher_class: Any = registry.CPUDispatcher
settings: Any = config
templates: Any = typing


def kernel(function: Function) -> Function:
    """Compile a kernel without counts of references to arrays.

    Each count is an atomic operation, two for every slice and every array handed on. So it makes no
    array, which does not compile, and returns none, nor gets one from a kernel that it calls.
    """
    return _compiled(function, _nrt=False)


def allocating(function: Function) -> Function:
    """Compile a kernel that makes or returns arrays.

    Without the option numba would count references as in the kernel that calls it first.
    """
    return _compiled(function, _nrt=True)


def inlined(function: Function) -> Function:
    """Compile a kernel into those that call it for each column or ray: a call costs nanoseconds."""
    return _compiled(function, _nrt=False, forceinline=True)


def _compiled(function: Function, **options: Any) -> Function:
    if settings.DISABLE_JIT:
        return function
    named: Any = function
    named.__signature__ = inspect.signature(function)  # else numba finds it out twice
    made: Function = Kernel(function, targetoptions={**OPTIONS, **options})
    return made


class ByModule(locator_class):  # type: ignore[misc]
    """Where the kernels of one of our modules are kept."""

    def __init__(self, function: Any) -> None:
        """Name the folder of a kernel."""
        self._line = function.__code__.co_firstlineno
        self._folder = cache_of(function.__module__)

    def get_cache_path(self) -> str:
        """Return the folder."""
        return self._folder

    def get_source_stamp(self) -> str:
        """Return no stamp of the source: the folder's name has the digest of all of them."""
        return ""

    def get_disambiguator(self) -> str:
        """Return what tells kernels of one name apart."""
        return str(self._line)

    def ensure_cache_path(self) -> None:
        """Make the folder.

        Raises:
            OSError: It takes no files.
        """
        if not can_write(self._folder):
            raise OSError(f"{self._folder}: no kernel can be kept there")

    @classmethod
    def from_function(cls, function: Any, _: str) -> Any:
        """Return the place of a kernel of ours; None where it cannot be written."""
        found = cls(function) if function.__module__.startswith("wayproof.") else None
        return found if found is not None and can_write(found._folder) else None


class Files(files_class):  # type: ignore[misc]
    """Files of a kernel in the cache."""

    _locator_classes = (ByModule, *files_class._locator_classes)


class Cache(cache_class):  # type: ignore[misc]
    """Compiled forms of a kernel, loaded without what only a compiler needs, scipy among it.

    Numba imports and registers its implementation of the language before it looks into the cache,
    in every process again. It does so before it compiles, too, so a kernel that is not in the cache
    finds all of it.
    """

    _impl_class = Files

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Return the compiled form for a signature; None, and say so, if it has to be compiled."""
        rtsys.initialize(target_context)  # what compiled code allocates arrays with
        with self._guard_against_spurious_io_errors():
            loaded = self._load_overload(sig, target_context)
        if loaded is None:
            note_missed(self._py_func.__module__)
            _shorten_message()
        return loaded


class PartLibrary(library_class):  # type: ignore[misc]
    """Code that is optimised, and made machine code, with that which calls it."""

    def _ensure_finalized(self) -> None:
        """Leave the code as it is."""


class Kernel(dispatcher_class):  # type: ignore[misc]
    """A kernel: whole for the types that Python calls it with, a part for those that kernels do."""

    def __init__(
        self,
        py_func: Callable[..., Any],
        locals: Any = None,
        targetoptions: dict[str, Any] | None = None,
        pipeline_class: Any = compiler.Compiler,
    ) -> None:
        """Make a dispatcher as numba does."""
        super().__init__(py_func, locals, targetoptions, pipeline_class)
        self._parts: dict[tuple[Any, ...], Any] = {}
        del self._cache  # an empty one

    @functools.cached_property
    def _cache(self) -> Cache:
        """The cache, looked for by the first call: most kernels are called by others alone."""
        return Cache(self.py_func)

    def get_call_template(self, args: Any, kws: Any) -> tuple[Any, Any, Any, Any]:
        """Return the template of a call by another kernel; a constant is as good as a variable."""
        pysig, args = self._compiler.fold_argument_types(args, kws)
        part = self._part(tuple(types.unliteral(one) for one in args))
        name = self.py_func.__name__
        template = templates.make_concrete_template(name, key=name, signatures=[part.signature])
        return template, pysig, args, {}

    def get_overload(self, sig: Any) -> Any:
        """Return what numba knows the part of a signature by."""
        args, _ = sigutils.normalize_signature(sig)
        return self._parts[tuple(args)].fndesc

    def _part(self, args: tuple[Any, ...]) -> Any:
        """Return the code for these types, to be called by other kernels."""
        if args in self._parts:
            return self._parts[args]
        flags: Any = compiler.Flags()
        self.targetdescr.options.parse_as_flags(flags, self.targetoptions)
        flags.no_compile = flags.no_cpython_wrapper = True
        library = PartLibrary(self.targetctx.codegen(), self.py_func.__qualname__)
        part = compiler.compile_extra(
            self.typingctx, self.targetctx, self.py_func, args, None, flags, {}, library
        )
        self.targetctx.insert_user_function(part.fndesc, part.fndesc, [library])
        self._parts[args] = part
        return part


def _link_parts() -> None:
    """Let code that calls a part also get those that the part calls."""
    any_library: Any = CPUCodeLibrary
    add = any_library.add_linking_library

    def add_linking_library(self: Any, library: Any) -> None:
        add(self, library)
        if isinstance(library, PartLibrary):
            self._linking_libraries += library._linking_libraries

    any_library.add_linking_library = add_linking_library


@functools.cache
def _shorten_message() -> None:
    """Let a slice that gets values of another shape raise a constant message.

    Numba's names the shapes, and to compile how takes as long as ten kernels, in every process.
    """
    from numba.np import arrayobj

    def mismatch(src_shapes: Any, index_shape: Any) -> None:
        raise NotImplementedError

    def implementation(src_shapes: Any, index_shape: Any) -> Any:
        def refuse(src_shapes: Any, index_shape: Any) -> None:
            raise ValueError("a slice got values of another shape")

        return refuse

    numba.extending.overload(mismatch)(implementation)
    module: Any = arrayobj
    module.raise_with_shape_context = mismatch


def _parse_when_linked() -> None:
    """Parse the intermediate code of a cached kernel when one is compiled that calls it.

    Numba parses it when it loads the kernel, for the names of its symbols. Those that are looked up
    are in the symbol table of the machine code, too.
    """
    any_library: Any = CPUCodeLibrary
    engine_class: Any = JitEngine
    unserialize = any_library._unserialize.__func__
    module_for_linking = any_library._get_module_for_linking
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

    any_library._unserialize = classmethod(load)
    any_library._get_module_for_linking = parse
    engine_class.is_symbol_defined = is_defined


def _name_modules_of_numba() -> None:
    """Load functions of numba in a cached kernel without their modules; one imports scipy.

    Compiled code refers to an environment of constants and of a module; it uses the constants.
    """
    environments: Any = environment
    rebuild = environments._rebuild_env

    @functools.wraps(rebuild)  # by whose name it is in the cache
    def rebuild_env(module: str, constants: Any, name: str) -> Any:
        known = environments.lookup_environment(name)
        if known is not None or not module.startswith("numba.") or module in sys.modules:
            return rebuild(module, constants, name)
        made = environments.Environment({"__name__": module})
        made.consts[:] = constants
        made.env_name = name
        environments.Environment._memo[name] = made
        return made

    environments._rebuild_env = rebuild_env


_link_parts()
_parse_when_linked()
_name_modules_of_numba()
