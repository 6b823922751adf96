"""Incremental distance transform: which blocks new cells may change."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wayproof.kernel_compiler import kernel
from wayproof.maps.kernels.edt import FAR, FieldLayout


@kernel
def any_differ(
    cells: NDArray[np.uint64],
    first: int,  # word from which to compare
    flip: np.uint64,
    inside: NDArray[np.uint64],  # (block_rows * words,)
    blocked: NDArray[np.uint64],
    at: int,  # word from which to compare
    words: int,
) -> bool:
    """Return whether any of some words of new cells differ from those held."""
    source, held, found = np.uint64(first), np.uint64(at), np.uint64(0)
    for k in range(np.uint64(words)):
        found |= ((cells[source + k] ^ flip) & inside[k]) ^ blocked[held + k]
    return bool(found != np.uint64(0))


@kernel
def replace_cells(
    cells: NDArray[np.uint64],  # (ky * words,) new ones of a plane
    rows: tuple[int, int],  # of them to look at, see `NewCells`
    y0: int,  # row of the window in which they begin
    flip: np.uint64,
    inside: NDArray[np.uint64],  # (block_rows * words,)
    layout: FieldLayout,
    blocked: NDArray[np.uint64],  # (ny * words,) in, out
    changes: NDArray[np.int64],  # (blocks, 2) out: first and last changed column of each block; -1
) -> bool:
    """Take over the new cells of a plane; return whether any changed."""
    block_rows, words = layout.block_rows, layout.words
    found = False
    for b in range(changes.shape[0]):
        changes[b, 0], changes[b, 1] = -1, -1
        # The rows of this block that are new, as words of the source and of the target.
        low, high = b * block_rows, (b + 1) * block_rows
        low, high = max(low, y0 + rows[0]), min(high, y0 + rows[1])
        first, at, count = (low - y0) * words, low * words, (high - low) * words
        if count <= 0 or not any_differ(cells, first, flip, inside, blocked, at, count):
            continue
        for k in range(count):
            word = (cells[first + k] ^ flip) & inside[k]
            if word != blocked[at + k]:
                blocked[at + k] = word
                y = low + k // words
                if changes[b, 0] < 0:
                    changes[b, 0] = y
                changes[b, 1] = y
        found = True
    return found


@kernel
def find_pending(
    changes: NDArray[np.int64],  # (blocks, 2) as of `replace_cells`
    layout: FieldLayout,
    farthest: NDArray[np.uint16],  # (blocks,) greatest value of each block of the section
    pending: NDArray[np.bool_],  # (blocks,) out
) -> None:
    """Find the blocks of rows of a plane that its changed columns may change.

    A change at distance j along y brings or takes away values of j^2 or more. It matters only to a
    block that holds as much: less, and nothing there was attained through the changed column, nor
    can be.
    """
    reach, block_rows, blocks = layout.reach, layout.block_rows, changes.shape[0]
    # Upwards along y: the nearest change in or below each block.
    below = -reach
    for b in range(blocks):
        j = 0 if changes[b, 0] >= 0 else b * block_rows - below
        pending[b] = j < reach and j * j <= farthest[b]
        below = changes[b, 1] if changes[b, 1] >= 0 else below
    # And downwards: the nearest one above each.
    above = blocks * block_rows + reach
    for b in range(blocks - 1, -1, -1):
        j = above - (b + 1) * block_rows + 1
        pending[b] |= j < reach and j * j <= farthest[b]
        above = changes[b, 0] if changes[b, 0] >= 0 else above


@kernel
def spread_bounds(
    least_bound: NDArray[np.uint16],  # (nx,) of a row of blocks
    reach: int,
    reached: NDArray[np.uint16],  # (nx,) out
) -> bool:
    """Find the least value of each block that changes around may bring or take away.

    Returns:
        Whether there are any changes.
    """
    nx, found = least_bound.shape[0], False
    for x in range(nx):
        reached[x] = least_bound[x]
        found |= least_bound[x] != FAR
    if not found:
        return False
    for j in range(1, reach):
        farther, step = np.uint16(j * j), np.uint64(j)
        for x in range(step, np.uint64(nx)):
            reached[x] = min(reached[x], np.uint16(least_bound[x - step] + farther))
        for x in range(np.uint64(max(nx - j, 0))):
            reached[x] = min(reached[x], np.uint16(least_bound[x + step] + farther))
    return True


@kernel
def find_stale(
    reach: int,
    farthest: NDArray[np.uint16],  # (blocks, nx) greatest value of each block of the field
    least_bound: NDArray[np.uint16],  # (blocks, nx) of the sections; FAR afterwards
    stale: NDArray[np.bool_],  # (blocks, nx) in, out
    reached: NDArray[np.uint16],  # (nx,) scratch
) -> None:
    """Find the blocks of the field that changes of the sections may change, as along y."""
    for b in range(stale.shape[0]):
        if not spread_bounds(least_bound[b], reach, reached):
            continue
        for x in range(reached.shape[0]):
            stale[b, x] |= reached[x] <= farthest[b, x]
            least_bound[b, x] = FAR
