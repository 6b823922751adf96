"""Ranges as differences along each row of a sweep, low bytes before high: zstd packs that well."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from models._jit import kernel


def encode(ranges_mm: NDArray[np.uint16], rows: int) -> bytes:
    """Two bytes for each of the ranges (n,), mm, of so many rows of equal length."""
    planes = np.empty((2, len(ranges_mm)), np.uint8)
    write_differences(np.ascontiguousarray(ranges_mm), len(ranges_mm) // rows, planes)
    return planes.tobytes()


def decode(data: bytes, rows: int) -> NDArray[np.uint16]:
    """The ranges (n,), mm, of 2 n bytes that `encode` made."""
    planes = np.frombuffer(data, np.uint8).reshape(2, -1)
    ranges_mm = np.empty(planes.shape[1], np.uint16)
    add_differences(planes, planes.shape[1] // rows, ranges_mm)
    return ranges_mm


@kernel
def write_differences(
    ranges_mm: NDArray[np.uint16],  # (n,)
    columns: int,
    planes: NDArray[np.uint8],  # (2, n) out
) -> None:
    """What each range has more than the one before it in its row; less wraps around."""
    for first in range(0, len(ranges_mm), columns):
        before = np.uint16(0)
        for k in range(first, first + columns):
            difference = np.uint16(ranges_mm[k] - before)
            planes[0, k] = np.uint8(difference & np.uint16(0xFF))
            planes[1, k] = np.uint8(difference >> np.uint16(8))
            before = ranges_mm[k]


@kernel
def add_differences(
    planes: NDArray[np.uint8],  # (2, n)
    columns: int,
    ranges_mm: NDArray[np.uint16],  # (n,) out
) -> None:
    """Undo `write_differences`."""
    for first in range(0, len(ranges_mm), columns):
        so_far = np.uint16(0)
        for k in range(first, first + columns):
            so_far += np.uint16(planes[0, k]) | (np.uint16(planes[1, k]) << np.uint16(8))
            ranges_mm[k] = so_far


def warm_up() -> None:
    """Compile the kernels, or load them from the cache."""
    decode(encode(np.zeros(1, np.uint16), 1), 1)
