"""Distance transform within planes of constant x: the passes along z and y."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayproof.kernel_compiler import inlined, kernel
from wayproof.maps.kernels.edt import (
    FAR,
    UNIT,
    FieldLayout,
    NewCells,
    Sections,
    fill,
    planes_around,
)
from wayproof.maps.kernels.edt_changes import find_pending, replace_cells

WORD_BITS = 64
LONGEST_STEP = 128  # of the powers of two, the last below the greatest reach

BYTE = np.uint64(0xFF)
B01 = np.uint64(0x0101010101010101)
UNSET = np.array(
    [sum(0xFF << (8 * k) for k in range(8) if not byte >> k & 1) for byte in range(256)], np.uint64
)
"""Eight bytes by a byte of eight cells, all ones for a cell that is not set."""


class SectionScratch(NamedTuple):
    """Memory for `update_sections`.

    Attributes:
        changes: (blocks, 2) first and last changed column of each block of a plane.
        pending: (blocks,) the blocks of a plane that these may change.
        lines: (2, 2 * LONGEST_STEP + block_rows * pitch) distances along z, of a step and the last.
        eights: (2, ...) the same memory in words.
        along_z: ((blocks + 2 around) * cells,) squared distances along z of a plane; reach^2 on
            either side of its blocks.
        plane_of: (blocks,) the plane whose distances a block of `along_z` holds; -1: none.
        block: (cells,) squared distances of one block.
    """

    changes: NDArray[np.int64]
    pending: NDArray[np.bool_]
    lines: NDArray[np.uint8]
    eights: NDArray[np.uint64]
    along_z: NDArray[np.uint16]
    plane_of: NDArray[np.int64]
    block: NDArray[np.uint16]


@kernel
def blocks_around(reach: int, block_rows: int) -> int:
    """Return blocks on either side of one that sources may lie in: of four distances at once."""
    return int(-(-(reach + 3) // block_rows))


@kernel
def measure_rows(
    blocked: NDArray[np.uint64],  # (ny * words,) of a plane
    y: int,  # first row of the block; rows beyond the last one hold nothing
    layout: FieldLayout,
    lines: NDArray[np.uint8],  # (2, pad + block_rows * pitch + pad) scratch
    eights: NDArray[np.uint64],  # (2, ...) the same memory
    distances: NDArray[np.uint8],  # out from an index on
    at: int,
) -> bool:
    """Find the distances along z to the nearest blocked cell, at most reach.

    Distances along a line come from doubling: after steps of 1, 2, 4, ..., 2^m each cell knows the
    nearest within 2^(m+1) - 1. All rows are done as one line, kept apart by `reach` cells.

    Returns:
        Whether any cell is blocked.
    """
    nz, reach, block_rows, words = layout.shape[2], layout.reach, layout.block_rows, layout.words
    pitch = (lines.shape[1] - 2 * LONGEST_STEP) // block_rows
    far, nothing = np.uint64(reach) * B01, np.uint64(0)
    for k in range(eights.shape[1]):
        eights[0, k] = far
        eights[1, k] = far
    # Distance 0 for blocked cells and reach for others, eight cells at a time.
    united = nothing
    for row in range(min(block_rows, blocked.shape[0] // words - y)):
        for w in range(words):
            word = blocked[(y + row) * words + w]
            united |= word
            first_eight = (LONGEST_STEP + row * pitch + w * WORD_BITS) >> 3
            for k in range(min(8, (nz - w * WORD_BITS + 7) >> 3)):
                eights[0, first_eight + k] = UNSET[word & BYTE] & far
                word >>= np.uint64(8)
    # Double the distance that each cell has looked; nothing to find where no cell is blocked.
    source, target, step = int(np.int64(0)), int(np.int64(1)), 1
    while step < reach and united != nothing:
        apart, limit = np.uint64(step), np.uint8(255 - step)
        for k in range(np.uint64(LONGEST_STEP), np.uint64(lines.shape[1] - LONGEST_STEP)):
            nearer = min(lines[source, k - apart], lines[source, k + apart])
            through = np.uint8(min(nearer, limit) + np.uint8(step))
            lines[target, k] = min(lines[source, k], through)
        source, target = target, source
        step *= 2
    for row in range(block_rows):
        first, to = np.uint64(LONGEST_STEP + row * pitch), np.uint64(at + row * nz)
        for k in range(np.uint64(nz)):
            distances[to + k] = lines[source, first + k]
    return bool(united != nothing)


@kernel
def square(
    distances: NDArray[np.uint8],
    at: int,
    cells: int,
    squared: NDArray[np.uint16],  # out from an index on
    to: int,
) -> None:
    """Square some distances."""
    source, target = np.uint64(at), np.uint64(to)
    for k in range(np.uint64(cells)):
        distance = np.uint16(distances[source + k])
        squared[target + k] = np.uint16(distance * distance)


@kernel
def lower_rows(
    target: NDArray[np.uint16],  # (n,) in, out
    sources: NDArray[np.uint16],
    at: int,  # index of those at distance 0
    pitch: int,  # from there to the next ones on either side
    j: int,
    reach: int,
) -> int:
    """Lower each element to the values through the sources at distances j to j + 3.

    Eight sources at once, because loading and storing the target, and calling, would cost most of
    the time. What is farther than `reach` is taken as that far, and changes nothing.

    Returns:
        The greatest element.
    """
    e, f, g = min(j + 1, reach), min(j + 2, reach), min(j + 3, reach)
    first, second = np.uint16(j * j), np.uint16(e * e)
    third, fourth = np.uint16(f * f), np.uint16(g * g)
    step, below, above = np.uint64(pitch), np.uint64(at - j * pitch), np.uint64(at + j * pitch)
    below2, above2 = below - step, above + step
    below3, above3 = below2 - step, above2 + step
    below4, above4 = below3 - step, above3 + step
    greatest = np.uint16(0)
    for k in range(np.uint64(target.shape[0])):
        a = np.uint16(min(sources[below + k], sources[above + k]) + first)
        b = np.uint16(min(sources[below2 + k], sources[above2 + k]) + second)
        c = np.uint16(min(sources[below3 + k], sources[above3 + k]) + third)
        d = np.uint16(min(sources[below4 + k], sources[above4 + k]) + fourth)
        least = min(target[k], min(min(a, b), min(c, d)))
        target[k] = least
        greatest = max(greatest, least)
    return int(greatest)


@kernel
def copy_block(target: NDArray[np.uint16], sources: NDArray[np.uint16], at: int) -> int:
    """Copy from an index on; return the greatest element."""
    first, greatest = np.uint64(at), np.uint16(0)
    for k in range(np.uint64(target.shape[0])):
        target[k] = sources[first + k]
        greatest = max(greatest, target[k])
    return int(greatest)


@kernel
def store_unit(
    block: NDArray[np.uint16],  # from an index on
    at: int,
    cells: int,
    sections: NDArray[np.uint16],  # out from an index on
    to: int,
) -> tuple[np.uint16, np.uint16]:
    """Store a unit of a block in the sections.

    Returns:
        Its least element, and the least that came or went; FAR where none did.
    """
    source, first = np.uint64(at), np.uint64(to)
    least, changed = np.uint16(FAR), np.uint16(FAR)
    for k in range(np.uint64(cells)):
        new, old = block[source + k], sections[first + k]
        sections[first + k] = new
        least = min(least, new)
        changed = min(changed, min(new, old) if new != old else np.uint16(FAR))
    return least, changed


@inlined
def lower_block(
    block: NDArray[np.uint16],  # (cells,) out
    along_z: NDArray[np.uint16],  # ((blocks + 2 around) * cells,) squared distances along z
    first: int,  # index there of the block's own
    end: int,  # distance along y up to which to look
    nz: int,
    reach: int,
) -> int:
    """Compute the squared distances of a block from those along z; return the greatest.

    Rows ever farther away are looked at, while these can be nearer than what was found.
    """
    greatest = copy_block(block, along_z, first)
    j = 1
    while j < end and j * j < greatest:
        greatest = lower_rows(block, along_z, first, nz, j, reach)
        j += 4
    return greatest


@kernel
def update_sections(
    planes: tuple[int, int],  # first and one past the last to visit, along x
    new: NewCells,
    layout: FieldLayout,
    sections: Sections,  # in, out
    scratch: SectionScratch,
) -> None:
    """Take over new cells and compute the blocks of sections that they may change, plane by plane.

    A plane's blocks are computed right after its cells are taken over, while both are in the cache.
    The window's border, beyond which everything is blocked, is part of the pass along x.
    """
    (_, ny, nz), reach, block_rows = layout.shape, layout.reach, layout.block_rows
    new_cells, rows, (x0, y0), flip = new
    blocked, inside, distances, holds_any, squared, nearest, farthest, least_bound = sections
    changes, pending, lines, eights, along_z, plane_of, block = scratch
    (blocks, units, all_planes), cells = nearest.shape, block.shape[0]
    around, margin = blocks_around(reach, block_rows), planes_around(reach)

    fill(along_z, reach * reach)
    for b in range(blocks):
        plane_of[b] = -1
    for x in range(planes[0], planes[1]):
        if not replace_cells(
            new_cells[x - x0], rows, y0, flip, inside, layout, blocked[x], changes
        ):
            continue
        find_pending(changes, layout, farthest[x], pending)
        # Along z: measure the blocks that have new cells.
        for b in range(blocks):
            if changes[b, 0] >= 0:
                holds_any[x, b] = measure_rows(
                    blocked[x],
                    b * block_rows,
                    layout,
                    lines,
                    eights,
                    distances,
                    (x * blocks + b) * cells,
                )
        for b in range(blocks):
            if not pending[b]:
                continue
            any_near = False
            for c in range(max(0, b - around), min(blocks, b + around + 1)):
                any_near |= holds_any[x, c]
                if plane_of[c] != x:
                    plane_of[c] = x
                    at = (x * blocks + c) * cells
                    square(distances, at, cells, along_z, (c + around) * cells)
            # Along y.
            end = min(reach, ny) if any_near else 0
            first = (b + around) * cells
            farthest[x, b] = lower_block(block, along_z, first, end, nz, reach)
            # Store the block unit by unit, with the least of each for the pass along x.
            for unit in range(units):
                to = ((b * units + unit) * all_planes + margin + x) * UNIT
                first, size = unit * UNIT, min(UNIT, cells - unit * UNIT)
                least, changed = store_unit(block, first, size, squared, to)
                nearest[b, unit, margin + x] = least
                least_bound[b, x] = min(least_bound[b, x], changed)
