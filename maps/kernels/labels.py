"""Kernels of semantic labels: votes of labelled beams in a hash table of cells."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayproof.kernel_compiler import kernel
from wayproof.maps.kernels.beams import (
    DROPPED_MM,
    FLOOR_SUBCELLS,
    NO_RETURN_MM,
    SUBCELL_BITS,
    SUBCELLS,
)

MAX_VOTES = np.uint32(0xFFFFFFFF)
UNLABELLED = 255
COORDINATE_MASK = (1 << 48) - 1
FAR = 2.0**48  # sub-cells
SEEDS = np.array([0x9E3779B97F4A7C15, 0xD1B54A32D192ED03], np.uint64)
FACTORS = np.array([0xBF58476D1CE4E5B9, 0x94D049BB133111EB], np.uint64)


class VoteTable(NamedTuple):
    """Cells with votes, found by a hash of their indices.

    Attributes:
        directory: (2^k,) row of a cell, or -1; never full.
        cells: (rows, 3) indices.
        votes: (rows, classes) number of votes.
        winners: (rows,) class with the most votes, the least of equal ones.
    """

    directory: NDArray[np.int32]
    cells: NDArray[np.int64]
    votes: NDArray[np.uint32]
    winners: NDArray[np.uint8]


class LabelledBeams(NamedTuple):
    """Beams of a sweep whose hits are labelled.

    Attributes:
        origins: (m, 3) m, world.
        sources: (n,) origin of each beam; (0,) if all start at the first.
        directions: (n, 3) unit vectors, world.
        ranges_mm: (n,) mm.
        limits_mm: Nearest and farthest return, mm.
        labels: (n,) classes.
        resolution: Edge of a cell, m.
    """

    origins: NDArray[np.float64]
    sources: NDArray[np.int32]
    directions: NDArray[np.float64]
    ranges_mm: NDArray[np.uint16]
    limits_mm: tuple[int, int]
    labels: NDArray[np.uint8]
    resolution: float


class Ballots(NamedTuple):
    """Votes to be counted.

    Attributes:
        cells: (n, 3) indices.
        labels: (n,) classes.
        counts: (n,) votes of each.
    """

    cells: NDArray[np.int64]
    labels: NDArray[np.uint8]
    counts: NDArray[np.uint32]


@kernel
def find_entry(
    directory: NDArray[np.int32],  # (2^k,) row of a cell, or -1; never full
    cells: NDArray[np.int64],  # (rows, 3)
    x: int,
    y: int,
    z: int,
) -> int:
    """Find the entry of a cell, or the empty one where it belongs, by linear probing.

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
    queries: NDArray[np.int64],  # (n, 3) cells
    rows: NDArray[np.int64],  # (n,) out: -1 where there are no votes
) -> None:
    """Find the rows of cells."""
    for i in range(queries.shape[0]):
        rows[i] = directory[
            find_entry(directory, cells, queries[i, 0], queries[i, 1], queries[i, 2])
        ]


@kernel
def vote_hash(x: int, y: int, z: int, label: int, seed: np.uint64) -> np.uint64:
    """Hash a vote to 64 bits (the finaliser of Steele et al. 2014, "SplitMix")."""
    word = np.uint64(x & COORDINATE_MASK) * seed + np.uint64(y & COORDINATE_MASK)
    word = word * FACTORS[0] + np.uint64(z & COORDINATE_MASK)
    word = word * FACTORS[1] + np.uint64(label) + seed
    word = (word ^ (word >> np.uint64(30))) * FACTORS[0]
    word = (word ^ (word >> np.uint64(27))) * FACTORS[1]
    return np.uint64(word ^ (word >> np.uint64(31)))


