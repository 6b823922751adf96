"""Compiled kernels of labels: a directory of cells, and their votes.

All kernels that call each other live in this file because a cached kernel is not recompiled when
another file changes.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from maps._beam_kernels import DROPPED_MM, FLOOR_SUBCELLS, NO_RETURN_MM, SUBCELL_BITS, SUBCELLS
from maps._jit import kernel

MOST_VOTES = np.uint32(0xFFFFFFFF)
UNLABELLED = 255
MASK = (1 << 48) - 1
FAR = 2.0**48  # sub-cells
SEEDS = np.array([0x9E3779B97F4A7C15, 0xD1B54A32D192ED03], np.uint64)
FACTORS = np.array([0xBF58476D1CE4E5B9, 0x94D049BB133111EB], np.uint64)


@kernel
def seek(
    directory: NDArray[np.int32],  # (2^k,) row of a cell, or -1; never full
    cells: NDArray[np.int64],  # (rows, 3)
    x: int,
    y: int,
    z: int,
) -> int:
    """The entry of a cell, or the empty one where it belongs: linear probing.

    The hash is that of Teschner et al. 2003, "Optimized spatial hashing".
    """
    last = directory.shape[0] - 1
    entry = ((x * 73856093) ^ (y * 19349663) ^ (z * 83492791)) & last
    while True:
        row = int(directory[entry])
        if row < 0 or (cells[row, 0] == x and cells[row, 1] == y and cells[row, 2] == z):
            return int(entry)
        entry = (entry + 1) & last


@kernel
def look_up(
    directory: NDArray[np.int32],
    cells: NDArray[np.int64],
    wanted: NDArray[np.int64],  # (n, 3)
    rows: NDArray[np.int64],  # (n,) out: -1 where there are no votes
) -> None:
    """Find the rows of cells."""
    for i in range(wanted.shape[0]):
        rows[i] = directory[seek(directory, cells, wanted[i, 0], wanted[i, 1], wanted[i, 2])]


@kernel
def mixed(x: int, y: int, z: int, label: int, seed: np.uint64) -> np.uint64:
    """64 bits for a vote (the finaliser of Steele et al. 2014, "SplitMix")."""
    word = np.uint64(x & MASK) * seed + np.uint64(y & MASK)
    word = word * FACTORS[0] + np.uint64(z & MASK)
    word = word * FACTORS[1] + np.uint64(label) + seed
    word = (word ^ (word >> np.uint64(30))) * FACTORS[0]
    word = (word ^ (word >> np.uint64(27))) * FACTORS[1]
    return np.uint64(word ^ (word >> np.uint64(31)))


@kernel
def end_cells(
    origins: NDArray[np.float64],  # (m, 3) m, world
    moments: NDArray[np.int32],  # (n,) origin of each beam; (0,) if all start at the first
    directions: NDArray[np.float64],  # (n, 3)
    ranges_mm: NDArray[np.uint16],  # (n,)
    limits_mm: tuple[int, int],  # nearest and farthest return
    labels: NDArray[np.uint8],  # (n,)
    resolution: float,
    voters: NDArray[np.int64],  # (n, 3) out: cells
    votes: NDArray[np.uint8],  # (n,) out
) -> int:
    """The cells that labelled beams with a return end in, as a map has them; their number."""
    scale = SUBCELLS / resolution
    count = 0
    for i in range(ranges_mm.shape[0]):
        millimetres = int(ranges_mm[i])
        if labels[i] == UNLABELLED or millimetres == DROPPED_MM or millimetres == NO_RETURN_MM:
            continue
        if not limits_mm[0] <= millimetres <= limits_mm[1]:
            continue
        k = int(moments[i]) if moments.shape[0] > 0 else 0
        length = millimetres / 1000.0
        inside = True
        for axis in range(3):
            place = np.floor((origins[k, axis] + directions[i, axis] * length) * scale)
            inside &= abs(place) < FAR  # not if not finite
            whole = int(place) if inside else 0
            voters[count, axis] = (whole + (FLOOR_SUBCELLS if axis == 2 else 0)) >> SUBCELL_BITS
        votes[count] = labels[i]
        count += inside
    return count


@kernel
def vote(
    directory: NDArray[np.int32],
    cells: NDArray[np.int64],
    votes: NDArray[np.uint32],  # (rows, classes)
    winners: NDArray[np.uint8],  # (rows,) the class with the most votes, the least of equal ones
    used: int,
    voters: NDArray[np.int64],  # (n, 3) cells
    labels: NDArray[np.uint8],  # (n,)
    sums: NDArray[np.uint64],  # (2,) in, out: of what all votes are mixed to
    box: NDArray[np.int64],  # (2, 3) out: least and greatest cell whose winner changed
) -> tuple[int, int]:
    """Count votes in order; return the number of rows in use, and of votes without room."""
    lost = 0
    row = -1
    for i in range(voters.shape[0]):
        x, y, z = voters[i, 0], voters[i, 1], voters[i, 2]
        # Beams that lie side by side often end in one cell.
        if row < 0 or cells[row, 0] != x or cells[row, 1] != y or cells[row, 2] != z:
            entry = seek(directory, cells, x, y, z)
            row = int(directory[entry])
            if row < 0:
                if used == cells.shape[0]:
                    lost += 1
                    continue
                row = used
                directory[entry] = row
                cells[row, 0], cells[row, 1], cells[row, 2] = x, y, z
                winners[row] = UNLABELLED
                used += 1
        label = int(labels[i])
        if votes[row, label] == MOST_VOTES:
            continue
        votes[row, label] += np.uint32(1)
        for lane in range(2):
            sums[lane] += mixed(x, y, z, label, SEEDS[lane])
        best = int(winners[row])
        most = votes[row, best] if best != UNLABELLED else np.uint32(0)
        if votes[row, label] > most or (votes[row, label] == most and label < best):
            winners[row] = label
            for axis in range(3):
                box[0, axis] = min(box[0, axis], voters[i, axis])
                box[1, axis] = max(box[1, axis], voters[i, axis])
    return used, lost


@kernel
def swell(
    cells: NDArray[np.int64],  # (k, 3)
    squared: NDArray[np.int64],  # (k,) radius of the ball around each, cells^2
    low: tuple[int, int, int],  # least cell of the window
    grown: NDArray[np.uint64],  # (nx, ny, words) in, out
) -> None:
    """Set the bits of all that lies within a distance of cells."""
    nx, ny, words = grown.shape
    for i in range(cells.shape[0]):
        reach = int(np.sqrt(float(squared[i])))
        x0, y0, z0 = cells[i, 0] - low[0], cells[i, 1] - low[1], cells[i, 2] - low[2]
        for x in range(max(x0 - reach, 0), min(x0 + reach + 1, nx)):
            for y in range(max(y0 - reach, 0), min(y0 + reach + 1, ny)):
                left = squared[i] - (x - x0) ** 2 - (y - y0) ** 2
                for z in range(max(z0 - reach, 0), min(z0 + reach + 1, 64 * words)):
                    if (z - z0) ** 2 <= left:
                        grown[x, y, z >> 6] |= np.uint64(1) << np.uint64(z & 63)


@kernel
def block_columns(
    grown: NDArray[np.uint64],  # (kx, ky, words) along z
    first: NDArray[np.int16],  # (kx, ky) least layer that a body meets
    layers: int,  # that it meets
    x0: int,
    y0: int,
    occupied_columns: NDArray[np.uint64],  # (nx, words) along y, in, out
    free_columns: NDArray[np.uint64],  # (nx, words) in, out
) -> None:
    """Make those columns occupied in which a body meets a bit that is set."""
    columns_x, columns_y, words = grown.shape
    for i in range(columns_x):
        for k in range(columns_y):
            y = y0 + k
            word, bit = y >> 6, np.uint64(1) << np.uint64(y & 63)
            for z in range(max(first[i, k], 0), min(first[i, k] + layers, 64 * words)):
                if grown[i, k, z >> 6] >> np.uint64(z & 63) & np.uint64(1) != 0:
                    occupied_columns[x0 + i, word] |= bit
                    free_columns[x0 + i, word] &= ~bit
