"""Kernels of the truncated signed distance field (TSDF): distances of a sweep, and their fusion.

Positions are whole 1/1024 of a cell, distances whole 1/256. A beam measures in each cell that it
crosses the distance from the cell's middle to the beam's end, along the beam: positive before the
surface, negative behind. Of several beams that cross a cell in one sweep the distance with the
highest score counts: the one nearest to a surface there, so that no beam that grazes it erases it;
but that of a beam that passed through the cell before that of one whose surface hides it. The
greatest score does not depend on the order, so neither does the map.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayproof.kernel_compiler import kernel
from wayproof.maps.states import FREE, OCCUPIED, UNKNOWN

HALVES_BITS = 10
HALVES = 1 << HALVES_BITS  # to a cell: the middles of cells and of sub-cells are whole
HALVES_IN_UNIT = 4
UNITS = HALVES // HALVES_IN_UNIT  # of distance to a cell

TRUNCATION_CELLS = 4  # Oleynikova et al. 2017, "Voxblox", IV-C: truncation of 4 cells,
DROP_OFF_CELLS = 1  # and from one cell behind the surface on the weight falls to 0 there
TRUNCATION = TRUNCATION_CELLS * UNITS
DROP_OFF = DROP_OFF_CELLS * UNITS
SURFACE = 221  # half the diagonal of a cell, 256 sqrt(3) / 2, rounded down

FULL_WEIGHT = 8  # of one sweep
MAX_WEIGHT = 15 * FULL_WEIGHT  # fits an int8, and lets go of what has moved within few sweeps

EDGE_BITS = 4
EDGE = 1 << EDGE_BITS  # cells along a block's edge; Voxblox's as well
CELLS_BITS = 3 * EDGE_BITS

BEST = 8191  # score of distance 0; 0 is that of a cell that no beam crosses
HIDDEN = 4096

CONTENT_CHANGED = 1
STATES_CHANGED = 2


class TraceWindow(NamedTuple):
    """Window of blocks in which beams are traced.

    Attributes:
        shape: Number of blocks along each axis.
        inside: (2, 3) least cell to be updated and one past the greatest.
        guarded_layer: Layer that beams from above that end in it do not clear; -1 for none.
    """

    shape: tuple[int, int, int]
    inside: NDArray[np.int64]
    guarded_layer: int


class TsdfLayers(NamedTuple):
    """Cells of blocks.

    Attributes:
        distances: (slots, 4096) averaged distance, 1/256 of a cell.
        weights: (slots, 4096) their weights.
        fresh: (slots, 4096) whether a cell was updated since the last tick of decay.
    """

    distances: NDArray[np.int16]
    weights: NDArray[np.int8]
    fresh: NDArray[np.bool_]


@kernel
def score_of(distance: int) -> int:
    """Rank of a distance among those of one sweep; of two equally long ones the negative wins."""
    rank = 2 * abs(distance) + (1 if distance > 0 else 0)
    return BEST - rank - (HIDDEN if distance < -SURFACE - 1 else 0)


@kernel
def distance_of(score: int) -> int:
    """Return the distance that has a score."""
    rank = (BEST - score) & (HIDDEN - 1)
    return rank >> 1 if rank & 1 else -(rank >> 1)


@kernel
def weight_of(distance: int) -> int:
    """Return a distance's weight (Oleynikova et al. 2017, eq. 2, but independent of the range).

    Their 1 / z^2 is the noise of a depth camera; that of a lidar does not grow with the range.
    """
    if distance >= -DROP_OFF:
        return FULL_WEIGHT
    return max(FULL_WEIGHT * (distance + TRUNCATION) // (TRUNCATION - DROP_OFF), 0)


@kernel
def state_of(distance: int, weight: int) -> int:
    """Return the state of a cell: occupied if the surface may touch it, or behind the surface."""
    if weight == 0:
        return UNKNOWN
    return OCCUPIED if distance <= SURFACE else FREE


@kernel
def trace(
    start: tuple[int, int, int],  # from the window's corner, odd
    end: tuple[int, int, int],  # odd
    returned: bool,
    window: TraceWindow,
    scores: NDArray[np.uint16],  # (cells,) in, out, block by block
    touched: NDArray[np.bool_],  # (blocks,) out
) -> None:
    """Score the cells that one beam crosses, up to the truncation behind its end.

    Amanatides & Woo (1987), "A fast voxel traversal algorithm for ray tracing", in integers. A beam
    from above that ends in the guarded layer ends at a level floor: it does not clear that layer,
    and what is above it is free, though less than half a cell's diagonal away.
    """
    shape, inside, guarded_layer = window
    to_end_x, to_end_y, to_end_z = end[0] - start[0], end[1] - start[1], end[2] - start[2]
    length = int(np.sqrt(float(to_end_x * to_end_x + to_end_y * to_end_y + to_end_z * to_end_z)))
    far_x, far_y, far_z = end
    if returned and length > 0:
        beyond = TRUNCATION_CELLS * HALVES
        far_x = (far_x + beyond * to_end_x // length) | 1  # odd: never on a face
        far_y = (far_y + beyond * to_end_y // length) | 1
        far_z = (far_z + beyond * to_end_z // length) | 1
    # Along each axis: the extent of the beam, its direction, and how far it is to the next face.
    run_x, run_y, run_z = abs(far_x - start[0]), abs(far_y - start[1]), abs(far_z - start[2])
    step_x = 1 if far_x > start[0] else -1
    step_y = 1 if far_y > start[1] else -1
    step_z = 1 if far_z > start[2] else -1
    x, y, z = start[0] >> HALVES_BITS, start[1] >> HALVES_BITS, start[2] >> HALVES_BITS
    to_x = (x + 1) * HALVES - start[0] if step_x > 0 else start[0] - x * HALVES
    to_y = (y + 1) * HALVES - start[1] if step_y > 0 else start[1] - y * HALVES
    to_z = (z + 1) * HALVES - start[2] if step_z > 0 else start[2] - z * HALVES
    steps = abs((far_x >> HALVES_BITS) - x)
    steps += abs((far_y >> HALVES_BITS) - y) + abs((far_z >> HALVES_BITS) - z)
    spares = returned and end[2] >> HALVES_BITS == guarded_layer and z > guarded_layer
    middle = HALVES // 2
    ahead = (  # from the cell's middle to the end, along the beam, times the beam's length
        (end[0] - x * HALVES - middle) * to_end_x
        + (end[1] - y * HALVES - middle) * to_end_y
        + (end[2] - z * HALVES - middle) * to_end_z
    )
    unit = max(HALVES_IN_UNIT * length, 1)
    for _ in range(steps + 1):
        # Distance from the cell's middle to the end, truncated.
        distance = TRUNCATION
        if returned and ahead < TRUNCATION * unit:
            distance = ahead // unit
        if spares and z > guarded_layer:
            distance = max(distance, SURFACE + 1)
        counts = inside[0, 0] <= x < inside[1, 0] and inside[0, 1] <= y < inside[1, 1]
        counts = counts and inside[0, 2] <= z < inside[1, 2] and distance > -TRUNCATION
        if counts and not (spares and z == guarded_layer and distance > SURFACE):
            block = ((x >> EDGE_BITS) * shape[1] + (y >> EDGE_BITS)) * shape[2] + (z >> EDGE_BITS)
            place = (x & (EDGE - 1)) << (2 * EDGE_BITS) | (y & (EDGE - 1)) << EDGE_BITS
            at = block << CELLS_BITS | place | z & (EDGE - 1)
            scores[at] = max(scores[at], score_of(distance))
            touched[block] = True
        # Where two faces are met at once, x goes first, then y.
        if to_x * run_y <= to_y * run_x and to_x * run_z <= to_z * run_x and run_x > 0:
            x += step_x
            to_x += HALVES
            ahead -= step_x * HALVES * to_end_x
        elif to_y * run_z <= to_z * run_y and run_y > 0:
            y += step_y
            to_y += HALVES
            ahead -= step_y * HALVES * to_end_y
        else:
            z += step_z
            to_z += HALVES
            ahead -= step_z * HALVES * to_end_z


@kernel
def trace_all(
    starts: NDArray[np.int64],  # (k, 3) 1/1024 of a cell from the window's corner, odd
    ends: NDArray[np.int64],  # (k, 3)
    returned: NDArray[np.bool_],  # (k,)
    window: TraceWindow,
    scores: NDArray[np.uint16],  # (cells,) in, out
    touched: NDArray[np.bool_],  # (blocks,) out
) -> None:
    """Score the cells that beams cross."""
    for i in range(starts.shape[0]):
        start = (starts[i, 0], starts[i, 1], starts[i, 2])
        end = (ends[i, 0], ends[i, 1], ends[i, 2])
        trace(start, end, returned[i], window, scores, touched)


@kernel
def update_blocks(
    slots: NDArray[np.int64],  # (k,) -1: there was no room
    indices: NDArray[np.int64],  # (k,) index of each block in the window
    scores: NDArray[np.uint16],  # (cells,) zero after
    layers: TsdfLayers,  # in, out
    changes: NDArray[np.uint8],  # (k,) out: flags
    updated: NDArray[np.int64],  # (k,) out: number of cells
) -> None:
    """Average the distances of a sweep into the cells (Curless & Levoy 1996, eq. 3 and 4)."""
    distances, weights, fresh = layers
    for i in range(slots.shape[0]):
        slot = slots[i]
        for cell in range(1 << CELLS_BITS):
            at = (indices[i] << CELLS_BITS) + cell
            score = int(scores[at])
            scores[at] = 0
            distance = distance_of(score)
            weight = weight_of(distance)
            if score == 0 or slot < 0 or weight == 0:
                continue
            # The weighted mean, rounded to the nearest.
            before, held = int(distances[slot, cell]), int(weights[slot, cell])
            both = held + weight
            after = (2 * (held * before + weight * distance) + both) // (2 * both)
            left = min(both, MAX_WEIGHT)
            distances[slot, cell], weights[slot, cell] = after, left
            fresh[slot, cell] = True
            updated[i] += 1
            if after != before or left != held:
                changes[i] |= CONTENT_CHANGED
            if state_of(after, left) != state_of(before, held):
                changes[i] |= STATES_CHANGED


@kernel
def states_of(
    distances: NDArray[np.int16],  # (n,)
    weights: NDArray[np.int8],  # (n,)
    states: NDArray[np.uint8],  # (n,) out
) -> None:
    """Find the states of cells."""
    for i in range(distances.shape[0]):
        states[i] = state_of(int(distances[i]), int(weights[i]))


@kernel
def write_columns(
    slots: NDArray[np.int64],  # (k,)
    firsts: NDArray[np.int64],  # (k, 3) least cell of each block, from the window's
    layers: TsdfLayers,
    occupied: NDArray[np.uint64],  # (nx, ny, words) out, zero before
    free: NDArray[np.uint64],  # (nx, ny, words) out, zero before
) -> None:
    """Write the states of a window of cells, a bit each."""
    distances, weights, _ = layers
    nx, ny, words = occupied.shape
    for i in range(slots.shape[0]):
        slot = slots[i]
        for x in range(max(firsts[i, 0], 0), min(firsts[i, 0] + EDGE, nx)):
            for y in range(max(firsts[i, 1], 0), min(firsts[i, 1] + EDGE, ny)):
                column = ((x - firsts[i, 0]) << EDGE_BITS | (y - firsts[i, 1])) << EDGE_BITS
                for z in range(max(firsts[i, 2], 0), min(firsts[i, 2] + EDGE, 64 * words)):
                    cell = column + z - firsts[i, 2]
                    state = state_of(int(distances[slot, cell]), int(weights[slot, cell]))
                    bit = np.uint64(1) << np.uint64(z & 63)
                    if state == OCCUPIED:
                        occupied[x, y, z >> 6] |= bit
                    elif state == FREE:
                        free[x, y, z >> 6] |= bit
