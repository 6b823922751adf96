"""Parameters in the form that costs a kernel least to be called with."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray


def packed(parameters: Any) -> NDArray[Any]:
    """A named tuple of numbers, and of tuples of numbers, as an array (1,) of one record."""
    values = [np.array(value) for value in parameters]
    fields = [
        (name, one.dtype, one.shape) for name, one in zip(parameters._fields, values, strict=True)
    ]
    return np.array([tuple(parameters)], np.dtype(fields, align=True))
