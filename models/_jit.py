"""The numba decorators of this package.

`error_model="numpy"` keeps divisions free of exception branches; there is no `fastmath`, because
results have to be the same bits on every run. No kernel is called from C: the wrapper for
that would take a fifth of the time to compile.
"""

from collections.abc import Callable
from typing import Any, TypeVar

import numba

from wayproof.kernel_cache import share_between_checkouts

Function = TypeVar("Function", bound=Callable[..., Any])

share_between_checkouts()

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


def allocating(function: Function) -> Function:
    """Compile a kernel that makes or returns arrays.

    Without the option numba would count references as in the kernel that calls it first.
    """
    compiled: Function = numba.njit(**COUNTED)(function)
    return compiled


def inlined(function: Function) -> Function:
    """Compile a kernel into those that call it, which then hand it no tables."""
    compiled: Function = numba.njit(**UNCOUNTED, forceinline=True)(function)
    return compiled
