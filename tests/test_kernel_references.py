"""Kernels that count no references to arrays: none gets out of one that was counted elsewhere."""

import importlib
import types
import typing
from pathlib import Path

import numba
import numpy as np
import pytest
from numba.core.dispatcher import Dispatcher
from numba.core.errors import NumbaError

from wayproof.kernel_compiler import allocating, kernel

ROOT = Path(__file__).parents[1]


def kernels():
    """Every kernel of ours, by module and name."""
    found = {}
    for folder in ("harness", "maps", "models", "planners"):
        for path in sorted((ROOT / folder).rglob("*.py")):
            if "kernel_compiler import" in path.read_text(encoding="utf-8"):
                name = ".".join(path.relative_to(ROOT).with_suffix("").parts)
                module = importlib.import_module(f"wayproof.{name}")
                for value in vars(module).values():
                    if isinstance(value, Dispatcher):
                        found[value.py_func.__module__, value.py_func.__name__] = value
    return found


def holds_array(hint):
    """Return whether a value of a type is an array, or a tuple with one."""
    if typing.get_origin(hint) is np.ndarray or hint in (np.ndarray, typing.Any):
        return True
    if isinstance(hint, type) and issubclass(hint, tuple):  # a named one
        return any(map(holds_array, typing.get_type_hints(hint).values()))
    return any(map(holds_array, typing.get_args(hint)))


def returns_array(dispatcher):
    return holds_array(typing.get_type_hints(dispatcher.py_func)["return"])


def counts_references(dispatcher):
    return dispatcher.targetoptions["_nrt"]


def called(dispatcher):
    """Yield the kernels that a kernel names, also as attributes of modules."""
    function = dispatcher.py_func
    names = function.__code__.co_names
    values = [function.__globals__.get(name) for name in names]
    modules = [value for value in values if isinstance(value, types.ModuleType)]
    values += [getattr(module, name, None) for module in modules for name in names]
    yield from (value for value in values if isinstance(value, Dispatcher))


def leaks(found):
    """Names of kernels that count none and pass on an array."""
    return [
        name
        for name, one in found.items()
        if not counts_references(one)
        and (returns_array(one) or any(map(returns_array, called(one))))
    ]


def test_no_kernel_without_counts_returns_an_array_or_gets_one():
    found = kernels()
    assert len(found) > 400
    assert 40 < sum(map(counts_references, found.values())) < 120
    assert leaks(found) == []


@kernel
def halves(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:  # numba would compile it
    return values[:1], values[1:]


@allocating
def zero_pair() -> tuple[np.ndarray, int]:
    return np.zeros(2), 2


@kernel
def first_of_zeros() -> float:
    return zero_pair()[0][0]


def test_what_passes_an_array_on_is_found():
    found = {"halves": halves, "zero_pair": zero_pair, "first_of_zeros": first_of_zeros}
    assert leaks(found) == ["halves", "first_of_zeros"]


@pytest.mark.parametrize("make", [lambda: len(np.zeros(2)), lambda a: a[1:]])
def test_an_array_is_not_made_or_returned_without_counts(make):
    arguments = [np.zeros(3)] * make.__code__.co_argcount
    with pytest.raises(NumbaError):
        numba.njit(_nrt=False)(make)(*arguments)
    numba.njit(make)(*arguments)
