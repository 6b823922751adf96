"""Compiled kernels of the distance field: one exact pass per axis, over blocks of rows.

A plane of constant x is cut into blocks of a few rows along y; a row holds the cells along z, its
length rounded up. Blocks are what is recomputed or left. All kernels live in this file because a
cached kernel is not recompiled when another file changes.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from maps._jit import kernel

WORD_BITS = 64
NO_CHANGE = 65535  # above every squared distance
MAX_REACH = 181  # cells; twice its square still fits 16 bits
LONGEST_STEP = 128  # of the powers of two, the last below the greatest reach


@kernel
def note_changes(
    blocked: NDArray[np.uint64],  # (kx, ky, words) the new cells of a box of columns
    x0: int,
    y0: int,
    inside: NDArray[np.uint64],  # (words,) the bits that are cells of the window
    reach: int,
    block_rows: int,
    farthest: NDArray[np.uint16],  # (nx, blocks) greatest value of each block of `sections`
    known: NDArray[np.uint64],  # (nx, ny, words) in, out
    stale: NDArray[np.bool_],  # (nx, blocks) out: what a changed column may reach
) -> None:
    """Take over the new cells, and mark the blocks of rows that they may change.

    A change at distance j along y matters only to a block that holds a value of j^2 or more: less
    and nothing there was attained through the changed column, nor can be.
    """
    columns_x, columns_y, words = blocked.shape
    blocks = stale.shape[1]
    for i in range(columns_x):
        for k in range(columns_y):
            changed = False
            for w in range(words):
                word = blocked[i, k, w] & inside[w]
                changed |= word != known[x0 + i, y0 + k, w]
                known[x0 + i, y0 + k, w] = word
            if not changed:
                continue
            x, y = x0 + i, y0 + k
            first = max(0, y - reach + 1) // block_rows
            for b in range(first, min(blocks, (y + reach - 1) // block_rows + 1)):
                j = max(0, b * block_rows - y, y - (b + 1) * block_rows + 1)
                stale[x, b] |= j * j <= farthest[x, b]


@kernel
def lower(
    target: NDArray[np.uint16],  # (n,) in, out
    below: NDArray[np.uint16],  # (n,) sources at distance j on either side
    above: NDArray[np.uint16],
    next_below: NDArray[np.uint16],  # (n,) and at j + 1
    next_above: NDArray[np.uint16],
    j: int,
) -> int:
    """Lower each element to what leads through the sources; return the greatest element.

    Four sources at once, because loading and storing the target would cost most of the time.
    """
    near, far = np.uint16(j * j), np.uint16((j + 1) * (j + 1))
    greatest = np.uint16(0)
    for k in range(target.shape[0]):
        through = np.uint16(min(below[k], above[k]) + near)
        farther = np.uint16(min(next_below[k], next_above[k]) + far)
        least = min(target[k], min(through, farther))
        target[k] = least
        greatest = max(greatest, least)
    return int(greatest)


@kernel
def copy_block(target: NDArray[np.uint16], source: NDArray[np.uint16]) -> int:
    """Copy, and return the greatest element."""
    greatest = np.uint16(0)
    for k in range(target.shape[0]):
        target[k] = source[k]
        greatest = max(greatest, source[k])
    return int(greatest)


@kernel
def fill(target: NDArray[np.uint16], value: int) -> None:
    """Set every element; a slice assignment does the same and takes a second to compile."""
    for k in range(target.shape[0]):
        target[k] = value


@kernel
def note_result(
    result: NDArray[np.uint16],  # (n,)
    kept: NDArray[np.uint16],  # (n,) in, out
) -> tuple[int, int]:
    """Keep a result; its least element, and the least that it brought or took away."""
    least = change = np.uint16(NO_CHANGE)
    for k in range(result.shape[0]):
        lesser = min(result[k], kept[k])
        change = min(change, lesser if result[k] != kept[k] else np.uint16(NO_CHANGE))
        least = min(least, result[k])
        kept[k] = result[k]
    return int(least), int(change)


@kernel
def measure_rows(
    blocked: NDArray[np.uint64],  # (rows, words); rows of the block that are missing hold nothing
    reach: int,
    nz: int,
    row_cells: int,
    work: NDArray[np.uint16],  # (2, pad + block_rows * (row_cells + reach) + pad) scratch
    squared: NDArray[np.uint16],  # (block_rows * row_cells,) out
) -> bool:
    """Squared distance along z to the nearest blocked cell; whether there is any.

    Distances along a line come from doubling: after steps of 1, 2, 4, ..., 2^m each cell knows the
    nearest within 2^(m+1) - 1. All rows are done as one line, kept apart by `reach` cells.
    """
    rows, words = blocked.shape
    block_rows = squared.shape[0] // row_cells
    united = np.uint64(0)
    for row in range(rows):
        for w in range(words):
            united |= blocked[row, w]
    if united == 0:
        fill(squared, reach * reach)
        return False

    pitch = row_cells + reach
    pad = (work.shape[1] - block_rows * pitch) // 2
    end = work.shape[1] - pad
    source, target = work[0], work[1]
    fill(source, reach)
    fill(target, reach)
    for row in range(rows):
        for w in range(words):
            word = blocked[row, w]
            first = pad + row * pitch + w * WORD_BITS
            cells = source[first : first + min(WORD_BITS, row_cells - w * WORD_BITS)]
            for k in range(cells.shape[0]):
                bit = (word >> np.uint64(k)) & np.uint64(1)
                cells[k] = np.uint16(reach) * np.uint16(np.uint64(1) - bit)
    step = 1
    while step < reach:
        below, middle = source[pad - step : end - step], source[pad:end]
        above, lowered = source[pad + step : end + step], target[pad:end]
        for k in range(middle.shape[0]):
            through = np.uint16(min(below[k], above[k]) + np.uint16(step))
            lowered[k] = min(middle[k], through)
        source, target = target, source
        step *= 2
    for row in range(block_rows):
        distances = source[pad + row * pitch : pad + row * pitch + row_cells]
        squares = squared[row * row_cells : (row + 1) * row_cells]
        for k in range(nz):
            squares[k] = np.uint16(distances[k] * distances[k])
        for k in range(nz, row_cells):  # no cells: they must not hold a value of their own
            squares[k] = squares[nz - 1]
    return True


@kernel
def blocks_around(reach: int, block_rows: int) -> int:
    """Blocks on either side of one that sources may lie in."""
    return -(-(reach + 1) // block_rows)


@kernel
def update_sections(
    planes: NDArray[np.int64],  # (m,) indices along x
    known: NDArray[np.uint64],  # (nx, ny, words)
    reach: int,
    nz: int,
    block_rows: int,
    row_cells: int,
    stale: NDArray[np.bool_],  # (nx, blocks) in; false afterwards
    sections: NDArray[np.uint16],  # (nx + 1, blocks, block_rows * row_cells) in, out
    farthest: NDArray[np.uint16],  # (nx, blocks) out
    nearest: NDArray[np.uint16],  # (nx + 1, blocks) out: least value of each block
    least_change: NDArray[np.uint16],  # (nx, blocks) out: least value that came or went
    along: NDArray[np.uint16],  # ((blocks + 2 around) * cells,) scratch
    work: NDArray[np.uint16],  # (2, 2 * LONGEST_STEP + block_rows * (row_cells + reach)) scratch
    result: NDArray[np.uint16],  # (cells,) scratch
    holds_any: NDArray[np.bool_],  # (blocks,) scratch
    measured: NDArray[np.int64],  # (blocks,) scratch: the plane that each block belongs to
) -> None:
    """The squared distance within planes of constant x, in their stale blocks."""
    ny = known.shape[1]
    blocks, cells = sections.shape[1:]
    around = blocks_around(reach, block_rows)
    fill(along, reach * reach)  # beyond the window nothing is blocked: its border comes at the end
    for b in range(blocks):
        measured[b] = -1
    for x in planes:
        for b in range(blocks):
            if not stale[x, b]:
                continue
            stale[x, b] = False
            any_near = False
            for c in range(max(0, b - around), min(blocks, b + around + 1)):
                if measured[c] != x:
                    measured[c] = x
                    first = (c + around) * cells
                    rows = known[x, c * block_rows : min(ny, (c + 1) * block_rows)]
                    holds_any[c] = measure_rows(
                        rows, reach, nz, row_cells, work, along[first : first + cells]
                    )
                any_near |= holds_any[c]
            first = (b + around) * cells
            greatest = copy_block(result, along[first : first + cells])
            j = 1 if any_near else reach
            while j < reach and j * j < greatest:
                near, far = j * row_cells, (j + 1) * row_cells
                greatest = lower(
                    result,
                    along[first - near : first - near + cells],
                    along[first + near : first + near + cells],
                    along[first - far : first - far + cells],
                    along[first + far : first + far + cells],
                    j,
                )
                j += 2
            farthest[x, b] = greatest
            nearest[x, b], least_change[x, b] = note_result(result, sections[x, b])


@kernel
def spread_changes(
    least_change: NDArray[np.uint16],  # (nx, blocks) in; no change afterwards
    reach: int,
    farthest: NDArray[np.uint16],  # (nx, blocks) greatest value of each block of the field
    stale: NDArray[np.bool_],  # (nx, blocks) out
) -> None:
    """Mark the blocks of the field that a change of a section may reach, as along y."""
    nx, blocks = stale.shape
    for x in range(nx):
        for b in range(blocks):
            change = int(least_change[x, b])
            if change == NO_CHANGE:
                continue
            least_change[x, b] = NO_CHANGE
            for i in range(max(0, x - reach + 1), min(nx, x + reach)):
                stale[i, b] |= change + (i - x) * (i - x) <= farthest[i, b]


@kernel
def border_distance(position: int, cells: int, reach: int) -> int:
    """Cells to the nearest one outside along an axis, at most reach; an axis of one has none."""
    return min(position + 1, cells - position, reach) if cells > 1 else reach


@kernel
def update_field(
    stale: NDArray[np.int64],  # (m, 2) block and plane
    sections: NDArray[np.uint16],  # (nx + 1, blocks, block_rows * row_cells)
    nearest: NDArray[np.uint16],  # (nx + 1, blocks)
    reach: int,
    block_rows: int,
    row_cells: int,
    farthest: NDArray[np.uint16],  # (nx, blocks) out
    squared: NDArray[np.uint16],  # (nx, ny, nz) out
    result: NDArray[np.uint16],  # (block_rows * row_cells,) scratch
    border: NDArray[np.uint16],  # (nz,) scratch
) -> None:
    """The squared distance in stale blocks, from the sections of the planes around them.

    What lies outside the window is blocked: the nearest such cell is straight across a border.
    """
    nx, ny, nz = squared.shape
    for z in range(nz):
        border[z] = border_distance(z, nz, reach) ** 2
    for m in range(stale.shape[0]):
        b, x = stale[m]
        greatest = copy_block(result, sections[x, b])
        j = int(np.int64(1))  # a plain 1 would be compiled for itself
        while j < reach and j * j < greatest:
            # Plane nx holds nothing; it stands for those outside.
            below, above = (x - j if x >= j else nx), min(x + j, nx)
            next_below, next_above = (x - j - 1 if x > j else nx), min(x + j + 1, nx)
            near = min(nearest[below, b], nearest[above, b]) + j * j
            far = min(nearest[next_below, b], nearest[next_above, b]) + (j + 1) * (j + 1)
            if min(near, far) < greatest:
                greatest = lower(
                    result,
                    sections[below, b],
                    sections[above, b],
                    sections[next_below, b],
                    sections[next_above, b],
                    j,
                )
            j += 2
        greatest_within = np.uint16(0)
        for y in range(b * block_rows, min(ny, (b + 1) * block_rows)):
            across = min(border_distance(x, nx, reach), border_distance(y, ny, reach))
            squared_across = np.uint16(across * across)
            row = squared[x, y]
            first = (y - b * block_rows) * row_cells
            source = result[first : first + nz]
            for z in range(nz):
                row[z] = min(source[z], min(border[z], squared_across))
                greatest_within = max(greatest_within, row[z])
        farthest[x, b] = greatest_within
