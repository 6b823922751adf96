"""A coarse lattice over a free space: its tables, the search on it, and paths over its cells."""

from __future__ import annotations

import functools
import itertools
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayproof.planners.free_space import FreeSpace
from wayproof.planners.kernels import heuristic, lattice_search
from wayproof.planners.kernels.grid import Floats
from wayproof.planners.kernels.heuristic import STEPS
from wayproof.planners.kernels.lattice_cells import (
    FREE_RATE,
    KEY,
    LARGEST_FACTOR,
    LARGEST_RATE,
    OPEN,
    Integers,
    Lattice,
    Rates,
    rate_of,
)

Cell = tuple[int, int, int]
Longs = NDArray[np.int64]

SPACING_IN_SPACE = 0.2
"""Size of a cell of the coarsest lattice in space, m."""

SPACING_ON_GROUND = 0.1
"""Size of a cell of the coarsest lattice in the plane, m."""

ENTRY_RINGS = 2
"""Largest distance from its own lattice cell at which a point may enter the lattice, cells."""


def factors(space: FreeSpace) -> list[int]:
    """Return the grid cells per lattice cell along an axis: the coarsest first, down to 1."""
    spacing = SPACING_ON_GROUND if space.flat else SPACING_IN_SPACE
    coarse = min(max(round(spacing / space.resolution), 1), LARGEST_FACTOR)
    return [factor for factor in (coarse, coarse // 2, 1) if factor >= 1][: coarse.bit_length()]


def make_lattice(space: FreeSpace, factor: int, weight: float) -> Lattice:
    """Make a lattice on which nothing has been searched yet.

    Args:
        space: Free space and its costs.
        factor: Grid cells to a lattice cell, along each axis that has more than one.
        weight: Weight of the cell cost against length.
    """
    field = space.grid.field
    shape = _lattice_shape(space.flat, factor, field.shape)
    tables = _move_tables(space.flat, factor, field.shape)
    rates = rates_of(space, weight)
    cells = int(shape.prod())
    dearest = max(int(rates.by_distance.max()), int(rates.by_price.max()))
    longest = STEPS[2] * 2 * dearest
    return Lattice(
        field=field,
        cells=field.reshape(-1),
        threshold=space.collision_distance_sq,
        factor=_cells_along(space.flat, factor),
        shape=shape,
        rates=rates,
        moves=tables.moves,
        move_offsets=tables.offsets,
        move_lengths=tables.lengths,
        touched=tables.touched,
        touched_counts=tables.touched_counts,
        rate=np.zeros(cells, np.int32),
        state=np.zeros(cells, np.uint8),
        cost=np.empty(cells, np.int32),
        parent_move=np.empty(cells, np.uint8),
        key=np.empty(cells, np.int32),
        head=np.full(1 << (2 * longest).bit_length(), -1, np.int32),
        after=np.empty(cells, np.int32),
        before=np.empty(cells, np.int32),
        column_bound=np.zeros(shape[0] * shape[1], np.int32),
        counters=np.zeros(3, np.int64),
    )


def open_goal(lattice: Lattice, goal: int, target: int = -1) -> None:
    """Begin a search at the goal's cell, with the heuristic of a target cell; -1 for none."""
    key = heuristic.heuristic(lattice, goal, target)
    lattice.counters[KEY] = key
    lattice_search.open_cell(lattice, goal, 0, key)


def set_heuristic_target(lattice: Lattice, target: int) -> None:
    """Go on searching with the heuristic of another cell; -1 for none."""
    lattice_search.requeue(lattice, target, np.flatnonzero(lattice.state == OPEN))


def set_column_heuristic(lattice: Lattice, goal: int, target: int) -> bool:
    """Go on searching from the goal's cell with lower bounds of the cost from column to column.

    Returns:
        Whether there may be a way to the target cell.
    """
    if not heuristic.bound_columns(lattice, goal, target):
        return False
    set_heuristic_target(lattice, target)
    return True


def entry_cell(lattice: Lattice, space: FreeSpace, point: Floats) -> int:
    """Return the nearest free lattice cell with a free edge from a point; -1 for none."""
    own = lattice_cell(lattice, space, point)
    if (own < 1).any() or (own > lattice.shape - 2).any():
        return -1
    cell = int((own * _strides(lattice)).sum())
    if rate_of(lattice, cell) > 0:
        middle = (own - 1) * lattice.factor + lattice.factor // 2 + 0.5  # in grid cells
        if space.edge_free(point, space.origin + middle * space.resolution):
            return cell
    rings = np.array([ENTRY_RINGS, ENTRY_RINGS, 0 if space.flat else ENTRY_RINGS])
    low, high = np.maximum(own - rings, 1), np.minimum(own + rings, lattice.shape - 2)
    near = np.array(list(itertools.product(*map(range, low, high + 1)))).reshape(-1, 3)
    cells = (near * _strides(lattice)).sum(axis=1)
    offsets = centres(lattice, space, cells) - point
    squared = np.square(offsets).sum(axis=1)
    for n in np.argsort(squared, kind="stable"):
        cell = int(cells[n])
        if rate_of(lattice, cell) > 0:
            centre = centres(lattice, space, cells[n : n + 1])[0]
            if space.edge_free(point, centre):
                return cell
    return -1


def extract_path(
    lattice: Lattice, space: FreeSpace, start: Floats, goal: Floats, entered: int
) -> Floats:
    """Return the path (n, 3), m, from a start over the cheapest way from the entered cell."""
    cells = lattice_search.descend(lattice, entered)
    return np.vstack((start, centres(lattice, space, cells), goal))


def lattice_cell(lattice: Lattice, space: FreeSpace, point: Floats) -> Longs:
    """Return the indices (3,) of the lattice cell that holds a point."""
    cell = np.floor((point - space.origin) / (lattice.factor * space.resolution))
    indices: Longs = cell.astype(np.int64) + 1
    return indices


def centres(lattice: Lattice, space: FreeSpace, cells: NDArray[np.integer]) -> Floats:
    """Return centres of the middle grid cells of lattice cells by their flat indices, (n, 3), m."""
    indices = np.stack(np.unravel_index(cells, tuple(lattice.shape.tolist())), axis=-1) - 1
    middles = indices * lattice.factor + lattice.factor // 2 + 0.5  # in grid cells
    points: Floats = space.origin + middles * space.resolution
    return points


def _strides(lattice: Lattice) -> Longs:
    return np.array([lattice.shape[1] * lattice.shape[2], lattice.shape[2], 1])


def rates_of(space: FreeSpace, weight: float) -> Rates:
    """Return the integer cost per length of a space's cells."""
    grid, free = space.grid, space.collision_distance_sq + 1
    by_distance = np.full(len(grid.cost_by_distance), FREE_RATE, np.int32)
    by_distance[free:] = _rounded(weight * grid.cost_by_distance[free:])
    return Rates(grid.price, by_distance, _rounded(weight * grid.cost_by_price))


def _rounded(costs: Floats) -> Integers:
    """Return integer costs per length, of costs beside it."""
    costs = np.minimum(costs, LARGEST_RATE / FREE_RATE)
    return np.rint(FREE_RATE * (1.0 + costs)).astype(np.int32)


class _MoveTables(NamedTuple):
    """Moves on lattices of one shape, as `Lattice` holds them; nothing writes to them."""

    moves: Longs  # (m, 3)
    offsets: Longs  # (m,)
    lengths: Integers  # (m,)
    touched: Longs  # (m, k)
    touched_counts: Longs  # (m,)


@functools.lru_cache(maxsize=16)
def _move_tables(flat: bool, factor: int, field_shape: Cell) -> _MoveTables:
    """Make the tables of moves; searches of one window share them."""
    shape = _lattice_shape(flat, factor, field_shape)
    moves = _moves(flat)
    strides = np.array([shape[1] * shape[2], shape[2], 1])
    touched, counts = _touched_cells(moves, factor, field_shape)
    return _MoveTables(
        moves=moves,
        offsets=(moves * strides).sum(axis=1),
        lengths=np.array([STEPS[np.abs(move).sum() - 1] for move in moves], np.int32),
        touched=touched,
        touched_counts=counts,
    )


def _cells_along(flat: bool, factor: int) -> Longs:
    """Return the grid cells to a lattice cell along each axis, (3,)."""
    return np.array([factor, factor, 1 if flat else factor])


def _lattice_shape(flat: bool, factor: int, field_shape: Cell) -> Longs:
    """Return the lattice cells along each axis, (3,), border included."""
    # Incomplete blocks at the far sides are border.
    shape: Longs = np.array(field_shape) // _cells_along(flat, factor) + 2
    return shape


def _moves(flat: bool) -> Longs:
    """Return the moves to all neighbours, (8 or 26, 3), those along fewer axes first."""
    steps = itertools.product((-1, 0, 1), (-1, 0, 1), (0,) if flat else (-1, 0, 1))
    moves = sorted((step for step in steps if any(step)), key=lambda step: sum(map(abs, step)))
    return np.array(moves)


@functools.lru_cache(maxsize=64)
def _touched(move: Cell, factor: int) -> list[Cell]:
    """Return the grid cells that a move touches, from its first one; at corners all that meet."""
    corners = list(itertools.product(*[(0, step) if step else (0,) for step in move]))
    return sorted(
        {
            (n * move[0] + i, n * move[1] + j, n * move[2] + k)
            for n in range(factor)
            for i, j, k in corners
        }
    )


def _touched_cells(moves: Longs, factor: int, shape: tuple[int, ...]) -> tuple[Longs, Longs]:
    """Flat offsets of the grid cells that each move touches, padded (m, k), and counts (m,)."""
    touched = [
        [(x * shape[1] + y) * shape[2] + z for x, y, z in _touched(tuple(move), factor)]
        for move in moves.tolist()
    ]
    table = np.zeros((len(moves), max(map(len, touched))), np.int64)
    for row, offsets in zip(table, touched, strict=True):
        row[: len(offsets)] = offsets
    return table, np.array([len(offsets) for offsets in touched])
