"""Columns of cells as bits, and windows of them: the part of a map that a costmap reads."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wayproof.maps.grid import FLOOR_HEIGHT_IN_CELL, ROUNDING, cell_box, finite_vector
from wayproof.maps.kernels import columns as kernels
from wayproof.maps.states import FREE, OCCUPIED

WORD_BITS = 64
"""Cells in a word."""

MAX_CELLS = 200_000_000
"""Maximum number of cells of a window."""

MAX_REGION_CELLS = 1 << 40
"""Maximum number of cells of a region whose observed cells alone are held."""

Columns = tuple[slice, slice]
"""A box of columns, along their first two axes."""


class ColumnMap(Protocol):
    """The bits of a map's columns, and where they changed.

    A map that derives from it need not define `keep_out` and `rewrite_columns`.
    """

    resolution: float

    def columns(
        self, low_cell: tuple[int, int, int], shape: tuple[int, int, int]
    ) -> tuple[NDArray[np.uint64], NDArray[np.uint64]]:
        """Return the occupied and the free cells of a box, each (nx, ny, words).

        Bit k of word w is the cell 64 w + k along z.
        """

    def changed(self, since: int) -> tuple[NDArray[np.int64], int]:
        """Return boxes (k, 6) of cells that changed since a stamp (0: all), and a new stamp."""

    def keep_out(
        self, low_cell: tuple[int, int, int], shape: tuple[int, int, int]
    ) -> NDArray[np.uint64] | None:
        """Return the cells (nx, ny, words) of a box that are blocked without being occupied.

        None if there are none: of most maps.
        """
        return None

    def rewrite_columns(
        self,
        low_cell: tuple[int, int, int],
        boxes: NDArray[np.int64],
        occupied: NDArray[np.uint64],
        free: NDArray[np.uint64],
    ) -> None:
        """Write the columns of a window again where they changed.

        Of a map that derives from this they are those of the least rectangle that holds all boxes.

        Args:
            low_cell: Least cell of the window.
            boxes: (k, 6) cells that changed, as `changed` returns them.
            occupied: (nx, ny, words) bits as `columns` returned them before; brought up to date.
            free: (nx, ny, words) likewise.
        """
        nx, ny, words = occupied.shape
        window = Window(self.resolution, low_cell, (nx, ny, WORD_BITS * words))
        _, within = window.touched_by(boxes)
        if within is not None:
            x, y = within
            low = low_cell[0] + x.start, low_cell[1] + y.start, low_cell[2]
            shape = x.stop - x.start, y.stop - y.start, words
            occupied[x, y], free[x, y] = self.columns(low, shape)


@dataclass(frozen=True)
class Window:
    """A box of cells of a map without bounds.

    The cells of all maps of one resolution lie on one lattice: a point is in the cell
    floor(x / resolution) along x and y, and floor(z / resolution + 3/4) along z.

    Attributes:
        resolution: Edge of a cell, m.
        first: (x, y, z) indices of the first cell in the map.
        shape: (nx, ny, nz) cells.
    """

    resolution: float
    first: tuple[int, int, int]
    shape: tuple[int, int, int]

    @classmethod
    def covering(
        cls, low: ArrayLike, high: ArrayLike, resolution: float, most_cells: int = MAX_CELLS
    ) -> Self:
        """Return the least window that holds a box.

        Args:
            low: (3,) least corner, m, world.
            high: (3,) greatest corner, m, world.
            resolution: Edge of a cell, m.
            most_cells: Maximum number of its cells.

        Raises:
            ValueError: The box is empty or not finite, or would hold too many cells.
        """
        bottom, top = finite_vector("low", low), finite_vector("high", high)
        if not np.all(bottom < top):
            raise ValueError(f"bounds: got low {bottom} and high {top}, expected low < high")
        shift = np.array([0.0, 0.0, FLOOR_HEIGHT_IN_CELL])
        # A corner a rounding error away from a face is on it.
        first = np.floor(bottom / resolution + shift + ROUNDING).astype(np.int64)
        end = np.ceil(top / resolution + shift - ROUNDING).astype(np.int64)
        nx, ny, nz = (end - first).tolist()
        if nx * ny * nz > most_cells:
            raise ValueError(
                f"bounds: got {nx * ny * nz} cells {nx, ny, nz}, expected at most {most_cells}"
            )
        return cls(resolution, tuple(first.tolist()), (nx, ny, nz))

    @property
    def origin(self) -> NDArray[np.float64]:
        """(3,) corner of the first cell, m, world."""
        shift = np.array([0.0, 0.0, FLOOR_HEIGHT_IN_CELL])
        origin: NDArray[np.float64] = (np.array(self.first) - shift) * self.resolution
        return origin

    @property
    def floor_layer(self) -> int:
        """Index along z of the layer that holds the plane z = 0; may lie outside."""
        return -self.first[2]

    def layers(self, first: int, end: int) -> Window:
        """Return the part of the window from one layer up to another."""
        x, y, z = self.first
        return Window(self.resolution, (x, y, z + first), (*self.shape[:2], end - first))

    def touched_by(self, boxes: NDArray[np.int64]) -> tuple[NDArray[np.int64], Columns | None]:
        """Return those of some boxes that meet the window, and where they meet it.

        Args:
            boxes: (k, 6) first cell and one past the last: x, y, z, x, y, z.

        Returns:
            These boxes, and the least rectangle of columns that holds them all, None without any.
        """
        touching, columns = np.empty(boxes.shape, np.int64), np.empty((2, 2), np.int64)
        count = kernels.touch(boxes, self.first, self.shape, touching, columns)
        (x0, x1), (y0, y1) = columns.tolist()
        return touching[:count], (slice(x0, x1), slice(y0, y1)) if count else None


def region_of_interest(
    low: ArrayLike | None,
    high: ArrayLike | None,
    resolution: float,
    most_cells: int = MAX_REGION_CELLS,
) -> Window | None:
    """Return the least window that covers a region of interest, None without corners.

    Raises:
        ValueError: Only one corner, or the region is empty, not finite or too large.
    """
    if low is None and high is None:
        return None
    if low is None or high is None:
        raise ValueError(f"low, high: got {low!r} and {high!r}, expected both corners or neither")
    return Window.covering(low, high, resolution, most_cells)


def layer_bits(first: int, end: int, layers: int) -> NDArray[np.uint64]:
    """Return the words (words,) of a column of `layers` cells with bits first to end set."""
    words = -(-layers // WORD_BITS)
    cells = np.arange(words * WORD_BITS)
    bits = np.packbits((first <= cells) & (cells < end), bitorder="little")
    return bits.view("<u8").astype(np.uint64)


def pack(cells: NDArray[np.bool_]) -> NDArray[np.uint64]:
    """Pack cells (nx, ny, 64 words) into columns (nx, ny, words): bit k of word w is 64 w + k."""
    return np.packbits(cells, axis=2, bitorder="little").view("<u8").astype(np.uint64, copy=False)


def unpack(words: NDArray[np.uint64], cells: int) -> NDArray[np.uint8]:
    """Unpack the first bits (nx, ny, cells) of columns (nx, ny, words), each 0 or 1."""
    content = np.ascontiguousarray(words, "<u8").view(np.uint8)
    return np.unpackbits(content, axis=2, count=cells, bitorder="little")


def states_in(source: ColumnMap, low: ArrayLike, high: ArrayLike) -> NDArray[np.uint8]:
    """Return the states (nx, ny, nz) of the cells with centres in a box, corners (3,) m, world."""
    first, end = cell_box(low, high, source.resolution)
    nx, ny, nz = (int(cells) for cells in end - first)
    x, y, z = (int(cell) for cell in first)
    occupied, free = source.columns((x, y, z), (nx, ny, -(-nz // WORD_BITS)))
    states = unpack(free, nz) * np.uint8(FREE)
    states += unpack(occupied, nz) * np.uint8(OCCUPIED)
    return states
