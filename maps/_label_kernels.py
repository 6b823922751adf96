"""Compiled kernels of labels: a directory of cells, and their votes.

All kernels that call each other live in this file because a cached kernel is not recompiled when
another file changes.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from maps._jit import kernel

MOST_VOTES = np.uint32(0xFFFFFFFF)


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
def vote(
    directory: NDArray[np.int32],
    cells: NDArray[np.int64],
    votes: NDArray[np.uint32],  # (rows, classes)
    used: int,
    voters: NDArray[np.int64],  # (n, 3) cells
    labels: NDArray[np.uint8],  # (n,)
) -> tuple[int, int]:
    """Count votes in order; return the number of rows in use, and of votes without room."""
    lost = 0
    for i in range(voters.shape[0]):
        x, y, z = voters[i, 0], voters[i, 1], voters[i, 2]
        entry = seek(directory, cells, x, y, z)
        row = int(directory[entry])
        if row < 0:
            if used == cells.shape[0]:
                lost += 1
                continue
            row = used
            directory[entry] = row
            cells[row, 0], cells[row, 1], cells[row, 2] = x, y, z
            used += 1
        if votes[row, labels[i]] < MOST_VOTES:
            votes[row, labels[i]] += np.uint32(1)
    return used, lost
