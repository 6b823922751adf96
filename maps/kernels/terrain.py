"""Kernels of sloping ground: the layer that a walking body stands on in each column.

A surface is an occupied cell with room for the body above it. The ground spreads from the floor
z = 0 and from the surfaces about the body's feet, over surfaces that differ no more than a ramp's
may; all heights are whole layers.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayproof.kernel_compiler import allocating, kernel

WORD_BITS = 64
NOWHERE = -1
STEPS = np.array([[1, 0], [0, 1], [-1, 0], [0, -1], [1, 1], [-1, 1], [-1, -1], [1, -1]])
"""Offsets of a column's neighbours: four along the axes, then four across."""


class Body(NamedTuple):
    """Layers of a walking body.

    Attributes:
        floor: Layer of the window that holds z = 0.
        foot: Layers that a foot steps over, with the one that it stands on.
        tall: Layers of the body, with the one that it stands on.
    """

    floor: int
    foot: int
    tall: int


@kernel
def any_of(words: NDArray[np.uint64], first: int, end: int) -> bool:
    """Return whether any cell of a column (words,) from one layer up to another is set."""
    for z in range(max(first, 0), min(end, WORD_BITS * words.shape[0])):
        if words[z // WORD_BITS] >> np.uint64(z % WORD_BITS) & np.uint64(1) != 0:
            return True
    return False


@kernel
def all_of(words: NDArray[np.uint64], first: int, end: int) -> bool:
    """Return whether all bits from `first` to `end` are set; those beyond the column are not."""
    if first < 0 or end > WORD_BITS * words.shape[0]:
        return False
    for z in range(first, end):
        if words[z // WORD_BITS] >> np.uint64(z % WORD_BITS) & np.uint64(1) == 0:
            return False
    return True


@kernel
def is_surface(
    occupied: NDArray[np.uint64],  # (words,)
    z: int,
    body: Body,
) -> bool:
    """Return whether a body can stand on a cell."""
    return any_of(occupied, z, z + 1) and not any_of(occupied, z + body.foot, z + body.tall)


@kernel
def lowest_surface(
    occupied: NDArray[np.uint64],  # (words,)
    first: int,
    last: int,
    body: Body,
) -> int:
    """Find the lowest surface between two layers, both included; NOWHERE if there is none."""
    for z in range(max(first, 0), last + 1):
        if is_surface(occupied, z, body):
            return z
    return NOWHERE


@allocating
def spread(
    occupied: NDArray[np.uint64],  # (nx, ny, words)
    body: Body,
    rise: int,  # layers to a neighbour; less than 0: take over the neighbour's layer
    ground: NDArray[np.int16],  # (nx, ny) in, out: -1 where there is none yet
) -> None:
    """Let the ground spread to its neighbours, round by round, until it reaches no more.

    In a round each column that has no ground takes the lowest that its neighbours with ground allow
    it, so that the order in which columns are looked at does not matter.
    """
    nx, ny, _ = occupied.shape
    # Breadth first: the edge is the columns that got their ground in the round before.
    edge = np.empty((nx * ny, 2), np.int64)
    count = 0
    for x in range(nx):
        for y in range(ny):
            if ground[x, y] != NOWHERE:
                edge[count] = x, y
                count += 1
    coming = np.full((nx, ny), NOWHERE, np.int16)
    while count > 0:
        reached = np.empty((min(4 * count, nx * ny), 2), np.int64)
        more = 0
        for i in range(count):
            layer = ground[edge[i, 0], edge[i, 1]]
            for k in range(4):
                x, y = edge[i, 0] + STEPS[k, 0], edge[i, 1] + STEPS[k, 1]
                if not (0 <= x < nx and 0 <= y < ny) or ground[x, y] != NOWHERE:
                    continue
                found = int(layer)
                if rise >= 0:
                    found = lowest_surface(occupied[x, y], layer - rise, layer + rise, body)
                if found == NOWHERE:
                    continue
                if coming[x, y] == NOWHERE:
                    reached[more] = x, y
                    more += 1
                    coming[x, y] = found
                coming[x, y] = min(coming[x, y], found)
        # All columns that were reached get their ground at once.
        for i in range(more):
            x, y = reached[i]
            ground[x, y] = coming[x, y]
        edge, count = reached, more


@kernel
def stand(
    occupied: NDArray[np.uint64],  # (nx, ny, words)
    body: Body,
    feet: tuple[int, int, int],  # column and layer; the layer NOWHERE if it is not known
    rises: NDArray[np.int64],  # (n,) layers across by distance
    ground: NDArray[np.int16],  # (nx, ny) in, out: NOWHERE where there is none yet
) -> None:
    """Let the surfaces about the feet that a ramp may lead to from there be ground."""
    nx, ny, _ = occupied.shape
    reach = rises.shape[0] - 1
    if feet[2] == NOWHERE:
        return
    for x in range(max(feet[0] - reach, 0), min(feet[0] + reach + 1, nx)):
        for y in range(max(feet[1] - reach, 0), min(feet[1] + reach + 1, ny)):
            if ground[x, y] == NOWHERE:
                rise = rises[max(abs(x - feet[0]), abs(y - feet[1]))]
                lowest, highest = int(feet[2] - rise), int(feet[2] + rise)
                ground[x, y] = lowest_surface(occupied[x, y], lowest, highest, body)


@kernel
def find_ground(
    occupied: NDArray[np.uint64],  # (nx, ny, words)
    body: Body,
    feet: tuple[int, int, int],  # as of `stand`
    rises: NDArray[np.int64],  # (2, n) as of `is_steep`
    ground: NDArray[np.int16],  # (nx, ny) out: layer that a body stands on
    seen: NDArray[np.bool_],  # (nx, ny) out: whether it is a surface there, or a neighbour's
) -> None:
    """Find the ground: floor and feet, surfaces reached from them, elsewhere a neighbour's."""
    nx, ny, _ = occupied.shape
    for x in range(nx):
        for y in range(ny):
            on_floor = is_surface(occupied[x, y], body.floor, body)
            ground[x, y] = body.floor if on_floor else NOWHERE
    stand(occupied, body, feet, rises[1], ground)
    spread(occupied, body, rises[0, 1], ground)
    for x in range(nx):
        for y in range(ny):
            seen[x, y] = ground[x, y] != NOWHERE
    spread(occupied, body, -1, ground)
    for x in range(nx):
        for y in range(ny):
            if ground[x, y] == NOWHERE:  # then no column has any
                ground[x, y] = body.floor


@kernel
def is_steep(
    x: int,
    y: int,
    ground: NDArray[np.int16],  # (nx, ny)
    seen: NDArray[np.bool_],  # (nx, ny)
    rises: NDArray[np.int64],  # (2, n) by distance: layers along the axes, and across
) -> bool:
    """Return whether the ground falls from a column by more than a ramp's does, any way."""
    nx, ny = ground.shape
    for k in range(8):
        before = ground[x, y]
        limits = rises[k // 4]
        for distance in range(1, limits.shape[0]):
            i, j = x + distance * STEPS[k, 0], y + distance * STEPS[k, 1]
            if not (0 <= i < nx and 0 <= j < ny and seen[i, j]):
                break
            if ground[x, y] - ground[i, j] > limits[distance]:
                return True
            if abs(before - ground[i, j]) > limits[1]:
                break  # another ground begins there
            before = ground[i, j]
    return False


@kernel
def project_terrain(
    occupied: NDArray[np.uint64],  # (nx, ny, words) along z
    free: NDArray[np.uint64],  # (nx, ny, words)
    body: Body,
    feet: tuple[int, int, int],  # as of `stand`
    rises: NDArray[np.int64],  # (2, n) as of `is_steep`
    ground: NDArray[np.int16],  # (nx, ny) out
    seen: NDArray[np.bool_],  # (nx, ny) out
    occupied_columns: NDArray[np.uint64],  # (nx, words) along y, out, zero before
    free_columns: NDArray[np.uint64],  # (nx, words) out, zero before
) -> None:
    """Find the state of each column of cells for a body that walks on the ground below it."""
    (nx, ny, _), (floor, foot, tall) = occupied.shape, body
    find_ground(occupied, body, feet, rises, ground, seen)
    for x in range(nx):
        for y in range(ny):
            z = int(ground[x, y])
            word, bit = y // WORD_BITS, np.uint64(1) << np.uint64(y % WORD_BITS)
            # A beam that went through where the floor should be found a hole; below a ramp, air.
            # Where nothing was seen, such as behind a crest, the ground may fall as a ramp does.
            fall = 0 if seen[x, y] or feet[2] == NOWHERE else rises[0, -1]
            hole = any_of(free[x, y], 0, z - fall) and not (seen[x, y] and z != floor)
            met = any_of(occupied[x, y], z + foot, z + tall)
            if hole or met or (seen[x, y] and is_steep(x, y, ground, seen, rises)):
                occupied_columns[x, word] |= bit
            elif any_of(occupied[x, y], z, z + foot) and all_of(free[x, y], z + foot, z + tall):
                free_columns[x, word] |= bit
