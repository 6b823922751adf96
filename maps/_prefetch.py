"""Asking for memory ahead of time, from within a kernel.

A kernel that writes blocks here and there waits some 100 ns for each, as the processor foresees
only memory that is met in order. It goes on meanwhile if the memory was asked for before.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic, overload
from numba.np.arrayobj import make_array
from numpy.typing import NDArray

FOR_WRITING, KEPT, OF_DATA = 1, 3, 1


def prefetch(array: NDArray[Any], place: np.uint64) -> None:
    """Ask for the cache line of an element of a flat array, to be written soon.

    It changes nothing but the time: a place beyond the array does no harm. Interpreted it does
    nothing. What is compiled is LLVM's `llvm.prefetch` (LLVM Language Reference Manual).
    """


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
def _compiled(array: Any, place: Any) -> Any:
    ask: Any = _prefetch  # numba gives the typing context

    def prefetch(array: Any, place: Any) -> Any:
        return ask(array, place)

    return prefetch
