"""Parameters in the form that is cheapest to call a kernel with."""

from __future__ import annotations

import functools
from typing import Any

import numpy as np
from numpy.typing import NDArray


def packed(parameters: Any, **more: Any) -> NDArray[Any]:
    """Return a named tuple of numbers, tuples of numbers and named tuples as one record, (1,).

    Args:
        parameters: The named tuple.
        more: Further fields by name.
    """
    fields = {**parameters._asdict(), **more}
    dtype = _record_type(tuple((name, *_field(value)) for name, value in fields.items()))
    return np.array([tuple(fields.values())], dtype)


@functools.cache
def _record_type(fields: tuple[tuple[Any, ...], ...]) -> np.dtype[Any]:
    """Return the type of a record, the same object each time.

    A kernel that is called with an equal one compares all fields first.
    """
    return np.dtype([*fields], align=True)


def _field(value: Any) -> tuple[Any, tuple[int, ...]]:
    """Return the type and shape of a field."""
    if hasattr(value, "_fields"):
        return packed(value).dtype, ()
    array = np.array(value)
    return array.dtype, array.shape
