"""Compiled kernels of labels: a directory of cells, and their votes.

All kernels that call each other live in this file because a cached kernel is not recompiled when
another file changes.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wayproof.maps._jit import kernel
from wayproof.maps.kernels.beams import (
    DROPPED_MM,
    FLOOR_SUBCELLS,
    NO_RETURN_MM,
    SUBCELL_BITS,
    SUBCELLS,
)

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

    The hash is that of Teschner et al. 2003, "Optimized spatial hashing", for cubes of 4 x 4 x 4
    cells; those of one cube lie side by side, as the beams of a sweep meet them.
    """
    last = directory.shape[0] - 1
    cube = ((x >> 2) * 73856093) ^ ((y >> 2) * 19349663) ^ ((z >> 2) * 83492791)
    entry = ((cube << 6) | (x & 3) << 4 | (y & 3) << 2 | (z & 3)) & last
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
def end_runs(
    origins: NDArray[np.float64],  # (m, 3) m, world
    moments: NDArray[np.int32],  # (n,) origin of each beam; (0,) if all start at the first
    directions: NDArray[np.float64],  # (n, 3)
    ranges_mm: NDArray[np.uint16],  # (n,)
    limits_mm: tuple[int, int],  # nearest and farthest return
    labels: NDArray[np.uint8],  # (n,)
    resolution: float,
    voters: NDArray[np.int64],  # (n, 3) out: cells
    votes: NDArray[np.uint8],  # (n,) out: labels
    counts: NDArray[np.uint32],  # (n,) out
) -> int:
    """The cells that labelled beams with a return end in, as a map has them; how many.

    Beams that follow one another, and end in one cell with one label, are one entry.
    """
    scale = SUBCELLS / resolution
    rolling = moments.shape[0] > 0
    last = -1
    for i in range(ranges_mm.shape[0]):
        label, millimetres = labels[i], int(ranges_mm[i])
        if label == UNLABELLED or millimetres == DROPPED_MM or millimetres == NO_RETURN_MM:
            continue
        if not limits_mm[0] <= millimetres <= limits_mm[1]:
            continue
        k = int(moments[i]) if rolling else 0
        length = millimetres / 1000.0
        u = np.floor((origins[k, 0] + directions[i, 0] * length) * scale)
        v = np.floor((origins[k, 1] + directions[i, 1] * length) * scale)
        w = np.floor((origins[k, 2] + directions[i, 2] * length) * scale)
        if not abs(u) + abs(v) + abs(w) < FAR:  # also if not finite
            continue
        x, y = int(u) >> SUBCELL_BITS, int(v) >> SUBCELL_BITS
        z = (int(w) + FLOOR_SUBCELLS) >> SUBCELL_BITS
        if last >= 0 and votes[last] == label:
            if voters[last, 0] == x and voters[last, 1] == y and voters[last, 2] == z:
                counts[last] += np.uint32(1)
                continue
        last += 1
        voters[last, 0], voters[last, 1], voters[last, 2] = x, y, z
        votes[last], counts[last] = label, 1
    return last + 1


@kernel
def vote(
    directory: NDArray[np.int32],
    cells: NDArray[np.int64],
    votes: NDArray[np.uint32],  # (rows, classes)
    winners: NDArray[np.uint8],  # (rows,) the class with the most votes, the least of equal ones
    used: int,
    voters: NDArray[np.int64],  # (n, 3) cells
    labels: NDArray[np.uint8],  # (n,)
    counts: NDArray[np.uint32],  # (n,) votes of each
    sums: NDArray[np.uint64],  # (2,) in, out: of what all votes are mixed to
    box: NDArray[np.int64],  # (2, 3) out: least and greatest cell whose winner changed
) -> tuple[int, int]:
    """Count votes in order; return the number of rows in use, and of votes without room."""
    lost = 0
    for i in range(voters.shape[0]):
        x, y, z = voters[i, 0], voters[i, 1], voters[i, 2]
        entry = seek(directory, cells, x, y, z)
        row = int(directory[entry])
        if row < 0:
            if used == cells.shape[0]:
                lost += int(counts[i])
                continue
            row = used
            directory[entry] = row
            cells[row, 0], cells[row, 1], cells[row, 2] = x, y, z
            winners[row] = UNLABELLED
            used += 1
        label, best = int(labels[i]), int(winners[row])
        more = min(counts[i], MOST_VOTES - votes[row, label])
        mine = votes[row, label] + more
        votes[row, label] = mine
        for lane in range(2):
            sums[lane] += np.uint64(more) * mixed(x, y, z, label, SEEDS[lane])
        if best == label:
            continue
        most = votes[row, best] if best != UNLABELLED else np.uint32(0)
        if mine > most or (mine == most and label < best):
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
