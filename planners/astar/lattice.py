"""A coarse lattice over a free space, and the cheapest way on it from a point to a goal."""

from __future__ import annotations

import functools
import itertools

import numpy as np
from numpy.typing import NDArray

from wayproof.planners import _lattice_kernels as kernels
from wayproof.planners._lattice_kernels import (
    FREE_RATE,
    LARGEST_FACTOR,
    LARGEST_RATE,
    STEPS,
    Lattice,
)
from wayproof.planners.free_space import FreeSpace
from wayproof.planners.kernels import BLOCK_BITS, Floats

Cell = tuple[int, int, int]

SPACING_ABOVE_GROUND = 0.2  # [m]
SPACING_ON_GROUND = 0.1  # [m]

ENTRY_RINGS = 2
"""How far from its own lattice cell a point may enter the lattice, in cells."""


def factors(space: FreeSpace) -> list[int]:
    """Grid cells to a lattice cell: the coarse one first, then ever finer down to the grid."""
    spacing = SPACING_ON_GROUND if space.flat else SPACING_ABOVE_GROUND
    coarse = min(max(round(spacing / space.resolution), 1), LARGEST_FACTOR)
    return [factor for factor in (coarse, coarse // 2, 1) if factor >= 1][: coarse.bit_length()]


def make_lattice(space: FreeSpace, factor: int, weight: float, repairable: bool = False) -> Lattice:
    """A lattice on which nothing has been searched yet.

    Args:
        space: What is free, and the cost of coming near.
        factor: Grid cells to a lattice cell, along each axis that has more than one.
        weight: Weight of the cell cost against length.
        repairable: Whether to keep what ``_lattice_kernels.repair`` needs.
    """
    field = space.grid.field
    along = np.array([factor, factor, 1 if space.flat else factor])
    shape = np.array(field.shape) // along + 2  # what the last blocks lack closes them
    ways = _ways(flat=space.flat)
    strides = np.array([shape[1] * shape[2], shape[2], 1])
    touched, counts = _steps_touch(ways, factor, field.shape)
    blocks, bits = _steps_need(ways if repairable else ways[:0], along)  # for masks alone
    rate_by_distance = rates(space, weight)
    cells = int(shape.prod())
    longest = STEPS[2] * 2 * int(rate_by_distance.max())
    return Lattice(
        field=field,
        cells=field.reshape(-1),
        threshold=space.collision_distance_sq,
        factor=along,
        shape=shape,
        rate_by_distance=rate_by_distance,
        ways=ways,
        offsets=(ways * strides).sum(axis=1),
        steps=np.array([STEPS[np.abs(way).sum() - 1] for way in ways], np.int32),
        touched=touched,
        counts=counts,
        blocks=(blocks * strides).sum(axis=-1),
        bits=bits,
        rate=np.zeros(cells, np.int32),
        mask=np.zeros(cells if repairable else 0, np.int64),
        state=np.zeros(cells, np.uint8),
        cost=np.empty(cells, np.int32),
        via=np.empty(cells, np.uint8),
        key=np.empty(cells, np.int32),
        head=np.full(1 << (2 * longest).bit_length(), -1, np.int32),
        after=np.empty(cells, np.int32),
        before=np.empty(cells, np.int32),
        least=np.zeros(shape[0] * shape[1], np.int32),
        now=np.zeros(3, np.int64),
    )


def open_goal(lattice: Lattice, goal: int, target: int = -1) -> None:
    """Begin a search at the goal's cell, drawn to a target cell unless that is -1."""
    key = kernels.estimate(lattice, goal, target)
    lattice.now[kernels.KEY] = key
    kernels.put(lattice, goal, 0, key)


def draw_to(lattice: Lattice, target: int) -> None:
    """Draw a search to another cell, or to none if that is -1."""
    kernels.draw_to(lattice, target, np.flatnonzero(lattice.state == kernels.OPEN))


def draw_by_columns(lattice: Lattice, goal: int, target: int) -> bool:
    """Draw a search from the goal's cell by what it costs at least from column to column.

    Returns:
        Whether there may be a way to the target cell.
    """
    if not kernels.bound_columns(lattice, goal, target):
        return False
    draw_to(lattice, target)
    return True


def entry(lattice: Lattice, space: FreeSpace, point: Floats) -> int:
    """The free lattice cell nearest to a point that it sees the centre of; -1 if there is none."""
    own = lattice_cell(lattice, space, point)
    if (own < 1).any() or (own > lattice.shape - 2).any():
        return -1
    cell = int((own * _strides(lattice)).sum())
    if kernels.look(lattice, cell) > 0:
        middle = (own - 1) * lattice.factor + lattice.factor // 2 + 0.5  # in grid cells
        if space.edge_free(point, space.origin + middle * space.resolution):
            return cell
    rings = np.array([ENTRY_RINGS, ENTRY_RINGS, 0 if space.flat else ENTRY_RINGS])
    low, high = np.maximum(own - rings, 1), np.minimum(own + rings, lattice.shape - 2)
    near = np.array(list(itertools.product(*map(range, low, high + 1)))).reshape(-1, 3)
    cells = (near * _strides(lattice)).sum(axis=1)
    offsets = centres(lattice, space, cells) - point
    squared = np.square(offsets).sum(axis=1)
    for place in np.argsort(squared, kind="stable"):
        cell = int(cells[place])
        if kernels.look(lattice, cell) > 0:
            centre = centres(lattice, space, cells[place : place + 1])[0]
            if space.edge_free(point, centre):
                return cell
    return -1


def note_searched(lattice: Lattice, space: FreeSpace) -> bool:
    """Note where a search looked; whether what it read there was up to date."""
    layout = lattice.rate, lattice.shape, lattice.factor, BLOCK_BITS
    return space.note_searched(lambda searched: kernels.note_looked_at(*layout, searched))


def way_down(
    lattice: Lattice, space: FreeSpace, start: Floats, goal: Floats, entered: int
) -> Floats:
    """The path from a start over the cheapest way on the lattice to the goal, shape (n, 3) [m]."""
    cells = kernels.descend(lattice, entered)
    return np.vstack((start, centres(lattice, space, cells), goal))


def lattice_cell(lattice: Lattice, space: FreeSpace, point: Floats) -> NDArray[np.int64]:
    """Indices of the lattice cell that holds a point, shape (3,)."""
    cell = np.floor((point - space.origin) / (lattice.factor * space.resolution))
    indices: NDArray[np.int64] = cell.astype(np.int64) + 1
    return indices


def centres(lattice: Lattice, space: FreeSpace, cells: NDArray[np.integer]) -> Floats:
    """Centres of the middle grid cells of lattice cells by their flat indices, shape (n, 3) [m]."""
    indices = np.stack(np.unravel_index(cells, tuple(lattice.shape.tolist())), axis=-1) - 1
    middles = indices * lattice.factor + lattice.factor // 2 + 0.5  # in grid cells
    points: Floats = space.origin + middles * space.resolution
    return points


def _strides(lattice: Lattice) -> NDArray[np.int64]:
    return np.array([lattice.shape[1] * lattice.shape[2], lattice.shape[2], 1])


def rates(space: FreeSpace, weight: float) -> NDArray[np.int32]:
    """Integer cost per length by squared distance, shape (t,)."""
    table = np.full(len(space.grid.cost_by_distance), FREE_RATE, np.int32)
    free = slice(space.collision_distance_sq + 1, None)
    costs = np.minimum(weight * space.grid.cost_by_distance[free], LARGEST_RATE / FREE_RATE)
    table[free] = np.rint(FREE_RATE * (1.0 + costs)).astype(np.int32)
    return table


def _ways(flat: bool) -> NDArray[np.int64]:
    """Steps to all neighbours, shape (8 or 26, 3), straight ones first."""
    steps = itertools.product((-1, 0, 1), (-1, 0, 1), (0,) if flat else (-1, 0, 1))
    ways = sorted((step for step in steps if any(step)), key=lambda step: sum(map(abs, step)))
    return np.array(ways)


@functools.lru_cache(maxsize=64)
def _touched(way: Cell, factor: int) -> list[Cell]:
    """Grid cells that a step touches, from its first one; where several meet, all of them."""
    corners = list(itertools.product(*[(0, step) if step else (0,) for step in way]))
    return sorted(
        {
            (n * way[0] + i, n * way[1] + j, n * way[2] + k)
            for n in range(factor)
            for i, j, k in corners
        }
    )


def _steps_touch(
    ways: NDArray[np.int64], factor: int, shape: tuple[int, ...]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """The grid cells that each step touches, shape (m, k) filled up, and their numbers (m,)."""
    touched = [
        [(x * shape[1] + y) * shape[2] + z for x, y, z in _touched(tuple(way), factor)]
        for way in ways.tolist()
    ]
    table = np.zeros((len(ways), max(map(len, touched))), np.int64)
    for row, offsets in zip(table, touched, strict=True):
        row[: len(offsets)] = offsets
    return table, np.array([len(offsets) for offsets in touched])


def _steps_need(
    ways: NDArray[np.int64], along: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """The blocks that each step touches, (m, 8, 3), and the bits that it needs of each, (m, 8)."""
    table = [_needed(tuple(way), tuple(along.tolist())) for way in ways.tolist()]
    blocks, bits = [blocks for blocks, _ in table], [bits for _, bits in table]
    return np.array(blocks, np.int64).reshape(-1, 8, 3), np.array(bits, np.int64).reshape(-1, 8)


@functools.lru_cache(maxsize=64)
def _needed(way: Cell, along: Cell) -> tuple[list[Cell], list[int]]:
    """The blocks that one step touches and the bits that it needs, as ``block_mask`` sets them."""
    bits: dict[Cell, int] = {}
    size = along[0] * along[1] * along[2]
    for cell in _touched(way, max(along)):
        places = [f // 2 + d for f, d in zip(along, cell, strict=True)]
        i, j, k = (place // f for place, f in zip(places, along, strict=True))
        x, y, z = (place % f for place, f in zip(places, along, strict=True))
        bit = 1 << (size - 1 - ((x * along[1] + y) * along[2] + z))
        bits[i, j, k] = bits.get((i, j, k), 0) | bit
    signed = [bit - (1 << 64) if bit >= 1 << 63 else bit for bit in bits.values()]
    return [*bits, *[(0, 0, 0)] * (8 - len(bits))], [*signed, *[0] * (8 - len(bits))]
