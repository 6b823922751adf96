"""Shortest ways from cell to cell of a voxel map, exact to the last move.

A way's length is a sum of straight, diagonal and space-diagonal moves, so it is kept as those three
counts. 1, √2 and √3 are linearly independent over the rationals: two lengths are equal only if
their counts are, and lengths of fewer than 10^5 moves that differ do so by far more than a double's
rounding. So the order of the search, and the counts that it ends with, are exact.
"""

from __future__ import annotations

import heapq
from typing import NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

_compiled = numba.njit(cache=True, error_model="numpy")

SLAB = 64
"""Cells along x whose moves are worked out at once: the rest of the map takes no memory for it."""

SQRT2 = 2.0**0.5
SQRT3 = 3.0**0.5

STEPS = np.array(
    [(x, y, z) for x in (-1, 0, 1) for y in (-1, 0, 1) for z in (-1, 0, 1) if x or y or z]
)
"""(26, 3): one cell along one, two or three axes."""


class Moves(NamedTuple):
    """Numbers of moves of each kind in a path, and of cells that the search closed."""

    straight: int
    diagonal: int
    space_diagonal: int
    expanded: int

    @property
    def length(self) -> float:
        """Length of the path, cells."""
        return self.straight + self.diagonal * SQRT2 + self.space_diagonal * SQRT3


class VoxelSearch:
    """A* (Hart, Nilsson, Raphael 1968) on one voxel map, with the moves of its benchmark.

    26 moves, each of which needs every cell of its bounding box to be free: no corner is cut
    (Brewer and Sturtevant, "Benchmarks for Pathfinding in 3D Voxel Space", SoCS 2018).
    """

    def __init__(self, occupied: NDArray[np.bool_]) -> None:
        """Work out which moves each cell allows.

        Args:
            occupied: (nx, ny, nz).
        """
        self._shape = occupied.shape
        self._allowed = _allowed_moves(np.pad(occupied, 1, constant_values=True))
        self._counts = np.zeros((occupied.size, 3), np.uint32)
        self._state = np.zeros(occupied.size, np.uint32)
        self._round = 0

    def solve(self, start: tuple[int, int, int], goal: tuple[int, int, int]) -> Moves | None:
        """Return the moves of a shortest way, or None if there is none.

        Args:
            start: A cell of the map.
            goal: Another.

        Raises:
            ValueError: A cell lies outside the map.
        """
        for name, cell in (("start", start), ("goal", goal)):
            if not all(0 <= a < b for a, b in zip(cell, self._shape, strict=True)):
                raise ValueError(f"{name}: got {cell}, expected within {self._shape}")
        self._round += 1
        first, last = (int(np.ravel_multi_index(cell, self._shape)) for cell in (start, goal))
        expanded = _search(
            self._allowed,
            self._shape,
            start=first,
            goal=last,
            counts=self._counts,
            state=self._state,
            opened=2 * self._round,
        )
        if expanded < 0:
            return None
        straight, diagonal, space_diagonal = self._counts[last].tolist()
        return Moves(straight, diagonal, space_diagonal, expanded)


def _allowed_moves(padded: NDArray[np.bool_]) -> NDArray[np.uint32]:  # (nx * ny * nz,)
    """Set bit n where `STEPS[n]` leads through free cells only, the cell itself included."""
    shape = tuple(size - 2 for size in padded.shape)
    allowed = np.zeros(shape, np.uint32)
    for first in range(0, shape[0], SLAB):
        allowed[first : first + SLAB] = _allowed_within(padded[first : first + SLAB + 2])
    return allowed.reshape(-1)


def _allowed_within(padded: NDArray[np.bool_]) -> NDArray[np.uint32]:  # (nx, ny, nz)
    shape = tuple(size - 2 for size in padded.shape)
    allowed = np.zeros(shape, np.uint32)
    for number, step in enumerate(STEPS):
        free = np.ones(shape, np.bool_)
        for corner in np.ndindex(2, 2, 2):
            if any(c and not s for c, s in zip(corner, step, strict=True)):
                continue  # the box has no extent along this axis
            offset = 1 + np.array(corner) * step
            free &= ~padded[tuple(slice(o, o + n) for o, n in zip(offset, shape, strict=True))]
        allowed |= np.left_shift(free.astype(np.uint32), np.uint32(number))
    return allowed


@_compiled
def _length(straight: int, diagonal: int, space_diagonal: int) -> float:
    return straight + diagonal * SQRT2 + space_diagonal * SQRT3


@_compiled
def _search(
    allowed: NDArray[np.uint32],
    shape: tuple[int, int, int],
    start: int,
    goal: int,
    counts: NDArray[np.uint32],
    state: NDArray[np.uint32],
    opened: int,
) -> int:
    """Return cells closed until the goal was, or -1 if it cannot be reached.

    Among equal lengths the one that is nearer the goal goes first, then the lower index.

    Args:
        allowed: (n,) moves of each cell, see `_allowed_moves`.
        shape: Shape of the map.
        start: Flat index.
        goal: Flat index.
        counts: (n, 3) out: moves of each kind to each cell that was opened.
        state: (n,) `opened` for open, one more for closed, else from an earlier search.
        opened: Number of this search where the cell was opened.
    """
    ny, nz = shape[1], shape[2]
    goal_x, goal_y, goal_z = goal // (ny * nz), (goal // nz) % ny, goal % nz
    counts[start] = 0
    state[start] = opened
    queue = [(0.0, 0.0, start)]
    expanded = 0
    while len(queue) > 0:
        cell = heapq.heappop(queue)[2]
        if state[cell] != opened:
            continue  # closed since, by a shorter way
        state[cell] = opened + 1
        expanded += 1
        if cell == goal:
            return expanded
        straight, diagonal, space = counts[cell, 0], counts[cell, 1], counts[cell, 2]
        x, y, z = cell // (ny * nz), (cell // nz) % ny, cell % nz
        for number in range(26):
            if not (allowed[cell] >> np.uint32(number)) & np.uint32(1):
                continue
            dx, dy, dz = STEPS[number, 0], STEPS[number, 1], STEPS[number, 2]
            other = cell + (dx * ny + dy) * nz + dz
            if state[other] == opened + 1:
                continue
            axes = abs(dx) + abs(dy) + abs(dz)
            a, b, c = straight + (axes == 1), diagonal + (axes == 2), space + (axes == 3)
            if state[other] == opened and _length(a, b, c) >= _length(
                counts[other, 0], counts[other, 1], counts[other, 2]
            ):
                continue
            counts[other, 0], counts[other, 1], counts[other, 2] = a, b, c
            state[other] = opened
            u, v, w = abs(x + dx - goal_x), abs(y + dy - goal_y), abs(z + dz - goal_z)
            least, most = min(u, v, w), max(u, v, w)
            middle = u + v + w - least - most
            f = _length(a + most - middle, b + middle - least, c + least)
            left = _length(most - middle, middle - least, least)
            heapq.heappush(queue, (f, left, other))
    return -1
