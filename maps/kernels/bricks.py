"""Kernels of bricks: the states of their cells, read as columns, at points and along rays.

A brick is 16 x 16 columns of 64 cells. The log-odds of a column are one cache line, and a bit for
each of its cells is one word. Eight cells are often looked at together, so a brick's cells are also
seen as words; the byte order is little-endian, as on every processor that numba knows.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayproof.kernel_compiler import allocating, kernel
from wayproof.maps.kernels.slot_directory import Integer, SlotDirectory, find
from wayproof.maps.states import FREE, OCCUPIED, UNKNOWN

EDGE_BITS = 4
EDGE = 1 << EDGE_BITS  # columns along a brick's edge
HEIGHT = 64  # cells
COLUMNS = EDGE * EDGE
BELOW_FLOOR = 2  # layers: else the noise of the floor's returns would open a second brick

BYTE = np.uint64(0xFF)
B7F = np.uint64(0x7F7F7F7F7F7F7F7F)
B80 = np.uint64(0x8080808080808080)
GATHER = np.uint64(0x0102040810204080)  # faces eight bytes of 0 or 1: their bits, in the top byte


class BrickArrays(NamedTuple):
    """Bricks of a map, one in each slot.

    Attributes:
        cells: (slots, COLUMNS, 64) log-odds in units.
        eights: (slots, COLUMNS, 8) the same memory, eight cells a word.
        fresh: (slots, COLUMNS) bits of the cells that were updated since the last tick of decay.
        settled: (slots, COLUMNS) bits of cells known to lie at the lower clamp.
        observed_ns: (slots,) time of the last observation, ns.
        ticks: (slots,) number of ticks that the cells have seen.
        dues: (slots,) tick at which a brick has to be looked at.
        stamps: (slots,) stamp of the last change of a state.
        dirty: (slots,) whether the digest of the content is out of date.
    """

    cells: NDArray[np.int8]
    eights: NDArray[np.uint64]
    fresh: NDArray[np.uint64]
    settled: NDArray[np.uint64]
    observed_ns: NDArray[np.int64]
    ticks: NDArray[np.int64]
    dues: NDArray[np.int64]
    stamps: NDArray[np.int64]
    dirty: NDArray[np.bool_]


@kernel
def column_states(
    eights: NDArray[np.uint64],  # (8,)
    settled: np.uint64,  # cells known to lie at the lower clamp
) -> tuple[np.uint64, np.uint64]:
    """Find the occupied and the free cells of a column, a bit each."""
    occupied, free = np.uint64(0), settled
    shift = np.uint64(0)
    for k in range(8):
        # Eight cells at a time: the signs of their bytes, gathered into one byte of bits.
        eight = eights[k] if (settled >> shift) & BYTE != BYTE else np.uint64(0)
        if eight != 0:
            above = ((((eight & B7F) + B7F) | eight) & ~eight & B80) >> np.uint64(7)
            below = (eight & B80) >> np.uint64(7)
            occupied |= ((above * GATHER) >> np.uint64(56)) << shift
            free |= ((below * GATHER) >> np.uint64(56)) << shift
        shift += np.uint64(8)
    return occupied, free


@kernel
def write_block(
    directory: SlotDirectory,
    eights: NDArray[np.uint64],  # (slots, COLUMNS, 8)
    settled: NDArray[np.uint64],  # (slots, COLUMNS)
    block: tuple[Integer, Integer],  # index of the bricks along x and y
    low: tuple[int, int, int],  # least cell of the window
    occupied: NDArray[np.uint64],  # (nx, ny, words) in, out
    free: NDArray[np.uint64],  # (nx, ny, words) in, out
) -> None:
    """Write the states of the columns of a window that lie in bricks above each other."""
    heads, links, keys = directory
    nx, ny, words = occupied.shape
    bx, by = block
    first_x, end_x = max(bx * EDGE, low[0]), min(bx * EDGE + EDGE, low[0] + nx)
    first_y, end_y = max(by * EDGE, low[1]), min(by * EDGE + EDGE, low[1] + ny)
    for x in range(first_x - low[0], end_x - low[0]):
        for y in range(first_y - low[1], end_y - low[1]):
            for word in range(words):
                occupied[x, y, word] = 0
                free[x, y, word] = 0
    # The words of a brick lie across two of the window, unless both begin at one height.
    bottom = low[2] + BELOW_FLOOR
    first_z, shift = bottom >> 6, np.uint64(bottom & 63)
    back = np.uint64(64) - shift
    for k in range(words + (1 if shift != 0 else 0)):
        slot = find(heads, links, keys, bx, by, first_z + k)
        if slot < 0:
            continue
        for x in range(first_x, end_x):
            for y in range(first_y, end_y):
                column = (x - bx * EDGE) * EDGE + y - by * EDGE
                taken, clear = column_states(eights[slot, column], settled[slot, column])
                i, j = x - low[0], y - low[1]
                if k < words:
                    occupied[i, j, k] |= taken >> shift
                    free[i, j, k] |= clear >> shift
                if k > 0 and shift != 0:
                    occupied[i, j, k - 1] |= taken << back
                    free[i, j, k - 1] |= clear << back


@kernel
def list_blocks(
    boxes: NDArray[np.int64],  # (k, 6) first cell and one past the last: x, y, z, x, y, z
    low: tuple[int, int, int],  # least cell of a window
    size: tuple[int, int],  # columns of the window along x and y
    touched: NDArray[np.bool_],  # (bx, by) of the window's blocks; false before
    blocks: NDArray[np.int64],  # (bx * by, 2) out: indices along x and y
) -> int:
    """List the blocks, 16 x 16 columns, where boxes meet a window; return their number."""
    corner_x, corner_y = low[0] >> EDGE_BITS, low[1] >> EDGE_BITS
    for k in range(boxes.shape[0]):
        x0 = min(max(boxes[k, 0], low[0]), low[0] + size[0])
        x1 = min(max(boxes[k, 3], low[0]), low[0] + size[0])
        y0 = min(max(boxes[k, 1], low[1]), low[1] + size[1])
        y1 = min(max(boxes[k, 4], low[1]), low[1] + size[1])
        for x in range((x0 >> EDGE_BITS) - corner_x, ((x1 - 1) >> EDGE_BITS) + 1 - corner_x):
            for y in range((y0 >> EDGE_BITS) - corner_y, ((y1 - 1) >> EDGE_BITS) + 1 - corner_y):
                touched[x, y] = True
    count = int(np.int64(0))
    for x in range(touched.shape[0]):
        for y in range(touched.shape[1]):
            if touched[x, y]:
                blocks[count, 0], blocks[count, 1] = corner_x + x, corner_y + y
                count += 1
    return count


@kernel
def rewrite_columns(
    directory: SlotDirectory,
    eights: NDArray[np.uint64],  # (slots, COLUMNS, 8)
    settled: NDArray[np.uint64],  # (slots, COLUMNS)
    blocks: NDArray[np.int64],  # (k, 2) indices of bricks along x and y
    low: tuple[int, int, int],  # least cell of the window
    occupied: NDArray[np.uint64],  # (nx, ny, words) in, out
    free: NDArray[np.uint64],  # (nx, ny, words) in, out
) -> None:
    """Write the states of some columns of a window."""
    for n in range(blocks.shape[0]):
        block = blocks[n, 0], blocks[n, 1]
        write_block(directory, eights, settled, block, low, occupied, free)


@kernel
def column_of(x: Integer, y: Integer) -> Integer:
    """Return the index of a column of cells in its brick."""
    return ((x & (EDGE - 1)) << EDGE_BITS) + (y & (EDGE - 1))


@kernel
def look_up(
    directory: SlotDirectory,
    cells: NDArray[np.int8],  # (slots, COLUMNS, 64)
    queries: NDArray[np.int64],  # (n, 3) cells
    slots: NDArray[np.int64],  # (n,) out: -1 where nothing is held
    values: NDArray[np.int8],  # (n,) out, 0 there
) -> None:
    """Look up the log-odds of cells as their bricks hold them."""
    heads, links, keys = directory
    for i in range(queries.shape[0]):
        x, y, z = queries[i, 0], queries[i, 1], queries[i, 2] + BELOW_FLOOR
        slot = find(heads, links, keys, x >> EDGE_BITS, y >> EDGE_BITS, z >> 6)
        slots[i] = slot
        values[i] = cells[slot, column_of(x, y), z & 63] if slot >= 0 else 0


@allocating
def cast_ray(
    directory: SlotDirectory,
    cells: NDArray[np.int8],  # (slots, COLUMNS, 64)
    origin: NDArray[np.float64],  # (3,) in cells
    direction: NDArray[np.float64],  # (3,) unit
    reach: float,  # cells
    stop_at_unknown: bool,
) -> tuple[float, int]:
    """Follow a ray from cell to cell up to an occupied (or unknown) one.

    Amanatides & Woo (1987), "A fast voxel traversal algorithm for ray tracing".

    Returns:
        Distance at which the ray enters that cell, cells, and its state; `reach` and FREE if none.
    """
    heads, links, keys = directory
    cell, step = np.empty(3, np.int64), np.empty(3, np.int64)
    # Along each axis: the distance at which the ray meets the next face, and from face to face.
    faces, pitches = np.empty(3), np.empty(3)
    for axis in range(3):
        faces[axis] = pitches[axis] = np.inf
        cell[axis] = np.int64(np.floor(origin[axis]))
        step[axis] = 1 if direction[axis] > 0.0 else -1
        if direction[axis] != 0.0:
            face = cell[axis] + (1 if direction[axis] > 0.0 else 0)
            faces[axis] = (face - origin[axis]) / direction[axis]
            pitches[axis] = abs(1.0 / direction[axis])
    distance = 0.0
    while distance <= reach:
        z = cell[2] + BELOW_FLOOR
        slot = find(heads, links, keys, cell[0] >> EDGE_BITS, cell[1] >> EDGE_BITS, z >> 6)
        value = np.int64(cells[slot, column_of(cell[0], cell[1]), z & 63]) if slot >= 0 else 0
        if value > 0:
            return distance, OCCUPIED
        if value == 0 and stop_at_unknown:
            return distance, UNKNOWN
        # Step over the nearest face.
        axis = 0 if faces[0] <= faces[1] and faces[0] <= faces[2] else 1
        if faces[2] < faces[axis]:
            axis = 2
        distance = faces[axis]
        faces[axis] += pitches[axis]
        cell[axis] += step[axis]
    return reach, FREE
