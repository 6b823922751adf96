"""Two processor instructions that numba does not offer: an atomic add, and a memory prefetch.

Each is a plain Python function with an `overload` that numba compiles in its place. The overload
emits one LLVM instruction through `numba.extending.intrinsic`, the interface that numba documents
for this; the names follow the LLVM Language Reference Manual.
"""

from __future__ import annotations

import threading
from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic, overload
from numba.np.arrayobj import make_array
from numpy.typing import NDArray

FOR_WRITING, KEEP_IN_ALL_CACHES, DATA_CACHE = 1, 3, 1
"""Arguments rw, locality and cache type of `llvm.prefetch`."""

_INTERPRETER_LOCK = threading.Lock()


def fetch_add(counter: NDArray[np.int64], amount: int) -> int:
    """Add to a counter (1,) that threads share, and return its value before.

    Atomic: of threads that add at once each gets another value. Threads in compiled kernels hand
    out work by it without waiting for each other or for Python. Compiled it is LLVM's
    `atomicrmw add`; interpreted it takes a lock.
    """
    with _INTERPRETER_LOCK:
        before = int(counter[0])
        counter[0] += amount
    return before


def prefetch_for_write(array: NDArray[Any], index: np.uint64) -> None:
    """Begin to load the cache line of an element of a flat array that will be written soon.

    A kernel that writes blocks here and there waits some 100 ns for each, as the processor foresees
    only memory that is met in order; loaded ahead, it is there when the kernel gets to it. No value
    changes by it, and an index beyond the array does no harm. Compiled it is LLVM's
    `llvm.prefetch`; interpreted it does nothing.
    """


@intrinsic
def _fetch_add(_typing: Any, counter: Any, amount: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        data = make_array(signature.args[0])(context, builder, arguments[0]).data
        # Nothing else is handed over between threads, so no other memory need be ordered.
        return builder.atomic_rmw("add", data, arguments[1], "monotonic")

    return types.int64(counter, types.int64), generate


@overload(fetch_add)
def _compiled_fetch_add(counter: Any, amount: Any) -> Any:
    emit: Any = _fetch_add  # numba supplies the typing context

    def fetch_add(counter: Any, amount: Any) -> Any:
        return emit(counter, amount)

    return fetch_add


@intrinsic
def _prefetch_for_write(_typing: Any, array: Any, index: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        data = make_array(signature.args[0])(context, builder, arguments[0]).data
        address = builder.gep(data, [arguments[1]])
        number, pointer = ir.IntType(32), ir.IntType(8).as_pointer()
        prototype = ir.FunctionType(ir.VoidType(), [pointer, number, number, number])
        function = cgutils.get_or_insert_function(builder.module, prototype, "llvm.prefetch.p0")
        hints = [number(hint) for hint in (FOR_WRITING, KEEP_IN_ALL_CACHES, DATA_CACHE)]
        builder.call(function, [builder.bitcast(address, pointer), *hints])
        return context.get_dummy_value()

    return types.void(array, index), generate


@overload(prefetch_for_write)
def _compiled_prefetch_for_write(array: Any, index: Any) -> Any:
    emit: Any = _prefetch_for_write

    def prefetch_for_write(array: Any, index: Any) -> Any:
        return emit(array, index)

    return prefetch_for_write
