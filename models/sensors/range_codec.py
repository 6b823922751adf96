"""Codec of ranges: differences along each row of a sweep, low bytes before high, for zstd."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wayproof.models._jit import kernel


def encode(ranges_mm: NDArray[np.uint16], rows: int) -> bytes:
    """Return two bytes for each of the ranges (n,), mm, of a number of rows.

    Raises:
        ValueError: The rows are not of equal length.
    """
    image = np.ascontiguousarray(ranges_mm).reshape(rows, -1)
    planes = np.empty((2, *image.shape), np.uint8)
    write_differences(image, planes)
    return planes.tobytes()


def decode(data: bytes, rows: int) -> NDArray[np.uint16]:
    """Return the ranges (n,), mm, of 2 n bytes by `encode`.

    Raises:
        ValueError: There are not two bytes for each range of equal rows.
    """
    planes = np.frombuffer(data, np.uint8).reshape(2, rows, -1)
    image = np.empty(planes.shape[1:], np.uint16)
    add_differences(planes, image)
    return image.reshape(-1)


@kernel
def write_differences(
    image: NDArray[np.uint16],  # (rows, columns) mm
    planes: NDArray[np.uint8],  # (2, rows, columns) out
) -> None:
    """Write each range's difference from the one before in its row, modulo 2^16."""
    for row in range(image.shape[0]):
        before = np.uint16(0)
        for k in range(image.shape[1]):
            difference = np.uint16(image[row, k] - before)
            planes[0, row, k] = np.uint8(difference & np.uint16(0xFF))
            planes[1, row, k] = np.uint8(difference >> np.uint16(8))
            before = image[row, k]


@kernel
def add_differences(
    planes: NDArray[np.uint8],  # (2, rows, columns)
    image: NDArray[np.uint16],  # (rows, columns) mm, out
) -> None:
    """Undo `write_differences`."""
    for row in range(image.shape[0]):
        so_far = np.uint16(0)
        for k in range(image.shape[1]):
            low, high = np.uint16(planes[0, row, k]), np.uint16(planes[1, row, k])
            so_far += low | (high << np.uint16(8))
            image[row, k] = so_far


def warm_up() -> None:
    """Compile the kernels, or load them from the cache."""
    decode(encode(np.zeros(1, np.uint16), 1), 1)
