"""Decorators that compile the kernels of maps."""

from collections.abc import Callable
from typing import Any, TypeVar

import numba

from wayproof.kernel_cache import share_between_checkouts

Function = TypeVar("Function", bound=Callable[..., Any])

share_between_checkouts()

# error_model="numpy" compiles a division without a branch for zero; nogil lets Python threads run
# kernels side by side. No fastmath: it would let the compiler reorder arithmetic, and two machines
# could then build two maps.
# No kernel is called from C: its second wrapper would take a fifth of the time to compile.
OPTIONS: dict[str, Any] = {
    "cache": True,
    "error_model": "numpy",
    "nogil": True,
    "no_cfunc_wrapper": True,
}
UNCOUNTED, COUNTED = {**OPTIONS, "_nrt": False}, {**OPTIONS, "_nrt": True}


def kernel(function: Function) -> Function:
    """Compile a kernel without counts of references to arrays.

    Each count is an atomic operation, two for every slice and every array handed on. So it makes no
    array, which does not compile, and returns none, nor gets one from a kernel that it calls.
    """
    compiled: Function = numba.njit(**UNCOUNTED)(function)
    return compiled


def inlined(function: Function) -> Function:
    """Compile a kernel that is called for each column: a call costs nanoseconds an argument."""
    compiled: Function = numba.njit(forceinline=True, **UNCOUNTED)(function)
    return compiled


def allocating(function: Function) -> Function:
    """Compile a kernel that makes or returns arrays.

    Without the option numba would count references as in the kernel that calls it first.
    """
    compiled: Function = numba.njit(**COUNTED)(function)
    return compiled
