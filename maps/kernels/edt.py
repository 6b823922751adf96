"""Layout of the Euclidean distance transform (EDT), shared by the kernels of its passes.

The squared distance is a sum over the axes, so one exact pass per axis finds it (Felzenszwalb &
Huttenlocher 2012, "Distance transforms of sampled functions"): along z and y within planes of
constant x (`edt_sections`), then along x (`edt_field`). `edt_changes` finds what an update may
change.

A plane is cut into blocks of a few rows along y; a row holds the cells along z. Blocks are what is
recomputed or left alone. The cells of a block are cut into units, and units of one number lie side
by side for all planes, so that the pass along x works on four planes at once.

Cells lie in flat arrays and are addressed by an unsigned index, and records of arrays are unpacked
once, by the kernel that Python calls.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayproof.kernel_compiler import kernel

MAX_REACH = 181  # cells; twice its square still fits 16 bits
FAR = 32767  # above every squared distance; the greatest of them added, it still fits 16 bits
UNIT = 128  # cells of a block that lie together: beside those of the next plane


class FieldLayout(NamedTuple):
    """Extent of a field, and how it is cut.

    Attributes:
        shape: (nx, ny, nz) cells.
        reach: Greatest distance, cells; what is farther counts as that far.
        block_rows: Rows along y of a block.
        words: Words of 64 bits of a column along z.
    """

    shape: tuple[int, int, int]
    reach: int
    block_rows: int
    words: int


class Sections(NamedTuple):
    """Distances within planes of constant x, and their sources.

    Below, `around` is `planes_around(reach)`; planes outside the window hold reach^2.

    Attributes:
        blocked: (nx, ny * words) bits of the blocked cells.
        inside: (block_rows * words,) bits of a block that are cells of the window.
        along_z: (nx * blocks * cells,) distance along z to the nearest blocked cell, cells.
        holds_any: (nx, blocks) whether any cell is blocked.
        squared: (blocks * units * (around + nx + around) * UNIT,) squared distance in the plane.
        nearest: (blocks, units, around + nx + around) least of `squared` in each unit.
        farthest: (nx, blocks) greatest of `squared` in each block.
        least_bound: (blocks, nx) squared distances below it did not change; FAR where none did.
    """

    blocked: NDArray[np.uint64]
    inside: NDArray[np.uint64]
    along_z: NDArray[np.uint8]
    holds_any: NDArray[np.bool_]
    squared: NDArray[np.uint16]
    nearest: NDArray[np.uint16]
    farthest: NDArray[np.uint16]
    least_bound: NDArray[np.uint16]


class NewCells(NamedTuple):
    """New cells of a box of columns.

    Attributes:
        cells: (kx, ky * words) bits.
        rows: First row of them that may have changed, and one past the last; equal for none.
        corner: Place of the first column in the window, along x and y.
        flip: All ones where the bits are the cells that are not blocked, else 0.
    """

    cells: NDArray[np.uint64]
    rows: tuple[int, int]
    corner: tuple[int, int]
    flip: np.uint64


@kernel
def planes_around(reach: int) -> int:
    """Return the planes on either side of one that sources may lie in, of four at once.

    A distance less than the reach, three more, and three planes beside.
    """
    return reach + 5


@kernel
def border_distance(position: int, cells: int, reach: int) -> int:
    """Return the cells to the border along an axis, at most reach; an axis of one has none."""
    return min(position + 1, cells - position, reach) if cells > 1 else reach


@kernel
def fill(target: NDArray[np.uint16], value: int) -> None:
    """Set every element; a slice assignment does the same and takes a second to compile."""
    for k in range(target.shape[0]):
        target[k] = value
