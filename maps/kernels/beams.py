"""Compiled kernels of a sweep: where its beams end, and which cells they cross.

Cells are marked in a dense window around the sweep: a word of 64 bits is 64 cells of a column along
z. A target is such a word with the cells that beams end in. Where a beam ends is one number: its
origin, whether it met something, and the cell, from the origin's own one. Columns lie in even or in
odd stripes along x, so that two threads can list targets side by side. All kernels that call each
other live in this file because a cached kernel is not recompiled when another file changes.

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

from wayproof.maps._jit import kernel

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

# An end, from its lowest bits up: z, y, x from the origin's cell, fate, origin.
CELL_BITS = 13
HALF_SPAN = 1 << (CELL_BITS - 1)  # more than a beam is long
CELL_MASK = (1 << CELL_BITS) - 1
FATE_BIT = 3 * CELL_BITS
ORIGIN_BIT = FATE_BIT + 1
MAX_ORIGINS = 1 << (63 - ORIGIN_BIT)
NO_END = -1

STRIPE_BITS = 3  # columns along x that belong together

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

ONE, TWO = np.uint64(1), np.uint64(2)


@kernel
def locate_sensors(
    origins: NDArray[np.float64],  # (m, 3) m
    largest: float,  # coordinate, m
    scale: float,  # sub-cells a metre
    sensors: NDArray[np.int64],  # (m, 3) out: sub-cells that they lie in
) -> int:
    """Returns the index of the first origin that is not finite or too far away, -1 if none is."""
    for k in range(origins.shape[0]):
        for axis in range(3):
            if not abs(origins[k, axis]) <= largest:
                return k
            shift = float(FLOOR_SUBCELLS) if axis == 2 else 0.0
            sensors[k, axis] = int(np.floor(origins[k, axis] * scale + shift))
    return -1


@kernel
def locate(
    origin: tuple[float, float, float],  # m
    directions: NDArray[np.float64],  # (3 n,) unit vectors
    ranges_mm: NDArray[np.uint16],  # (n,)
    limits_mm: tuple[int, int],  # nearest and farthest return
    scale: float,  # sub-cells a metre
    cells: NDArray[np.int64],  # (4, CHUNK) out: x, y, z and fate
) -> bool:
    """The cell that each beam ends in; the origin's own of one that tells nothing.

    Without branches, so that beams are worked out in vectors, and directions in one row: of rows of
    an array the compiler does not know how far apart they are. Tells if all are of unit length.
    """
    x, y, z = origin
    nearest, farthest = limits_mm
    strange = 0
    for i in range(np.uint64(ranges_mm.shape[0])):
        at = np.uint64(3) * i
        dx, dy, dz = directions[at], directions[at + ONE], directions[at + TWO]
        strange |= not abs(dx * dx + dy * dy + dz * dz - 1.0) < UNIT_TOLERANCE  # also NaN
        millimetres = int(ranges_mm[i])
        clears = (millimetres == NO_RETURN_MM) | (millimetres > farthest)
        fate = CLEARED if clears else RETURNED
        fate = TOO_NEAR if millimetres < nearest else fate
        fate = DROPPED if millimetres == DROPPED_MM else fate
        reach = int(farthest) if clears else millimetres
        length = (reach if fate <= CLEARED else int(np.int64(0))) / 1000.0
        cells[0, i] = int(np.floor((x + dx * length) * scale)) >> SUBCELL_BITS
        cells[1, i] = int(np.floor((y + dy * length) * scale)) >> SUBCELL_BITS
        height = int(np.floor((z + dz * length) * scale)) + FLOOR_SUBCELLS
        cells[2, i], cells[3, i] = height >> SUBCELL_BITS, fate
    return strange == 0


@kernel
def widen(cells: NDArray[np.int64], n: int, box: NDArray[np.int64]) -> None:
    """Widen a box (2, 3) so that it holds the first cells of (4, CHUNK)."""
    for axis in range(3):
        low, high = box[0, axis], box[1, axis]
        for i in range(n):
            low, high = min(low, cells[axis, i]), max(high, cells[axis, i])
        box[0, axis], box[1, axis] = low, high


@kernel
def pack(
    cells: NDArray[np.int64],  # (4, CHUNK)
    n: int,  # of them
    own: tuple[int, int, int],  # cell of the origin
    group: int,  # its index
    packed: NDArray[np.int64],  # (CHUNK,) out
) -> None:
    """Make one number of each end; that of none for a beam that tells nothing."""
    x, y, z = own[0] - HALF_SPAN, own[1] - HALF_SPAN, own[2] - HALF_SPAN
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
    ends: NDArray[np.int64],  # (stripes * k,) out, of one stripe or of two
    listed: NDArray[np.int64],  # (stripes,) in, out: where the next of each goes
    counts: NDArray[np.int64],  # (4,) in, out: beams by fate
) -> None:
    """List the beams that tell anything, successive ones to one cell once."""
    # Unsigned: of a signed index it is looked up each time whether it counts from the end.
    last, mask = int(NO_END), np.uint64(listed.shape[0] - 1)
    even, odd = np.uint64(listed[0]), np.uint64(listed[mask])
    for i in range(np.uint64(n)):
        # Without a branch: which beams end in a cell of their own cannot be foreseen.
        end, stripe = packed[i], np.uint64(cells[0, i] >> STRIPE_BITS) & mask
        ends[odd if stripe != 0 else even] = end
        told = np.uint64((end != last) & (end != NO_END))
        even, odd = even + (told & ~stripe), odd + (told & stripe)
        last = end
    listed[mask], listed[0] = odd, even
    returned = cleared = dropped = 0
    for i in range(n):
        returned += cells[3, i] == RETURNED
        cleared += cells[3, i] == CLEARED
        dropped += cells[3, i] == DROPPED
    counts[RETURNED] += returned
    counts[CLEARED] += cleared
    counts[DROPPED] += dropped
    counts[TOO_NEAR] += n - returned - cleared - dropped


@kernel
def place_ends(
    origins: NDArray[np.float64],  # (m, 3) m
    sensors: NDArray[np.int64],  # (m, 3) sub-cells that they lie in
    groups: NDArray[np.int64],  # (m + 1,) first beam of each origin, and the end
    directions: NDArray[np.float64],  # (3 n,) unit vectors
    ranges_mm: NDArray[np.uint16],  # (n,)
    limits_mm: tuple[int, int],  # nearest and farthest return
    resolution: float,
    beams: tuple[int, int],  # first and one past the last to look at
    ends: NDArray[np.int64],  # (stripes * k,) out: of k beams or fewer
    listed: NDArray[np.int64],  # (stripes,) out: one past the last end of each, k apart
    box: NDArray[np.int64],  # (2, 3) out: least and greatest cell of origins and ends
    counts: NDArray[np.int64],  # (4,) in, out: beams by fate
    cells: NDArray[np.int64],  # (4, CHUNK) scratch
    packed: NDArray[np.int64],  # (CHUNK,) scratch
) -> bool:
    """Find where beams end, and list those that tell anything: together, or by even and odd stripe.

    Returns:
        Whether all directions are of unit length.
    """
    scale = SUBCELLS / resolution
    for stripe in range(listed.shape[0]):
        listed[stripe] = stripe * (beams[1] - beams[0])
    for axis in range(3):
        box[0, axis] = box[1, axis] = sensors[0, axis] >> SUBCELL_BITS
        for k in range(1, sensors.shape[0]):
            cell = sensors[k, axis] >> SUBCELL_BITS
            box[0, axis], box[1, axis] = min(box[0, axis], cell), max(box[1, axis], cell)
    for k in range(origins.shape[0]):
        origin = (origins[k, 0], origins[k, 1], origins[k, 2])
        x, y, z = sensors[k, 0], sensors[k, 1], sensors[k, 2]
        own = (x >> SUBCELL_BITS, y >> SUBCELL_BITS, z >> SUBCELL_BITS)
        end = min(groups[k + 1], beams[1])
        for first in range(max(groups[k], beams[0]), end, CHUNK):
            last = min(first + CHUNK, end)
            some = directions[3 * first : 3 * last], ranges_mm[first:last]
            if not locate(origin, *some, limits_mm, scale, cells):
                return False
            widen(cells, last - first, box)
            pack(cells, last - first, own, k, packed)
            list_ends(cells, packed, last - first, ends, listed, counts)
    return True


@kernel
def rank_of(x: int, y: int, sensor: tuple[int, int], places: NDArray[np.int64]) -> int:
    """Where a column stands in the order in which targets are carved: by its direction."""
    along = HALVES * x + SUBCELLS - sensor[0]
    across = HALVES * y + SUBCELLS - sensor[1]
    slope = across / (abs(along) + abs(across))  # both odd
    quarters = 1.0 + slope if along > 0 else 3.0 - slope  # 0 to 4
    sector = int(quarters * (SECTORS / 4.0)) % SECTORS
    return int(sector // WEDGE * WEDGE + places[sector % WEDGE])


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
    sensor: tuple[int, int],
    places: NDArray[np.int64],
    guarded_layer: int,  # -1: none
    shape: tuple[int, int, int],
    aims: NDArray[np.uint64],  # (nx * ny * words,) zero after
    flags: NDArray[np.uint8],  # (nx * ny,) zero after
    targets: NDArray[np.int32],  # (n, 5) out
    bits: NDArray[np.uint64],  # (n,) out
    ranks: NDArray[np.int32],  # (n,) out
    count: int,  # of the targets so far
) -> int:
    """List the words of columns that beams end in; return the number of targets with these."""
    _, ny, words = shape
    for j in range(columns.shape[0]):
        column = int(columns[j])
        x, y = column // ny, column % ny
        rank = rank_of(x, y, sensor, places)
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
                write_target(targets, count, x, y, group, 64 * word, sparing)
                bits[count], ranks[count] = ends, rank
                count += 1
    return count


@kernel
def list_targets(
    ends: NDArray[np.int64],
    parts: NDArray[np.int64],  # (p, 2) first and one past the last of those of one stripe
    sensors: NDArray[np.int64],  # (m, 3) 1/1024 of a cell, from the window's corner
    box: tuple[int, int, int, int, int, int],  # least and greatest cell that may be marked
    guarded_layer: int,  # from the window's bottom; -1: none
    shape: tuple[int, int, int],  # (nx, ny, words)
    places: NDArray[np.int64],  # (WEDGE,) of a wedge's sectors, in which to carve them
    hits: NDArray[np.uint64],  # (nx * ny * words,) out
    aims: NDArray[np.uint64],  # (nx * ny * words,) zero before and after
    flags: NDArray[np.uint8],  # (nx * ny,) zero before and after
    columns: NDArray[np.int32],  # (n,) scratch
    targets: NDArray[np.int32],  # (n, 5) out: x, y, sensor position, least cell of the word, flags
    bits: NDArray[np.uint64],  # (n,) out: the cells of the word that beams end in
    ranks: NDArray[np.int32],  # (n,) out: by direction
    groups: NDArray[np.int64],  # (m + 1,) out: first target of each sensor position, and the end
) -> None:
    """Mark the cells that are hit, and list the words of cells that beams end in.

    Ends outside the box are listed singly: there are no masks for them.
    """
    _, ny, words = shape
    x0, y0, z0, x1, y1, z1 = box
    count = listed = part = int(np.int64(0))
    at = parts[0, 0]
    for k in range(sensors.shape[0]):
        groups[k] = count
        sensor = (sensors[k, 0], sensors[k, 1])
        first_x, first_y = (sensor[0] >> HALVES_BITS) - HALF_SPAN, sensor[1] >> HALVES_BITS
        first_y, first_z = first_y - HALF_SPAN, (sensors[k, 2] >> HALVES_BITS) - HALF_SPAN
        guarded = guarded_layer if sensors[k, 2] >> HALVES_BITS > guarded_layer else -1
        listed = 0
        while part < parts.shape[0]:
            if at == parts[part, 1]:
                part += 1
                at = parts[min(part, parts.shape[0] - 1), 0]
                continue
            end = ends[at]
            if end >> ORIGIN_BIT != k:
                break
            x = (end >> (2 * CELL_BITS) & CELL_MASK) + first_x
            y, z = (end >> CELL_BITS & CELL_MASK) + first_y, (end & CELL_MASK) + first_z
            returned = end >> FATE_BIT & 1 == RETURNED
            at += 1
            grazing = returned and z == guarded
            if not (x0 <= x <= x1 and y0 <= y <= y1 and z0 <= z <= z1):
                write_target(targets, count, x, y, k, z, OUTSIDE | (SPARING if grazing else 0))
                bits[count], ranks[count] = ONE, rank_of(x, y, sensor, places)
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
        count = list_columns(
            columns[:listed],
            k,
            sensor,
            places,
            guarded,
            shape,
            aims,
            flags,
            targets,
            bits,
            ranks,
            count,
        )
    groups[sensors.shape[0]] = count


@kernel
def order_targets(
    ranks: NDArray[np.int32],  # (n,)
    firsts: NDArray[np.int64],  # (stripes,) first target of each
    groups: NDArray[np.int64],  # (stripes, m + 1) from there, as of `list_targets`
    starts: NDArray[np.int64],  # (SECTORS + 1,) scratch
    order: NDArray[np.int32],  # (n,) out
    wedges: NDArray[np.int64],  # (k, 3) out: first target, one past the last, sensor position
) -> int:
    """Order targets by the direction that they lie in: the next beam then meets what the last did.

    A counting sort, as it keeps the words of a column together.

    Returns:
        Number of wedges that hold any.
    """
    count = ordered = int(np.int64(0))
    for k in range(groups.shape[1] - 1):
        for sector in range(SECTORS + 1):
            starts[sector] = 0
        starts[0] = ordered
        for stripe in range(firsts.shape[0]):
            first = firsts[stripe]
            for i in range(first + groups[stripe, k], first + groups[stripe, k + 1]):
                starts[ranks[i] + 1] += 1
        for sector in range(SECTORS):
            starts[sector + 1] += starts[sector]
        ordered = starts[SECTORS]
        for wedge in range(WEDGES):
            first, end = starts[wedge * WEDGE], starts[(wedge + 1) * WEDGE]
            if end > first:
                wedges[count, 0], wedges[count, 1], wedges[count, 2] = first, end, k
                count += 1
        for stripe in range(firsts.shape[0]):
            first = firsts[stripe]
            for i in range(first + groups[stripe, k], first + groups[stripe, k + 1]):
                order[starts[ranks[i]]] = i
                starts[ranks[i]] += 1
    return count