@kernel
def list_ballots(beams: LabelledBeams, ballots: Ballots) -> int:
    """List the cells that labelled beams with a return end in, as a map has them.

    Beams that follow one another, and end in one cell with one label, are one entry.

    Returns:
        Number of ballots.
    """
    origins, sources, directions, ranges_mm, limits_mm, labels, resolution = beams
    cells, votes, counts = ballots
    scale = SUBCELLS / resolution
    several = sources.shape[0] > 0
    last = -1
    for i in range(ranges_mm.shape[0]):
        label, millimetres = labels[i], int(ranges_mm[i])
        if label == UNLABELLED or millimetres == DROPPED_MM or millimetres == NO_RETURN_MM:
            continue
        if not limits_mm[0] <= millimetres <= limits_mm[1]:
            continue
        k = int(sources[i]) if several else 0
        length = millimetres / 1000.0
        u = np.floor((origins[k, 0] + directions[i, 0] * length) * scale)
        v = np.floor((origins[k, 1] + directions[i, 1] * length) * scale)
        w = np.floor((origins[k, 2] + directions[i, 2] * length) * scale)
        if not abs(u) + abs(v) + abs(w) < FAR:  # also if not finite
            continue
        x, y = int(u) >> SUBCELL_BITS, int(v) >> SUBCELL_BITS
        z = (int(w) + FLOOR_SUBCELLS) >> SUBCELL_BITS
        if last >= 0 and votes[last] == label:
            if cells[last, 0] == x and cells[last, 1] == y and cells[last, 2] == z:
                counts[last] += np.uint32(1)
                continue
        last += 1
        cells[last, 0], cells[last, 1], cells[last, 2] = x, y, z
        votes[last], counts[last] = label, 1
    return last + 1


@kernel
def count_votes(
    table: VoteTable,  # in, out
    used: int,  # rows of it in use
    ballots: Ballots,
    sums: NDArray[np.uint64],  # (2,) in, out: sums of the hashes of all votes
    box: NDArray[np.int64],  # (2, 3) out: least and greatest cell whose winner changed
) -> tuple[int, int]:
    """Count votes in order.

    Returns:
        Number of rows in use, and of votes for which there was no room.
    """
    directory, cells, votes, winners = table
    voters, labels, counts = ballots
    lost = 0
    for i in range(voters.shape[0]):
        x, y, z = voters[i, 0], voters[i, 1], voters[i, 2]
        # Find the cell's row, or take one.
        entry = find_entry(directory, cells, x, y, z)
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
        # Count, up to the greatest number, and keep the sums of hashes up to date.
        label, best = int(labels[i]), int(winners[row])
        more = min(counts[i], MAX_VOTES - votes[row, label])
        own_votes = votes[row, label] + more
        votes[row, label] = own_votes
        for lane in range(2):
            sums[lane] += np.uint64(more) * vote_hash(x, y, z, label, SEEDS[lane])
        # The class may win now.
        if best == label:
            continue
        best_votes = votes[row, best] if best != UNLABELLED else np.uint32(0)
        if own_votes > best_votes or (own_votes == best_votes and label < best):
            winners[row] = label
            for axis in range(3):
                box[0, axis] = min(box[0, axis], voters[i, axis])
                box[1, axis] = max(box[1, axis], voters[i, axis])
    return used, lost


@kernel
def grow_balls(
    cells: NDArray[np.int64],  # (k, 3)
    squared: NDArray[np.int64],  # (k,) radius of the ball around each, cells^2
    low: tuple[int, int, int],  # least cell of the window
    grown: NDArray[np.uint64],  # (nx, ny, words) in, out
) -> None:
    """Set the bits of all cells that lie in a ball around a cell."""
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
    layers: int,  # number of layers that it meets
    x0: int,
    y0: int,
    occupied_columns: NDArray[np.uint64],  # (nx, words) along y, in, out
    free_columns: NDArray[np.uint64],  # (nx, words) in, out
) -> None:
    """Make columns occupied where a body meets a bit that is set."""
    columns_x, columns_y, words = grown.shape
    for i in range(columns_x):
        for k in range(columns_y):
            y = y0 + k
            word, bit = y >> 6, np.uint64(1) << np.uint64(y & 63)
            for z in range(max(first[i, k], 0), min(first[i, k] + layers, 64 * words)):
                if grown[i, k, z >> 6] >> np.uint64(z & 63) & np.uint64(1) != 0:
                    occupied_columns[x0 + i, word] |= bit
                    free_columns[x0 + i, word] &= ~bit
