"""Columns of cells that a beam crosses: exact voxel traversal in integers.

As Amanatides & Woo (1987), "A fast voxel traversal algorithm for ray tracing", from face to face
along x and y, but seen from the beam's end and without a step that waits for the one before. Points
of a beam are fractions of its way from its end to the sensor, in 2^-40; see `beams` for the
definition.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wayproof.kernel_compiler import inlined
from wayproof.maps.kernels.beam_targets import CellBox
from wayproof.maps.kernels.beams import HALVES, HALVES_BITS, MAX_BEAM_CELLS, SUBCELLS

FRACTION_BITS = 40  # a fraction times a height of 2^21 stays below 2^63
WHOLE = 1 << FRACTION_BITS
HALF_PITCH = 2.0 ** (FRACTION_BITS + HALVES_BITS - 1)  # of faces, on a beam of 1/1024 of a cell
MAX_STEPS = 2 * MAX_BEAM_CELLS + 18


@inlined
def faces_before(fraction: int, half: int) -> int:
    """Count the faces along an axis that a beam meets before a point; `half` to the first one."""
    return ((fraction - 1) // half + 1) >> 1 if fraction > 0 else 0


@inlined
def clip_axis(cell: int, steps: int, target: int, low: int, high: int) -> tuple[int, int]:
    """Find how many faces along an axis a beam crosses before it is within limits, and leaves them.

    Where it ends before it leaves, the latter is `steps`.
    """
    enter = low - cell if target > cell else cell - high
    leave = high - cell if target > cell else cell - low
    if target == cell and not low <= cell <= high:
        return 1, 0
    return max(enter, 0), min(leave, steps)


@inlined
def fraction_to_layers(end: int, sensor: int, low: int, high: int) -> int:
    """Return the least fraction of a beam within layers `low` to `high`; above WHOLE if never.

    Args:
        end: Layer that it ends in.
        sensor: Height of the sensor, 1/1024 of a cell.
        low: Least layer.
        high: Greatest layer.
    """
    if low <= end <= high:
        return 0
    middle = end * HALVES + SUBCELLS
    if end > high:
        if sensor >= (high + 1) * HALVES:
            return WHOLE + 1
        return ((middle - (high + 1) * HALVES) << FRACTION_BITS) // (middle - sensor) + 1
    if sensor < low * HALVES:
        return WHOLE + 1
    return -(((middle - low * HALVES) << FRACTION_BITS) // (sensor - middle))


@inlined
def clip(
    end: tuple[int, int, int],  # cell
    sensor: tuple[int, int, int],  # 1/1024 of a cell
    halves: tuple[int, int],  # fractions at the first face along x and y
    box: CellBox,  # cells that may be marked
    max_faces: tuple[int, int],  # along x and y that are crossed
) -> tuple[int, int, int]:
    """Find the columns of a beam that lie in a box, by the number of faces crossed before them.

    Returns:
        The first and the last; 0 and -1 if there are none. Then the fraction at the box's layers.
    """
    x, y, z = end
    half_x, half_y = halves
    # Faces along either axis up to the sensor, into the box and out of it.
    steps_x, steps_y = abs((sensor[0] >> HALVES_BITS) - x), abs((sensor[1] >> HALVES_BITS) - y)
    enter_x, leave_x = clip_axis(x, steps_x, sensor[0] >> HALVES_BITS, box[0], box[3])
    enter_y, leave_y = clip_axis(y, steps_y, sensor[1] >> HALVES_BITS, box[1], box[4])
    leave_x, leave_y = min(leave_x, max_faces[0]), min(leave_y, max_faces[1])
    to_layers = fraction_to_layers(z, sensor[2], box[2], box[5])
    if enter_x > leave_x or enter_y > leave_y or to_layers > WHOLE:
        return 0, -1, 0

    # Faces crossed on entry: the later of the entries along x and y decides the other's number.
    i, j = enter_x, enter_y
    at_x, at_y = (2 * i - 1) * half_x, (2 * j - 1) * half_y
    if at_x > at_y and i > 0:
        j = faces_before(at_x, half_y)
    elif j > 0:
        i = faces_before(at_y + 1, half_x)  # where both are equal, x goes first
    i, j = max(i, faces_before(to_layers, half_x)), max(j, faces_before(to_layers, half_y))

    # And on leaving: here the earlier one decides.
    last_i, last_j = leave_x, leave_y
    at_x, at_y = (2 * leave_x + 1) * half_x, (2 * leave_y + 1) * half_y
    if leave_x < steps_x and (at_x <= at_y or leave_y == steps_y):
        last_j = faces_before(at_x, half_y)
    elif leave_y < steps_y:
        last_i = faces_before(at_y + 1, half_x)
    if i > last_i or j > last_j:
        return 0, -1, 0
    return i + j, last_i + last_j, to_layers


@inlined
def traverse(
    first: int,  # faces crossed before the first column
    n: int,  # number of columns
    halves: tuple[int, int],  # fractions at the first face along x and y
    start: int,  # word of the end's column
    jumps: tuple[int, int],  # words from column to column along x and y
    columns: NDArray[np.int64],  # (n,) out: word of each column
    fractions: NDArray[np.int64],  # (n,) out: where the beam enters it; at most WHOLE
) -> None:
    """Find the columns that a beam crosses, from its end to the sensor.

    After s faces it has crossed the i along x with (2 i - 1) half_x <= (2 j + 1) half_y and
    (2 j - 1) half_y < (2 i + 1) half_x, where j = s - i. Solved for i that is
    floor(s half_y / (half_x + half_y) + 1/2): no column waits for the one before. Computed in
    floating point, a little low, that is i or one less; which of them, integers decide.
    """
    half_x, half_y = halves
    pitch_x, pitch_y, turn = 2 * half_x, 2 * half_y, jumps[0] - jumps[1]
    slope, offset = pitch_y / (pitch_x + pitch_y), 0.5 - 1e-6
    for k in range(n):
        s = first + k
        i = int(s * slope + offset)  # or one less than it should be
        at_x, at_y = i * pitch_x + half_x, (s - i) * pitch_y - half_y
        one_less = at_x <= at_y
        column = start + s * jumps[1] + i * turn
        columns[k] = column + turn if one_less else column
        fraction = max(at_x, at_y - pitch_y) if one_less else max(at_x - pitch_x, at_y)
        fractions[k] = min(max(fraction, 0), WHOLE)
