"""Compiled kernels of a sweep: where its beams end, and which cells they cross.

Cells are marked in a dense window around the sweep: a word of 64 bits is 64 cells of a column along
z. A target is such a word with the cells that beams end in. All kernels that call each other live
in this file because a cached kernel is not recompiled when another file changes.

The beams are defined in integers, cell by cell:

1. A beam runs from the middle of the sensor's sub-cell to the middle of the cell that it ends in;
   those that end in the same cell are one (the "discretize" of OctoMap's insertPointCloud).
2. Seen from its end it meets the k-th face along x (k = 0, 1, ...) at the fraction
   (2 k + 1) (2^49 // |dx|) / 2^40 of its way, with dx in 1/1024 of a cell; likewise along y. Where
   both are equal, x goes first.
3. Its height at a face is rounded down to a whole cell. In a column it crosses the cells between
   its height where it enters and its height where it leaves.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from maps._jit import kernel

# What became of a beam.
RETURNED = 0
CLEARED = 1
DROPPED = 2
TOO_NEAR = 3

NO_RETURN_MM = 65535
DROPPED_MM = 0

SUBCELL_BITS = 9
SUBCELLS = 1 << SUBCELL_BITS  # positions per cell and axis: 0.2 mm at 10 cm
HALVES_BITS = SUBCELL_BITS + 1  # in 1/1024 of a cell the middles of cells and sub-cells are whole
HALVES = 1 << HALVES_BITS
FLOOR_SUBCELLS = 3 * SUBCELLS // 4  # the plane z = 0 lies this high in its layer

MAX_BEAM_CELLS = 2047
UNIT_TOLERANCE = 1e-6

CHUNK = 256  # beams that are worked out together, in whole vectors

# Flags of a column.
LISTED = np.uint8(1)
GRAZED = np.uint8(2)  # a beam ends in its guarded layer

# Flags of a target.
SPARING = 1  # beams to its guarded layer spare that layer
OUTSIDE = 2  # the only cell of its word, which lies outside the box

SECTORS = 4096
WEDGE = 64  # sectors; their borders lie on the diagonals
WEDGES = SECTORS // WEDGE

ONE = np.uint64(1)


@kernel
def locate(
    origin: tuple[float, float, float],  # m
    directions: NDArray[np.float64],  # (n, 3) unit
    ranges_mm: NDArray[np.uint16],  # (n,)
    limits_mm: tuple[int, int],  # nearest and farthest return
    scale: float,  # sub-cells a metre
    cells: NDArray[np.int64],  # (3, CHUNK) out
    fates: NDArray[np.int64],  # (CHUNK,) out
) -> bool:
    """The cell that each beam ends in; the origin's own of one that tells nothing.

    Without branches, so that beams are worked out in vectors. Tells if all are of unit length.
    """
    x, y, z = origin
    nearest, farthest = limits_mm
    strange = 0
    for i in range(ranges_mm.shape[0]):
        dx, dy, dz = directions[i, 0], directions[i, 1], directions[i, 2]
        strange |= not abs(dx * dx + dy * dy + dz * dz - 1.0) < UNIT_TOLERANCE  # also NaN
        millimetres = int(ranges_mm[i])
        clears = (millimetres == NO_RETURN_MM) | (millimetres > farthest)
        fate = CLEARED if clears else RETURNED
        fate = TOO_NEAR if millimetres < nearest else fate
        fate = DROPPED if millimetres == DROPPED_MM else fate
        fates[i] = fate
        reach = int(farthest) if clears else millimetres
        length = (reach if fate <= CLEARED else int(np.int64(0))) / 1000.0
        cells[0, i] = int(np.floor((x + dx * length) * scale)) >> SUBCELL_BITS
        cells[1, i] = int(np.floor((y + dy * length) * scale)) >> SUBCELL_BITS
        height = int(np.floor((z + dz * length) * scale)) + FLOOR_SUBCELLS
        cells[2, i] = height >> SUBCELL_BITS
    return strange == 0


@kernel
def widen(cells: NDArray[np.int64], n: int, box: NDArray[np.int64]) -> None:
    """Widen a box (2, 3) so that it holds the first cells of (3, CHUNK)."""
    for axis in range(3):
        low, high = box[0, axis], box[1, axis]
        for i in range(n):
            low, high = min(low, cells[axis, i]), max(high, cells[axis, i])
        box[0, axis], box[1, axis] = low, high


@kernel
def list_ends(
    cells: NDArray[np.int64],  # (3, CHUNK)
    fates: NDArray[np.int64],  # (CHUNK,)
    n: int,  # of them
    group: int,
    ends: NDArray[np.int32],  # (k, 5) out
    listed: int,  # so far
    counts: NDArray[np.int64],  # (4,) in, out: beams by fate
) -> int:
    """List the beams that tell anything, successive ones to one cell once.

    Returns:
        Number of beams listed with these.
    """
    returned = cleared = dropped = 0
    last_x, last_y, last_z, last_fate = cells[0, 0], cells[1, 0], cells[2, 0], int(DROPPED)
    for i in range(n):
        x, y, z, fate = cells[0, i], cells[1, i], cells[2, i], fates[i]
        other = (x ^ last_x) | (y ^ last_y) | (z ^ last_z) | (fate ^ last_fate)
        # Without a branch: which beams end in a cell of their own cannot be foreseen.
        ends[listed, 0], ends[listed, 1], ends[listed, 2] = x, y, z
        ends[listed, 3], ends[listed, 4] = fate, group
        listed += (other != 0) & (fate <= CLEARED)
        last_x, last_y, last_z, last_fate = x, y, z, fate
    for i in range(n):
        returned += fates[i] == RETURNED
        cleared += fates[i] == CLEARED
        dropped += fates[i] == DROPPED
    counts[RETURNED] += returned
    counts[CLEARED] += cleared
    counts[DROPPED] += dropped
    counts[TOO_NEAR] += n - returned - cleared - dropped
    return listed


@kernel
def place_ends(
    origins: NDArray[np.float64],  # (m, 3) m
    groups: NDArray[np.int64],  # (m + 1,) first beam of each origin, and the end
    directions: NDArray[np.float64],  # (n, 3) unit
    ranges_mm: NDArray[np.uint16],  # (n,)
    limits_mm: tuple[int, int],  # nearest and farthest return
    resolution: float,
    beams: tuple[int, int],  # first and one past the last to look at
    ends: NDArray[np.int32],  # (k, 5) out: cell, fate and origin of beams, k of them or fewer
    box: NDArray[np.int64],  # (2, 3) least and greatest cell, widened to hold the ends
    counts: NDArray[np.int64],  # (4,) in, out: beams by fate
    cells: NDArray[np.int64],  # (3, CHUNK) scratch
    fates: NDArray[np.int64],  # (CHUNK,) scratch
) -> int:
    """Find where beams end, and list those that tell anything.

    Returns:
        Number of ends listed; -1 if a direction is not of unit length.
    """
    scale = SUBCELLS / resolution
    listed = int(np.int64(0))  # a plain 0 would be compiled for itself
    for k in range(origins.shape[0]):
        origin = (origins[k, 0], origins[k, 1], origins[k, 2])
        end = min(groups[k + 1], beams[1])
        for first in range(max(groups[k], beams[0]), end, CHUNK):
            last = min(first + CHUNK, end)
            beams_here = directions[first:last], ranges_mm[first:last]
            if not locate(origin, *beams_here, limits_mm, scale, cells, fates):
                return -1
            widen(cells, last - first, box)
            listed = list_ends(cells, fates, last - first, k, ends, listed, counts)
    return listed


@kernel
def write_target(
    targets: NDArray[np.int32],
    at: int,
    x: int,
    y: int,
    group: int,
    bottom: int,
    flags: int,
) -> None:
    """Write one target."""
    targets[at, 0], targets[at, 1], targets[at, 2] = x, y, group
    targets[at, 3], targets[at, 4] = bottom, flags


@kernel
def list_columns(
    columns: NDArray[np.int32],  # (k,)
    group: int,
    guarded_layer: int,  # -1: none
    shape: tuple[int, int, int],
    aims: NDArray[np.uint64],  # (nx * ny * words,) zero after
    flags: NDArray[np.uint8],  # (nx * ny,) zero after
    targets: NDArray[np.int32],  # (n, 5) out
    bits: NDArray[np.uint64],  # (n,) out
    count: int,  # of the targets so far
) -> int:
    """List the words of columns that beams end in; return the number of targets with these."""
    _, ny, words = shape
    for j in range(columns.shape[0]):
        column = int(columns[j])
        grazed = flags[column] & GRAZED != 0
        flags[column] = 0
        for word in range(words):
            ends, sparing = aims[column * words + word], 0
            aims[column * words + word] = 0
            if grazed and guarded_layer >> 6 == word:
                guarded = ONE << np.uint64(guarded_layer & 63)
                # Else a beam that is not spared ends there as well.
                sparing = SPARING if ends & guarded == 0 else 0
                ends |= guarded
            if ends != 0:
                write_target(targets, count, column // ny, column % ny, group, 64 * word, sparing)
                bits[count] = ends
                count += 1
    return count


@kernel
def list_targets(
    ends: NDArray[np.int32],  # (n, 5) cell, fate, origin
    parts: NDArray[np.int64],  # (p, 2) first and one past the last of those listed
    sensors: NDArray[np.int64],  # (m, 3) 1/1024 of a cell, from the window's corner
    corner: tuple[int, int, int],  # cell at the window's corner
    box: tuple[int, int, int, int, int, int],  # least and greatest cell that may be marked
    guarded_layer: int,  # from the window's bottom; -1: none
    shape: tuple[int, int, int],  # (nx, ny, words)
    hits: NDArray[np.uint64],  # (nx * ny * words,) out
    aims: NDArray[np.uint64],  # (nx * ny * words,) zero before and after
    flags: NDArray[np.uint8],  # (nx * ny,) zero before and after
    columns: NDArray[np.int32],  # (n,) scratch
    targets: NDArray[np.int32],  # (n, 5) out: x, y, sensor position, least cell of the word, flags
    bits: NDArray[np.uint64],  # (n,) out: the cells of the word that beams end in
    groups: NDArray[np.int64],  # (m + 1,) out: first target of each sensor position, and the end
) -> int:
    """Mark the cells that are hit, and list the words of cells that beams end in.

    Ends outside the box are listed singly: there are no masks for them.

    Returns:
        Number of targets.
    """
    _, ny, words = shape
    x0, y0, z0, x1, y1, z1 = box
    count = listed = part = int(np.int64(0))
    at = parts[0, 0]
    for k in range(sensors.shape[0]):
        groups[k] = count
        guarded = guarded_layer if sensors[k, 2] >> HALVES_BITS > guarded_layer else -1
        listed = 0
        while part < parts.shape[0]:
            if at == parts[part, 1]:
                part += 1
                at = parts[min(part, parts.shape[0] - 1), 0]
                continue
            if ends[at, 4] != k:
                break
            x, y, z = int(ends[at, 0]), int(ends[at, 1]), int(ends[at, 2])
            x, y, z = x - corner[0], y - corner[1], z - corner[2]
            returned = ends[at, 3] == RETURNED
            at += 1
            grazing = returned and z == guarded
            if not (x0 <= x <= x1 and y0 <= y <= y1 and z0 <= z <= z1):
                write_target(targets, count, x, y, k, z, OUTSIDE | (SPARING if grazing else 0))
                bits[count] = ONE
                count += 1
                continue
            column = x * ny + y
            word, bit = column * words + (z >> 6), ONE << np.uint64(z & 63)
            if returned:
                hits[word] |= bit
            if not grazing:
                aims[word] |= bit
            if flags[column] == 0:
                columns[listed] = column
                listed += 1
            flags[column] |= LISTED | GRAZED if grazing else LISTED
        count = list_columns(columns[:listed], k, guarded, shape, aims, flags, targets, bits, count)
    groups[sensors.shape[0]] = count
    return count


@kernel
def order_targets(
    targets: NDArray[np.int32],  # (n, 5)
    groups: NDArray[np.int64],  # (m + 1,) first target of each sensor position, and the end
    sensors: NDArray[np.int64],  # (m, 3)
    places: NDArray[np.int64],  # (WEDGE,) of a wedge's sectors, in which to carve them
    starts: NDArray[np.int64],  # (SECTORS + 1,) scratch
    ranks: NDArray[np.int32],  # (n,) scratch
    order: NDArray[np.int32],  # (n,) out
    wedges: NDArray[np.int64],  # (k, 3) out: first target, one past the last, sensor position
) -> int:
    """Order targets by the direction that they lie in: the next beam then meets what the last did.

    A counting sort, as it keeps the words of a column together.

    Returns:
        Number of wedges that hold any.
    """
    count = 0
    for k in range(sensors.shape[0]):
        for sector in range(SECTORS + 1):
            starts[sector] = 0
        starts[0] = groups[k]
        for i in range(groups[k], groups[k + 1]):
            along = HALVES * int(targets[i, 0]) + SUBCELLS - sensors[k, 0]
            across = HALVES * int(targets[i, 1]) + SUBCELLS - sensors[k, 1]
            slope = across / (abs(along) + abs(across))  # both odd
            quarters = 1.0 + slope if along > 0 else 3.0 - slope  # 0 to 4
            sector = int(quarters * (SECTORS / 4.0)) % SECTORS
            rank = sector // WEDGE * WEDGE + places[sector % WEDGE]
            ranks[i] = rank
            starts[rank + 1] += 1
        for sector in range(SECTORS):
            starts[sector + 1] += starts[sector]
        for wedge in range(WEDGES):
            first, end = starts[wedge * WEDGE], starts[(wedge + 1) * WEDGE]
            if end > first:
                wedges[count, 0], wedges[count, 1], wedges[count, 2] = first, end, k
                count += 1
        for i in range(groups[k], groups[k + 1]):
            order[starts[ranks[i]]] = i
            starts[ranks[i]] += 1
    return count
