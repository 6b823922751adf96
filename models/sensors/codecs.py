"""Codecs of sweeps: differences from beam to beam, low bytes before high, for zstd.

Ranges of an image are coded as two bytes each, by their differences along each row. Of a sweep that
lists its beams, each number is coded as its difference from that of the beam before, modulo 2^32,
with the sign in the lowest bit; all lowest bytes come first, all highest last.

A direction is rounded to whole grains of 2^-20 and scaled to unit length when it is decoded: it is
then at most 1e-6 rad from the one given, which is 0.1 mm at 100 m. Decoded directions are the same
bits on every machine.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wayproof.kernel_compiler import kernel

GRAIN = 2.0**-20
"""Grain of a coordinate of a unit direction: 1e-6 rad."""

BYTES = 4
"""Bytes of a number."""

LEAST_LENGTH = 0.9
"""Least length of a coded direction; rounding changes that of a unit vector by 1e-6 at most."""


def encode_image(ranges_mm: NDArray[np.uint16], rows: int) -> bytes:
    """Return two bytes for each of the ranges (n,), mm, of a number of rows.

    Raises:
        ValueError: The rows are not of equal length.
    """
    image = np.ascontiguousarray(ranges_mm).reshape(rows, -1)
    planes = np.empty((2, *image.shape), np.uint8)
    write_differences(image, planes)
    return planes.tobytes()


def decode_image(data: bytes, rows: int) -> NDArray[np.uint16]:
    """Return the ranges (n,), mm, of 2 n bytes by `encode_image`.

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


def encode_directions(directions: NDArray[np.floating]) -> bytes:
    """Return 12 bytes for each of the unit directions (n, 3)."""
    grains = np.rint(np.asarray(directions, np.float64) / GRAIN).astype(np.int32)
    return _encode(np.ascontiguousarray(grains.T).view(np.uint32))


def decode_directions(data: bytes, count: int) -> NDArray[np.float64]:  # (count, 3)
    """Return the unit directions of bytes by `encode_directions`.

    Raises:
        ValueError: Not 12 bytes for each of `count` beams, or a direction of no unit length.
    """
    grains = _decode(data, 3, count).view(np.int32).T.astype(np.float64) * GRAIN
    lengths = np.sqrt(np.square(grains).sum(axis=1))
    if not (np.abs(lengths - 1.0) <= 1.0 - LEAST_LENGTH).all():
        raise ValueError("directions: expected unit length")
    return np.ascontiguousarray(grains / lengths[:, None])


def encode_ranges(ranges_mm: NDArray[np.uint32]) -> bytes:
    """Return four bytes for each of the ranges (n,), mm."""
    return _encode(np.ascontiguousarray(ranges_mm, np.uint32)[None])


def decode_ranges(data: bytes, count: int) -> NDArray[np.uint32]:  # (count,)
    """Return the ranges of bytes by `encode_ranges`, mm.

    Raises:
        ValueError: Not four bytes for each of `count` beams.
    """
    ranges: NDArray[np.uint32] = _decode(data, 1, count)[0]
    return ranges


def _encode(rows: NDArray[np.uint32]) -> bytes:
    """Code numbers (k, n): differences along each row, as four planes of bytes."""
    steps = np.diff(rows, axis=1, prepend=np.uint32(0)).view(np.int32)
    folded = (steps << 1 ^ steps >> 31).view(np.uint32)
    planes = folded[None] >> (8 * np.arange(BYTES, dtype=np.uint32))[:, None, None]
    return planes.astype(np.uint8).tobytes()


def _decode(data: bytes, rows: int, count: int) -> NDArray[np.uint32]:  # (rows, count)
    if len(data) != BYTES * rows * count:
        raise ValueError(f"got {len(data)} bytes for {count} beams, expected {BYTES * rows} each")
    planes = np.frombuffer(data, np.uint8).reshape(BYTES, rows, count).astype(np.uint32)
    folded = planes[0] | planes[1] << 8 | planes[2] << 16 | planes[3] << 24
    steps = folded >> 1 ^ -(folded & 1).astype(np.int32).view(np.uint32)
    summed: NDArray[np.uint32] = np.cumsum(steps, axis=1, dtype=np.uint32)
    return summed


def warm_up() -> None:
    """Compile the kernels, or load them from the cache."""
    decode_image(encode_image(np.zeros(1, np.uint16), 1), 1)
