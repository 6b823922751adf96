"""Targets of carving: the words of cells that beams end in, ordered by direction.

The cells of a sweep are marked in a dense window around it: a word of 64 bits is 64 cells of a
column along z. A target is such a word with the cells that beams end in, so that beams to one
column are followed together.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayproof.kernel_compiler import kernel
from wayproof.maps.kernels.beams import (
    CELL_BITS,
    CELL_MASK,
    FATE_BIT,
    HALF_SPAN,
    HALVES,
    HALVES_BITS,
    ONE,
    ORIGIN_BIT,
    RETURNED,
    SUBCELLS,
)

# Flags of a column.
LISTED = np.uint8(1)
GRAZED = np.uint8(2)  # a beam ends in its guarded layer

# Flags of a target.
SPARING = 1  # beams to its guarded layer spare that layer
OUTSIDE = 2  # the only cell of its word, which lies outside the box

SECTORS = 4096
WEDGE = 64  # sectors; their borders lie on the diagonals
WEDGES = SECTORS // WEDGE

NO_LAYER = -1
OWN_LAYER = -(1 << 40)  # in place of a guarded layer: of each beam that which it ends in

CellBox = tuple[int, int, int, int, int, int]
"""Least x, y, z of some cells, then greatest x, y, z."""


class Window(NamedTuple):
    """Dense window of columns in which a sweep is marked.

    Attributes:
        shape: (nx, ny, words).
        box: Least and greatest cell that may be marked.
        guarded_layer: Layer that beams from above that end in it do not clear; NO_LAYER for none,
            OWN_LAYER for that which each beam ends in.
    """

    shape: tuple[int, int, int]
    box: CellBox
    guarded_layer: int


class EndMasks(NamedTuple):
    """Marks of the cells that beams end in.

    Attributes:
        hits: (nx * ny * words,) bits of the cells that something was met in; added to.
        aims: (nx * ny * words,) bits of the cells that beams end in; zero before and after.
        grazes: (nx * ny * words,) bits of those that end beams which each spare their own layer;
            zero before and after; (0,) unless the guarded layer is OWN_LAYER.
        flags: (nx * ny,) of each column; zero before and after.
        columns: (n,) scratch: the columns whose flags are set.
    """

    hits: NDArray[np.uint64]
    aims: NDArray[np.uint64]
    grazes: NDArray[np.uint64]
    flags: NDArray[np.uint8]
    columns: NDArray[np.int32]


class Targets(NamedTuple):
    """Words of cells that beams end in.

    Attributes:
        words: (n, 5) x, y, index of the sensor position, least cell of the word, flags.
        bits: (n,) the cells of the word that beams end in.
        ranks: (n,) place in the order of directions.
    """

    words: NDArray[np.int32]
    bits: NDArray[np.uint64]
    ranks: NDArray[np.int32]


class Sensor(NamedTuple):
    """One sensor position.

    Attributes:
        number: Number among the positions of the sweep.
        x: Coordinate x from the window's corner, 1/1024 of a cell.
        y: Coordinate y from the window's corner, 1/1024 of a cell.
        guarded_layer: Guarded layer of the window; NO_LAYER where the sensor is not above it.
    """

    number: int
    x: int
    y: int
    guarded_layer: int


@kernel
def direction_rank(x: int, y: int, sensor: Sensor, sector_order: NDArray[np.int64]) -> int:
    """Place of a column in the order in which targets are carved: by its direction.

    Wedges follow one another around the sensor; the sectors of each come as `sector_order` says.
    """
    along = HALVES * x + SUBCELLS - sensor.x
    across = HALVES * y + SUBCELLS - sensor.y
    slope = across / (abs(along) + abs(across))  # both odd
    quarters = 1.0 + slope if along > 0 else 3.0 - slope  # 0 to 4
    sector = int(quarters * (SECTORS / 4.0)) % SECTORS
    return int(sector // WEDGE * WEDGE + sector_order[sector % WEDGE])


@kernel
def write_word(
    words: NDArray[np.int32],  # (n, 5) out
    k: int,
    x: int,
    y: int,
    sensor: int,
    bottom: int,
    flags: int,
) -> None:
    """Write the word of target `k`."""
    words[k, 0], words[k, 1], words[k, 2] = x, y, sensor
    words[k, 3], words[k, 4] = bottom, flags


@kernel
def list_columns(
    listed: int,
    sensor: Sensor,
    shape: tuple[int, int, int],
    sector_order: NDArray[np.int64],  # (WEDGE,)
    masks: EndMasks,  # in, out: the first of `columns`, and their marks, which are cleared
    targets: Targets,  # out
    count: int,  # of the targets so far
) -> int:
    """List the words of columns that beams end in; return the number of targets with these."""
    _, aims, grazes, flags, columns = masks
    out_words, bits, ranks = targets
    _, ny, words = shape
    for j in range(listed):
        column = int(columns[j])
        x, y = column // ny, column % ny
        rank = direction_rank(x, y, sensor, sector_order)
        grazed = flags[column] & GRAZED != 0
        flags[column] = 0
        for word in range(words):
            ends, sparing = aims[column * words + word], 0
            aims[column * words + word] = 0
            if grazed and sensor.guarded_layer == OWN_LAYER:
                spared = grazes[column * words + word]
                grazes[column * words + word] = 0
                if spared != 0:
                    write_word(out_words, count, x, y, sensor.number, 64 * word, SPARING)
                    bits[count], ranks[count] = spared, rank
                    count += 1
            elif grazed and sensor.guarded_layer >> 6 == word:
                guarded = ONE << np.uint64(sensor.guarded_layer & 63)
                # Else a beam that is not spared ends there as well.
                sparing = SPARING if ends & guarded == 0 else 0
                ends |= guarded
            if ends != 0:
                write_word(out_words, count, x, y, sensor.number, 64 * word, sparing)
                bits[count], ranks[count] = ends, rank
                count += 1
    return count


@kernel
def list_targets(
    ends: NDArray[np.int64],  # (k,) packed, see `beams`
    sensors: NDArray[np.int64],  # (m, 3) 1/1024 of a cell, from the window's corner
    window: Window,
    sector_order: NDArray[np.int64],  # (WEDGE,) place of each sector of a wedge
    masks: EndMasks,  # in, out
    targets: Targets,  # out
    groups: NDArray[np.int64],  # (m + 1,) out: first target of each sensor position, and the end
) -> None:
    """Mark the cells that are hit, and list the words of cells that beams end in.

    Ends outside the box are listed singly: there are no masks for them.
    """
    hits, aims, grazes, flags, columns = masks
    out_words, bits, ranks = targets
    _, ny, words = window.shape
    x0, y0, z0, x1, y1, z1 = window.box
    count = listed = at = int(np.int64(0))
    for k in range(sensors.shape[0]):
        groups[k] = count
        # Packed cells are counted from the sensor's own; a beam from above spares the layer.
        first_x = (sensors[k, 0] >> HALVES_BITS) - HALF_SPAN
        first_y = (sensors[k, 1] >> HALVES_BITS) - HALF_SPAN
        layer = sensors[k, 2] >> HALVES_BITS
        first_z = layer - HALF_SPAN
        guarded = window.guarded_layer if layer > window.guarded_layer else NO_LAYER
        sensor = Sensor(k, sensors[k, 0], sensors[k, 1], guarded)
        # Mark this sensor's ends; they lie one after the other.
        listed = 0
        while at < ends.shape[0]:
            end = ends[at]
            if end >> ORIGIN_BIT != k:
                break
            x = (end >> (2 * CELL_BITS) & CELL_MASK) + first_x
            y, z = (end >> CELL_BITS & CELL_MASK) + first_y, (end & CELL_MASK) + first_z
            returned = end >> FATE_BIT & 1 == RETURNED
            at += 1
            grazing = returned and (z < layer if guarded == OWN_LAYER else z == guarded)
            if not (x0 <= x <= x1 and y0 <= y <= y1 and z0 <= z <= z1):
                write_word(out_words, count, x, y, k, z, OUTSIDE | (SPARING if grazing else 0))
                bits[count], ranks[count] = ONE, direction_rank(x, y, sensor, sector_order)
                count += 1
                continue
            column = x * ny + y
            word, bit = column * words + (z >> 6), ONE << np.uint64(z & 63)
            if returned:
                hits[word] |= bit
            if not grazing:
                aims[word] |= bit
            elif guarded == OWN_LAYER:
                grazes[word] |= bit
            if flags[column] == 0:
                columns[listed] = column
                listed += 1
            flags[column] |= LISTED | GRAZED if grazing else LISTED
        # List the columns that were marked, and clear their marks.
        count = list_columns(listed, sensor, window.shape, sector_order, masks, targets, count)
    groups[sensors.shape[0]] = count


@kernel
def order_targets(
    ranks: NDArray[np.int32],  # (n,)
    groups: NDArray[np.int64],  # (m + 1,) as of `list_targets`
    starts: NDArray[np.int64],  # (SECTORS + 1,) scratch
    order: NDArray[np.int32],  # (n,) out
    wedges: NDArray[np.int64],  # (k, 3) out: first, one past the last, sensor position
) -> int:
    """Order targets by direction, so that the next beam meets the memory that the last one did.

    A counting sort, as it keeps the words of a column together.

    Returns:
        Number of wedges that hold any.
    """
    count = ordered = int(np.int64(0))
    for k in range(groups.shape[0] - 1):
        # Count the targets of each sector, and sum up to where each sector begins.
        for sector in range(SECTORS + 1):
            starts[sector] = 0
        starts[0] = ordered
        for i in range(groups[k], groups[k + 1]):
            starts[ranks[i] + 1] += 1
        for sector in range(SECTORS):
            starts[sector + 1] += starts[sector]
        ordered = starts[SECTORS]
        # List the wedges that hold any, then deal the targets out to their sectors.
        for wedge in range(WEDGES):
            first, end = starts[wedge * WEDGE], starts[(wedge + 1) * WEDGE]
            if end > first:
                wedges[count, 0], wedges[count, 1], wedges[count, 2] = first, end, k
                count += 1
        for i in range(groups[k], groups[k + 1]):
            order[starts[ranks[i]]] = i
            starts[ranks[i]] += 1
    return count
