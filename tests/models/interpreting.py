"""Kernels run as plain Python, for tests that compare them with their compiled selves."""

import sys

from numba.core.dispatcher import Dispatcher


def interpret_kernels(monkeypatch, package="wayproof.models"):
    """Replace every kernel that a loaded module of the package names by its Python function."""
    for module in list(sys.modules.values()):
        if getattr(module, "__name__", "").startswith(package):
            for name, value in list(vars(module).items()):
                if isinstance(value, Dispatcher):
                    monkeypatch.setattr(module, name, value.py_func)
