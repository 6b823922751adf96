"""Widening of blocked cells along x and y: a margin that differs by axis."""

from __future__ import annotations

from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from wayproof.maps.columns import WORD_BITS, Columns, layer_bits, pack, unpack

Words = NDArray[np.uint64]
C = TypeVar("C", np.bool_, np.uint64)

EVERY = 0xFFFFFFFFFFFFFFFF
"""Word of 64 set bits."""

NOT_WIDENED = (0, 0)
"""Widening by no cells."""


class Widened(NamedTuple):
    """Cells of a window in rows of bits, as `Projection` has them, after widening.

    Attributes:
        free: (rows_x, rows_y, words) bits.
        occupied: (rows_x, rows_y, words) bits.
    """

    free: Words
    occupied: Words


def widened(
    free: Words, occupied: Words, rows: tuple[int, int, int], flat: bool, cells: tuple[int, int]
) -> Widened:
    """Block cells with an occupied cell within some cells along x and y, and unfree them likewise.

    Outside the window all is occupied. Distances to what this returns are those to rectangles
    about the cells, so that a disc keeps its margin and the widening from them.

    Args:
        free: (rows_x, rows_y, words) bits of free cells.
        occupied: (rows_x, rows_y, words) bits of occupied cells.
        rows: (rows_x, rows_y, cells) number of rows and bits.
        flat: Whether the bits of a row lie along y, not along z.
        cells: Widening along x and y, to both sides.
    """
    if flat:
        cleared, held = (unpack(words, rows[2])[:, 0] > 0 for words in (free, occupied))
        return Widened(
            _row_bits(~_dilated(_dilated(~cleared, cells[0], 0, True), cells[1], 1, True)),
            _row_bits(_dilated(_dilated(held, cells[0], 0, True), cells[1], 1, True)),
        )
    within = layer_bits(0, rows[2], rows[2])
    not_free = _dilated(_dilated(~free, cells[0], 0, EVERY), cells[1], 1, EVERY)
    blocked = _dilated(_dilated(occupied, cells[0], 0, EVERY), cells[1], 1, EVERY)
    return Widened(~not_free & within, blocked & within)


def reached(box: Columns, rows: tuple[int, int, int], cells: tuple[int, int]) -> Columns:
    """Return the columns of words that changed columns may change by widening."""
    return (
        slice(max(box[0].start - cells[0], 0), min(box[0].stop + cells[0], rows[0])),
        slice(max(box[1].start - cells[1], 0), min(box[1].stop + cells[1], rows[1])),
    )


def _row_bits(cells: NDArray[np.bool_]) -> Words:
    """Pack a plane of cells (nx, ny) into rows of bits along y, (nx, 1, words)."""
    missing = -cells.shape[1] % WORD_BITS
    return pack(np.pad(cells, ((0, 0), (0, missing)))[:, None])


def _dilated(cells: NDArray[C], reach: int, axis: int, beyond: int | bool) -> NDArray[C]:
    """Spread each cell up to a reach to both sides along an axis; `beyond` lies outside.

    By doubling: n shifts cover 2^n cells.
    """
    if reach == 0:
        return cells
    pad = [(reach, reach) if one == axis else (0, 0) for one in range(cells.ndim)]
    dilated = np.moveaxis(np.pad(cells, pad, constant_values=beyond), axis, 0)
    covered, width = 1, 2 * reach + 1
    while covered < width:
        step = min(covered, width - covered)
        dilated = dilated[:-step] | dilated[step:]
        covered += step
    return np.ascontiguousarray(np.moveaxis(dilated, 0, axis))
