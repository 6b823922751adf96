"""Blocks of cells, found by their index: the storage of a representation without bounds."""

from __future__ import annotations

import struct
from collections.abc import Iterator, Mapping

import numpy as np
from numpy.typing import DTypeLike, NDArray

from wayproof.maps.kernels import update as kernels
from wayproof.maps.store.slot_pool import EVERYWHERE, MEBIBYTE, Layer, SlotPool

HEAD_BYTES = 128
"""Bytes of a block besides its cells, as the capacity counts them."""


class Blocks(SlotPool):
    """A pool of blocks of one shape; each cell has one value in every layer, 0 where unknown.

    Attributes:
        shape: Cells of a block along x, y and z.
    """

    def __init__(
        self, memory_mib: int, shape: tuple[int, int, int], layers: Mapping[str, DTypeLike]
    ) -> None:
        """Reserve a pool that takes at most `memory_mib`."""
        self.shape = shape
        cells = int(np.prod(shape))
        each = cells * sum(np.dtype(kind).itemsize for kind in layers.values())
        super().__init__(
            max(memory_mib * MEBIBYTE // (each + HEAD_BYTES), 1),
            {name: Layer(kind, (cells,)) for name, kind in layers.items()},
        )

    def locate(self, cells: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Return slots (n,) of the blocks of cells (n, 3), -1 for none, and places in them."""
        x, y, z = (cells % self.shape).T
        _, ny, nz = self.shape
        return self.find(cells // self.shape), (x * ny + y) * nz + z

    def changed_boxes(self, since: int) -> NDArray[np.int64]:
        """Return boxes of cells (k, 6) of the blocks whose states changed after a stamp."""
        keys = self.changed(since)
        if keys is None:
            return EVERYWHERE.copy()
        return np.hstack([keys * self.shape, (keys + 1) * self.shape])

    def digest_layers(self, names: tuple[str, ...]) -> int:
        """Return the digest of some layers of all blocks."""

        def contents(slots: NDArray[np.int64]) -> Iterator[bytes]:
            lanes = np.empty((len(names), len(slots), 8), np.uint64)
            known = np.empty((len(names), len(slots)), np.bool_)
            words = [self.layers[n].view(np.uint64).reshape(len(self.keys), -1, 8) for n in names]
            for layer, sums, any_known in zip(words, lanes, known, strict=True):
                kernels.digest_bricks(slots, layer, sums, any_known)
            for i, key in enumerate(self.keys[slots].tolist()):
                content = struct.pack("<3q", *key) + lanes[:, i].astype("<u8").tobytes()
                yield content if known[:, i].any() else b""

        return self.digest(contents)
