"""Exact distances and shortest ways in grids of cells, for what judges a map or needs none."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wayproof.kernel_compiler import kernel

Cells = NDArray[np.bool_]
Lengths = NDArray[np.float64]
Longs = NDArray[np.int64]

NOWHERE = 2**40
"""Squared distance of a cell to the nearest of none, cells."""


def distances(marked: Cells) -> Lengths:
    """Return the distance of each cell to the nearest marked one, cells; a million where none is.

    Squares and their sums are whole numbers, so each distance is the number next to the true one.
    """
    cells = marked.reshape(*marked.shape, *(1,) * (3 - marked.ndim))
    squared = np.where(cells, 0, NOWHERE)
    most = max(cells.shape)
    for axis in range(marked.ndim):
        # A copy: the kernel is compiled for one layout.
        lines = np.moveaxis(squared, axis, -1).copy()
        lower_lines(lines, *np.empty((3, most), np.int64))
        squared = np.moveaxis(lines, -1, axis)
    return np.sqrt(squared.reshape(marked.shape))


@kernel
def lower_lines(lines: Longs, line: Longs, apexes: Longs, begins: Longs) -> None:
    """Lower each value to the least of its line's values plus its squared distance to them.

    The lower envelope of parabolas, in whole numbers (Meijster, Roerdink, Hesselink, "A General
    Algorithm for Computing Distance Transforms in Linear Time", 2000).

    Args:
        lines: (m, n, cells) values, cells squared, in place.
        line: (cells,) scratch, as the next two.
        apexes: Apexes of the parabolas that touch the envelope.
        begins: First cell of each along the envelope.
    """
    rows, columns, cells = lines.shape
    for row in range(rows):
        for column in range(columns):
            for at in range(cells):
                line[at] = lines[row, column, at]
            last, apexes[0], begins[0] = 0, 0, 0
            for apex in range(1, cells):
                while last >= 0:
                    at, other = begins[last], apexes[last]
                    if (at - other) ** 2 + line[other] <= (at - apex) ** 2 + line[apex]:
                        break
                    last -= 1
                if last < 0:
                    last, apexes[0] = 0, apex
                    continue
                other = apexes[last]
                rise = apex * apex - other * other + line[apex] - line[other]
                begin = 1 + rise // (2 * (apex - other))
                if begin < cells:
                    last += 1
                    apexes[last], begins[last] = apex, begin
            for at in range(cells - 1, -1, -1):
                apex = apexes[last]
                lines[row, column, at] = (at - apex) ** 2 + line[apex]
                if at == begins[last]:
                    last -= 1


def ways(
    free: Cells,
    ends: ArrayLike,
    size: float,
    *,
    until: int = -1,
    corners: bool = True,
    rounds: bool = False,
) -> tuple[Lengths, Longs]:
    """Return the length of each free cell's shortest way to any of some ends, m, and its next cell.

    Ways follow edges and diagonals. Without a way the length is infinite.

    Args:
        free: (nx, ny) or (nx, ny, nz).
        ends: Numbers of free cells.
        size: Side of a cell, m.
        until: Number of a cell beyond whose length none is looked for; -1 for none.
        corners: Whether cells that share an edge or a corner alone are neighbours.
        rounds: Whether the first and the last cell along the first axis are neighbours.

    Returns:
        Lengths, as `free`, and (cells,) numbers of the next cells, -1 for none.
    """
    cells = np.ascontiguousarray(free).reshape(*free.shape, *(1,) * (3 - free.ndim))
    steps = [math.sqrt(axes) * size for axes in range(4 if corners else 2)]
    lengths, after = np.full(cells.size, np.inf), np.full(cells.size, -1, np.int64)
    queues, closed = np.empty((len(steps), cells.size), np.int64), np.zeros(cells.size, np.bool_)
    heads, tails = np.zeros((2, len(steps)), np.int64)
    ends = np.asarray(ends, np.int64)
    queues[0, : len(ends)], tails[0], lengths[ends] = ends, len(ends), 0.0
    spread(cells, np.array(steps), until, rounds, lengths, after, queues, heads, tails, closed)
    return lengths.reshape(free.shape), after


@kernel
def spread(
    free: Cells,
    steps: Lengths,
    until: int,
    rounds: bool,
    lengths: Lengths,
    after: Longs,
    queues: Longs,
    heads: Longs,
    tails: Longs,
    closed: Cells,
) -> None:
    """Find shortest ways (Dijkstra) with a queue for each length of a step instead of a heap.

    Cells are closed in the order of their lengths, and so those that a step of one length opens are
    in order, too.

    Args:
        free: (nx, ny, nz).
        steps: (1 + axes,) length of a step along so many axes, m.
        until: As of `ways`.
        rounds: As of `ways`.
        lengths: (cells,) 0 at the ends and else infinite, in place, m.
        after: (cells,) in place.
        queues: (1 + axes, cells) cells opened by each step; the first holds the ends.
        heads: (1 + axes,) first of each queue, in place.
        tails: (1 + axes,) one past the last of each queue, in place.
        closed: (cells,) scratch, False.
    """
    nx, ny, nz = free.shape
    while True:
        cell = -1
        for axes in range(len(steps)):
            while heads[axes] < tails[axes] and closed[queues[axes, heads[axes]]]:
                heads[axes] += 1
            if heads[axes] < tails[axes]:
                open_cell = queues[axes, heads[axes]]
                # Of equal lengths the last, a diagonal, as the order decides between equal ways.
                if cell < 0 or lengths[open_cell] <= lengths[cell]:
                    cell = open_cell
        if cell < 0 or cell == until:
            return
        closed[cell] = True
        x, y, z = cell // (ny * nz), cell // nz % ny, cell % nz
        for i in range(x - 1, x + 2):
            u = (i + nx) % nx if rounds else i
            if not 0 <= u < nx:
                continue
            for v in range(max(y - 1, 0), min(y + 2, ny)):
                for w in range(max(z - 1, 0), min(z + 2, nz)):
                    axes = abs(i - x) + abs(v - y) + abs(w - z)
                    other = (u * ny + v) * nz + w
                    if axes >= len(steps) or not free[u, v, w] or closed[other]:
                        continue
                    length = lengths[cell] + steps[axes]
                    if length < lengths[other]:
                        lengths[other], after[other] = length, cell
                        queues[axes, tails[axes]] = other
                        tails[axes] += 1
