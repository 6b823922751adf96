"""Splats in the `.spz` format of Niantic, versions 2 and 3: quantised Gaussians behind gzip.

A header of 16 bytes, then all positions (24-bit fixed point), opacities, colours, scales
(logarithms) and rotations; the spherical harmonics after them are not read. Its frame has y up
(`prior.up=y`).
"""

from __future__ import annotations

import gzip
import struct
import zlib
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from wayproof.harness.prior.splats import MOST_GAUSSIANS, Gaussians
from wayproof.maps.elementary import exponentials
from wayproof.models.world_files import WorldFileError

HEAD = struct.Struct("<4sIIBBBB")  # magic, version, Gaussians, degree, fractional bits, flags, 0
MAGIC = b"NGSP"
ROTATION_BYTES = {2: 3, 3: 4}  # by version
FIELDS = 9 + 1 + 3 + 3  # bytes of a Gaussian's position, opacity, colour and scales

Array = NDArray[np.float64]


def read_spz(path: Path) -> Gaussians:
    """Read a `.spz` of Gaussians.

    Raises:
        WorldFileError: It is none, or of another version.
    """
    try:
        with gzip.open(path) as file:
            head = file.read(HEAD.size)
            if len(head) < HEAD.size or not head.startswith(MAGIC):
                raise WorldFileError(path, "no 'NGSP' at its beginning, expected a splat")
            _, version, count, _, fraction, _, _ = HEAD.unpack(head)
            if version not in ROTATION_BYTES:
                raise WorldFileError(path, f"version {version} of .spz, expected 2 or 3")
            if not 1 <= count <= MOST_GAUSSIANS:
                raise WorldFileError(path, f"{count} Gaussians, expected 1 to {MOST_GAUSSIANS}")
            size = count * (FIELDS + ROTATION_BYTES[version])
            data = file.read(size)
    except (gzip.BadGzipFile, EOFError, zlib.error) as error:
        raise WorldFileError(path, f"no gzip, as .spz is of versions 2 and 3: {error}") from None
    if len(data) != size:
        raise WorldFileError(path, f"ends after {len(data)} of {size} bytes")
    ends = np.cumsum([9 * count, count, 3 * count, 3 * count])
    parts = np.split(np.frombuffer(data, np.uint8), ends)
    positions, opacities, _, scales, rotations = parts
    logarithms = scales / 16.0 - 10.0
    smallest = _smallest_three if version == 3 else _first_three
    return Gaussians(
        _fixed_point(positions.reshape(count, 3, 3), fraction),
        exponentials(logarithms).reshape(count, 3),
        smallest(rotations.reshape(count, -1)),
        opacities / 255.0,
    )


def _fixed_point(bytes_of: NDArray[np.uint8], fraction: int) -> Array:
    """Decode signed numbers (n, 3) of 3 bytes each, little-endian, with `fraction` low bits."""
    low, middle, high = (bytes_of[:, :, k].astype(np.int64) for k in range(3))
    whole = low + (middle << 8) + (high << 16)
    signed: Array = np.where(whole >= 1 << 23, whole - (1 << 24), whole)
    return signed / float(1 << min(fraction, 62))


def _first_three(rotations: NDArray[np.uint8]) -> Array:
    """Return quaternions (n, 4), w x y z, of x, y and z in a byte each (n, 3)."""
    xyz = rotations / 127.5 - 1.0
    rest = np.maximum(1.0 - np.square(xyz).sum(axis=1), 0.0)
    return np.concatenate([np.sqrt(rest)[:, None], xyz], axis=1)


def _smallest_three(rotations: NDArray[np.uint8]) -> Array:
    """Return quaternions (n, 4), w x y z, of 32 bits each (n, 4).

    The two highest are the index of the greatest component among x, y, z, w; the others follow in
    that order, each as a sign and nine bits of its share of the root of 1/2.
    """
    packed = np.ascontiguousarray(rotations).view("<u4")[:, 0].astype(np.int64)
    greatest = packed >> 30
    xyzw = np.zeros((len(packed), 4))
    for index in (3, 2, 1, 0):
        held = greatest != index
        share = (packed & 511) / 511.0 * np.sqrt(0.5)
        xyzw[:, index] = np.where(held, np.where(packed & 512, -share, share), 0.0)
        packed = np.where(held, packed >> 10, packed)
    rest = np.maximum(1.0 - np.square(xyzw).sum(axis=1), 0.0)
    xyzw[np.arange(len(xyzw)), greatest] = np.sqrt(rest)
    return np.roll(xyzw, 1, axis=1)
