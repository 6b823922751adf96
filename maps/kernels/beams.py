"""Beams of a sweep: their definition in integers, and the cells that they end in.

The beams are defined cell by cell, so that every machine crosses the same cells:

1. A beam runs from the middle of the sensor's sub-cell to the middle of the cell that it ends in;
   those that end in the same cell are one (the "discretize" of OctoMap's insertPointCloud).
2. Seen from its end it meets the k-th face along x (k = 0, 1, ...) at the fraction
   (2 k + 1) (2^49 // |dx|) / 2^40 of its way, with dx in 1/1024 of a cell; likewise along y. Where
   both are equal, x goes first.
3. Its height at a face is rounded down to a whole cell. In a column it crosses the cells between
   its height where it enters and its height where it leaves.

An end is packed into one number: the index of its origin, whether something was met, and the cell,
counted from the origin's own.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayproof.kernel_compiler import kernel

# Fate of a beam.
RETURNED = 0
CLEARED = 1  # without return within the limit: it only clears
DROPPED = 2
TOO_NEAR = 3

NO_RETURN_MM = 65535
DROPPED_MM = 0

SUBCELL_BITS = 9
SUBCELLS = 1 << SUBCELL_BITS  # positions per cell and axis: 0.2 mm at 10 cm
HALVES_BITS = SUBCELL_BITS + 1  # in 1/1024 of a cell the middles of cells and sub-cells are whole
HALVES = 1 << HALVES_BITS
FLOOR_SUBCELLS = 3 * SUBCELLS // 4  # height of the plane z = 0 in its layer

MAX_BEAM_CELLS = 2047
UNIT_TOLERANCE = 1e-6

# A packed end, from its lowest bits up: z, y, x from the origin's cell, fate, origin.
CELL_BITS = 13
HALF_SPAN = 1 << (CELL_BITS - 1)  # more than a beam is long
CELL_MASK = (1 << CELL_BITS) - 1
FATE_BIT = 3 * CELL_BITS
ORIGIN_BIT = FATE_BIT + 1
MAX_ORIGINS = 1 << (63 - ORIGIN_BIT)
NO_END = -1

CHUNK = 256  # beams that are computed together, in whole vectors

ONE, TWO = np.uint64(1), np.uint64(2)


class SweepBeams(NamedTuple):
    """Beams of a sweep.

    Attributes:
        origins: (m, 3) where beams start, m.
        sensors: (m, 3) sub-cells that the origins lie in.
        groups: (m + 1,) first beam of each origin, and the end.
        directions: (3 n,) unit vectors.
        ranges_mm: (n,) measured ranges, mm.
        limits_mm: Nearest and farthest return, mm.
        resolution: Edge of a cell, m.
    """

    origins: NDArray[np.float64]
    sensors: NDArray[np.int64]
    groups: NDArray[np.int64]
    directions: NDArray[np.float64]
    ranges_mm: NDArray[np.uint16] | NDArray[np.uint32]
    limits_mm: tuple[int, int]
    resolution: float


class EndLists(NamedTuple):
    """Ends of the beams of a sweep, written by `place_ends`.

    Attributes:
        ends: (n,) packed ends; the first are listed.
        box: (2, 3) least and greatest cell of origins and ends.
        counts: (4,) number of beams by fate; added to.
    """

    ends: NDArray[np.int64]
    box: NDArray[np.int64]
    counts: NDArray[np.int64]


@kernel
def locate_sensors(
    origins: NDArray[np.float64],  # (m, 3) m
    largest: float,  # coordinate, m
    scale: float,  # sub-cells a metre
    sensors: NDArray[np.int64],  # (m, 3) out: sub-cells that they lie in
) -> int:
    """Find the sub-cells that sensors lie in.

    Returns:
        Index of the first origin that is not finite or too far away; -1 if there is none.
    """
    for k in range(origins.shape[0]):
        for axis in range(3):
            if not abs(origins[k, axis]) <= largest:
                return k
            shift = float(FLOOR_SUBCELLS) if axis == 2 else 0.0
            sensors[k, axis] = int(np.floor(origins[k, axis] * scale + shift))
    return -1


@kernel
def locate_ends(
    origin: tuple[float, float, float],  # m
    directions: NDArray[np.float64],  # (3 n,) unit vectors
    ranges_mm: NDArray[np.uint16] | NDArray[np.uint32],  # (n,)
    limits_mm: tuple[int, int],  # nearest and farthest return
    scale: float,  # sub-cells a metre
    cells: NDArray[np.int64],  # (4, CHUNK) out: x, y, z and fate
) -> bool:
    """Find the cell that each beam ends in; the origin's own for one without information.

    Without branches, so that beams are computed in vectors, and directions in one row: of rows of
    an array the compiler does not know how far apart they are.

    Returns:
        Whether all directions are of unit length.
    """
    x, y, z = origin
    nearest, farthest = limits_mm
    strange = 0
    for i in range(np.uint64(ranges_mm.shape[0])):
        k = np.uint64(3) * i
        dx, dy, dz = directions[k], directions[k + ONE], directions[k + TWO]
        strange |= not abs(dx * dx + dy * dy + dz * dz - 1.0) < UNIT_TOLERANCE  # also NaN
        # Fate: each condition overrides those before.
        millimetres = int(ranges_mm[i])
        clears = (millimetres == NO_RETURN_MM) | (millimetres > farthest)
        fate = CLEARED if clears else RETURNED
        fate = TOO_NEAR if millimetres < nearest else fate
        fate = DROPPED if millimetres == DROPPED_MM else fate
        # End point, rounded down to sub-cells and then to cells.
        reach = int(farthest) if clears else millimetres
        length = (reach if fate <= CLEARED else int(np.int64(0))) / 1000.0
        cells[0, i] = int(np.floor((x + dx * length) * scale)) >> SUBCELL_BITS
        cells[1, i] = int(np.floor((y + dy * length) * scale)) >> SUBCELL_BITS
        height = int(np.floor((z + dz * length) * scale)) + FLOOR_SUBCELLS
        cells[2, i], cells[3, i] = height >> SUBCELL_BITS, fate
    return strange == 0


@kernel
def widen_box(cells: NDArray[np.int64], n: int, box: NDArray[np.int64]) -> None:
    """Widen a box (2, 3) to hold the first `n` cells of (4, CHUNK)."""
    for axis in range(3):
        low, high = box[0, axis], box[1, axis]
        for i in range(n):
            low, high = min(low, cells[axis, i]), max(high, cells[axis, i])
        box[0, axis], box[1, axis] = low, high


@kernel
def pack_ends(
    cells: NDArray[np.int64],  # (4, CHUNK)
    n: int,  # of them
    origin_cell: tuple[int, int, int],
    group: int,  # index of the origin
    packed: NDArray[np.int64],  # (CHUNK,) out
) -> None:
    """Pack each end into one number; NO_END for a beam without information."""
    x, y, z = origin_cell
    x, y, z = x - HALF_SPAN, y - HALF_SPAN, z - HALF_SPAN
    origin = group << ORIGIN_BIT
    for i in range(n):
        end = origin | cells[3, i] << FATE_BIT | (cells[0, i] - x) << (2 * CELL_BITS)
        end |= (cells[1, i] - y) << CELL_BITS | (cells[2, i] - z)
        packed[i] = end if cells[3, i] <= CLEARED else NO_END


@kernel
def list_ends(
    cells: NDArray[np.int64],  # (4, CHUNK)
    packed: NDArray[np.int64],  # (CHUNK,)
    n: int,  # of them
    ends: NDArray[np.int64],  # (k,) in, out
    listed: int,  # of these so far
    counts: NDArray[np.int64],  # (4,) in, out: beams by fate
) -> int:
    """List the ends of beams with information, successive equal ones once; return their number."""
    # Unsigned: for a signed index each access tests whether it counts from the end.
    last, at = int(NO_END), np.uint64(listed)
    for i in range(np.uint64(n)):
        # Without a branch: which beams end in a cell of their own cannot be foreseen.
        end = packed[i]
        ends[at] = end
        at += np.uint64((end != last) & (end != NO_END))
        last = end
    returned = cleared = dropped = 0
    for i in range(n):
        returned += cells[3, i] == RETURNED
        cleared += cells[3, i] == CLEARED
        dropped += cells[3, i] == DROPPED
    counts[RETURNED] += returned
    counts[CLEARED] += cleared
    counts[DROPPED] += dropped
    counts[TOO_NEAR] += n - returned - cleared - dropped
    return int(np.int64(at))


@kernel
def place_ends(
    beams: SweepBeams,
    lists: EndLists,  # out
    cells: NDArray[np.int64],  # (4, CHUNK) scratch
    packed: NDArray[np.int64],  # (CHUNK,) scratch
) -> int:
    """Find where beams end, and list the ends.

    Returns:
        Number of ends; -1 if a direction is not of unit length.
    """
    origins, sensors, groups, directions, ranges_mm, limits_mm, resolution = beams
    ends, box, counts = lists
    scale, listed = SUBCELLS / resolution, int(np.int64(0))
    # The box begins with the cells of all origins.
    for axis in range(3):
        box[0, axis] = box[1, axis] = sensors[0, axis] >> SUBCELL_BITS
        for k in range(1, sensors.shape[0]):
            cell = sensors[k, axis] >> SUBCELL_BITS
            box[0, axis], box[1, axis] = min(box[0, axis], cell), max(box[1, axis], cell)
    # Origin by origin, the beams of each in chunks.
    for k in range(origins.shape[0]):
        origin = (origins[k, 0], origins[k, 1], origins[k, 2])
        x, y, z = sensors[k, 0], sensors[k, 1], sensors[k, 2]
        origin_cell = (x >> SUBCELL_BITS, y >> SUBCELL_BITS, z >> SUBCELL_BITS)
        end = groups[k + 1]
        for first in range(groups[k], end, CHUNK):
            last = min(first + CHUNK, end)
            chunk_directions, chunk_ranges = directions[3 * first : 3 * last], ranges_mm[first:last]
            if not locate_ends(origin, chunk_directions, chunk_ranges, limits_mm, scale, cells):
                return -1
            widen_box(cells, last - first, box)
            pack_ends(cells, last - first, origin_cell, k, packed)
            listed = list_ends(cells, packed, last - first, ends, listed, counts)
    return listed
