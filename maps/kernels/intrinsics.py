"""Instructions of the processor that kernels need and numba does not offer."""

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

FOR_WRITING, KEPT, OF_DATA = 1, 3, 1

_ONE_AT_A_TIME = threading.Lock()

Queue = NDArray[np.int64]
"""(1,) how many items have been taken by all threads."""


def new_queue() -> Queue:
    """One of which nothing has been taken."""
    return np.zeros(1, np.int64)


def prefetch(array: NDArray[Any], place: np.uint64) -> None:
    """Ask for the cache line of an element of a flat array, to be written soon.

    A kernel that writes blocks here and there waits some 100 ns for each, as the processor foresees
    only memory that is met in order. It goes on meanwhile if the memory was asked for before.
    Nothing else changes: a place beyond the array does no harm, and interpreted it does nothing.
    What is compiled is LLVM's `llvm.prefetch` (LLVM Language Reference Manual).
    """


def take(queue: Queue, count: int) -> int:
    """Take the next items of work; of threads that take at once none gets the same.

    What is compiled is LLVM's `atomicrmw add` (LLVM Language Reference Manual). Interpreted it
    takes a lock.

    Args:
        queue: Of the work.
        count: How many to take.

    Returns:
        The first of them.
    """
    with _ONE_AT_A_TIME:
        first = int(queue[0])
        queue[0] += count
    return first


@intrinsic
def _prefetch(_typing: Any, array: Any, place: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        data = make_array(signature.args[0])(context, builder, arguments[0]).data
        address = builder.gep(data, [arguments[1]])
        number, pointer = ir.IntType(32), ir.IntType(8).as_pointer()
        kind = ir.FunctionType(ir.VoidType(), [pointer, number, number, number])
        function = cgutils.get_or_insert_function(builder.module, kind, "llvm.prefetch.p0")
        how = [number(value) for value in (FOR_WRITING, KEPT, OF_DATA)]
        builder.call(function, [builder.bitcast(address, pointer), *how])
        return context.get_dummy_value()

    return types.void(array, place), generate


@overload(prefetch)
def _compiled_prefetch(array: Any, place: Any) -> Any:
    ask: Any = _prefetch  # numba gives the typing context

    def prefetch(array: Any, place: Any) -> Any:
        return ask(array, place)

    return prefetch


@intrinsic
def _take(_typing: Any, queue: Any, count: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        data = make_array(signature.args[0])(context, builder, arguments[0]).data
        return builder.atomic_rmw("add", data, arguments[1], "monotonic")

    return types.int64(queue, types.int64), generate


@overload(take)
def _compiled_take(queue: Any, count: Any) -> Any:
    add: Any = _take

    def take(queue: Any, count: Any) -> Any:
        return add(queue, count)

    return take
