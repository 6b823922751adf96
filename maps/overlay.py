"""States of cells that were not measured, and a measured map laid over them.

A layer may hold a map of another day, a floor plan or a prediction. A measured state always wins:
of a layer only those cells count that the map above it does not know.
"""

from __future__ import annotations

import hashlib
import struct

import numpy as np
from numpy.typing import NDArray

from wayproof.maps.columns import WORD_BITS, ColumnMap, Window, pack
from wayproof.maps.states import FREE, OCCUPIED

Words = NDArray[np.uint64]
Cell = tuple[int, int, int]


class CellLayer:
    """States of the cells of one window, a bit each; all cells outside are unknown.

    Attributes:
        resolution: Edge of a cell, m.
        window: The cells that it may hold.
    """

    def __init__(self, window: Window) -> None:
        """Make a layer of unknown cells."""
        self.resolution, self.window = window.resolution, window
        nx, ny, nz = window.shape
        self._occupied = np.zeros((nx, ny, -(-nz // WORD_BITS)), np.uint64)
        self._free = np.zeros_like(self._occupied)
        self._boxes: list[NDArray[np.int64]] = []

    def put(self, first: Cell, states: NDArray[np.uint8]) -> None:
        """Replace the states (nx, ny, nz) of a box of cells.

        Args:
            first: Least cell of the box, which lies in the window.
            states: Unknown, free or occupied.

        Raises:
            ValueError: The box leaves the window.
        """
        low = np.array(first) - self.window.first
        high = low + states.shape
        if (low < 0).any() or (high > self.window.shape).any():
            raise ValueError(f"box: got {first} of {states.shape}, expected within {self.window}")
        if states.size == 0:
            return
        (x0, y0, z0), (x1, y1, z1) = low.tolist(), high.tolist()
        columns = (slice(x0, x1), slice(y0, y1))
        for words, state in ((self._occupied, OCCUPIED), (self._free, FREE)):
            layers = np.zeros((*states.shape[:2], WORD_BITS * words.shape[2]), np.bool_)
            layers[:, :, z0:z1] = states == state
            inside = np.zeros((1, 1, layers.shape[2]), np.bool_)
            inside[:, :, z0:z1] = True
            words[columns] = (words[columns] & ~pack(inside)) | pack(layers)
        self._boxes.append(np.array([*first, *(np.array(first) + states.shape)], np.int64))

    def columns(self, low_cell: Cell, shape: tuple[int, int, int]) -> tuple[Words, Words]:
        """Return the occupied and the free cells of a box, (nx, ny, words) each, as a map does."""
        return (
            _cut(self._occupied, self.window.first, low_cell, shape),
            _cut(self._free, self.window.first, low_cell, shape),
        )

    def changed(self, since: int) -> tuple[NDArray[np.int64], int]:
        """Return the boxes (k, 6) of cells put since a stamp (0: all), and a new stamp."""
        return np.array(self._boxes[since:], np.int64).reshape(-1, 6), len(self._boxes)

    def version(self) -> str:
        """Return a digest of the states, 32 hex digits."""
        head = struct.pack("<d6q", self.resolution, *self.window.first, *self.window.shape)
        digest = hashlib.blake2b(head, digest_size=16)
        for words in (self._occupied, self._free):
            digest.update(words.astype("<u8").tobytes())
        return digest.hexdigest()

    def memory_bytes(self) -> int:
        """Return the bytes that it holds."""
        return self._occupied.nbytes + self._free.nbytes


class Overlaid(ColumnMap):
    """A map laid over a layer: where the map knows nothing, the layer's states count.

    Attributes:
        resolution: Edge of a cell, m.
    """

    def __init__(self, above: ColumnMap, layer: CellLayer) -> None:
        """Lay a map over a layer of the same cells.

        Raises:
            ValueError: Their cells differ.
        """
        if above.resolution != layer.resolution:
            raise ValueError(
                f"resolution: got {layer.resolution:g} m, expected the map's, {above.resolution:g}"
            )
        self.resolution = above.resolution
        self._above, self._layer = above, layer
        self._stamps = [(0, 0)]  # of the map and of the layer, by the stamp that was returned

    def columns(self, low_cell: Cell, shape: tuple[int, int, int]) -> tuple[Words, Words]:
        """Return the occupied and the free cells of a box, (nx, ny, words) each."""
        occupied, free = self._above.columns(low_cell, shape)
        below_occupied, below_free = self._layer.columns(low_cell, shape)
        unknown = ~(occupied | free)
        return occupied | (below_occupied & unknown), free | (below_free & unknown)

    def changed(self, since: int) -> tuple[NDArray[np.int64], int]:
        """Return boxes (k, 6) of cells that changed in either since a stamp, and a new stamp."""
        of_map, of_layer = self._stamps[since]
        boxes, now = self._above.changed(of_map)
        put, then = self._layer.changed(of_layer)
        if (now, then) != self._stamps[-1]:
            self._stamps.append((now, then))
        return np.concatenate([boxes, put]), len(self._stamps) - 1

    def keep_out(self, low_cell: Cell, shape: tuple[int, int, int]) -> Words | None:
        """Return the cells of a box that are blocked without being occupied, as of the map."""
        return self._above.keep_out(low_cell, shape)


def _cut(words: Words, first: Cell, low_cell: Cell, shape: tuple[int, int, int]) -> Words:
    """Cut a box (nx, ny, words) out of columns of bits that begin at a cell; zero outside."""
    box = np.zeros(shape, np.uint64)
    x, y, z = (int(low) - begin for low, begin in zip(low_cell, first, strict=True))
    (x0, x1), (y0, y1) = (
        (max(low, 0), min(low + size, held))
        for low, size, held in zip((x, y), shape, words.shape, strict=False)
    )
    if x0 >= x1 or y0 >= y1:
        return box
    part, target = words[x0:x1, y0:y1], box[x0 - x : x1 - x, y0 - y : y1 - y]
    whole, bits = divmod(z, WORD_BITS)  # bit k of the box is bit k + z of the columns
    for word in range(shape[2]):
        low, high = word + whole, word + whole + 1
        if 0 <= low < words.shape[2]:
            target[:, :, word] = part[:, :, low] >> np.uint64(bits)
        if bits and 0 <= high < words.shape[2]:
            target[:, :, word] |= part[:, :, high] << np.uint64(WORD_BITS - bits)
    return box
