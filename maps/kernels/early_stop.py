"""Early stop of carving: how far from the sensor everything is marked already.

Near the sensor all beams of a wedge cross the same cells. Once the first of them are carved, the
others need be followed only to where everything that they cross is marked. (Oleynikova et al. 2017,
"Voxblox", stop their fast integrator's rays for the same reason; here it changes no mark.)
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayproof.kernel_compiler import inlined, kernel
from wayproof.maps.kernels.beam_targets import Window
from wayproof.maps.kernels.beams import HALVES, HALVES_BITS, ONE, SUBCELLS, TWO
from wayproof.maps.kernels.column_masks import FULL

SLOPES = 64  # classes of beams of a wedge
STEEPEST = 1.5  # cells along z to one along the wedge's longer axis
ROUNDING = 0.01  # of a cell: far more than a beam in integers is off its straight line


class Wedge(NamedTuple):
    """Directions of some targets, seen from the sensor.

    Attributes:
        along_x: Whether the longer axis is x.
        forward: Whether the targets lie along that axis, not against it.
        min_slope: Least slope of the shorter axis over the longer one.
        max_slope: Greatest one.
    """

    along_x: bool
    forward: bool
    min_slope: float
    max_slope: float


@kernel
def wedge_of(
    words: NDArray[np.int32],  # (n, 5) of targets
    order: NDArray[np.int32],  # (k,) the targets of the wedge
    sensor: tuple[int, int, int],
) -> Wedge:
    """Find the directions in which the targets of a wedge lie."""
    x, y = int(words[order[0], 0]), int(words[order[0], 1])
    to_x, to_y = x * HALVES + SUBCELLS - sensor[0], y * HALVES + SUBCELLS - sensor[1]
    along_x = abs(to_x) > abs(to_y)
    forward = to_x > 0 if along_x else to_y > 0
    min_slope, max_slope = np.inf, -np.inf
    for i in range(order.shape[0]):
        x, y = int(words[order[i], 0]), int(words[order[i], 1])
        to_x, to_y = x * HALVES + SUBCELLS - sensor[0], y * HALVES + SUBCELLS - sensor[1]
        slope = to_y / abs(to_x) if along_x else to_x / abs(to_y)
        min_slope, max_slope = min(min_slope, slope), max(max_slope, slope)
    return Wedge(bool(along_x), bool(forward), min_slope, max_slope)


@inlined
def common_cells(
    free: NDArray[np.uint64],  # (nx * ny * words,)
    shape: tuple[int, int, int],
    along_x: bool,
    slab: int,  # its place along the wedge's longer axis
    first: int,  # and its columns along the shorter one
    last: int,
    bottom: int,  # least of the 64 layers looked at
) -> np.uint64:
    """Find the layers that are marked in all columns of a slab; none if one is outside."""
    nx, ny, words = shape
    length, width = (nx, ny) if along_x else (ny, nx)
    if not 0 <= slab < length or first < 0 or last >= width:
        return np.uint64(0)
    word, shift = bottom >> 6, np.uint64(bottom & 63)
    common = FULL
    for k in range(first, last + 1):
        column = slab * ny + k if along_x else k * ny + slab
        marked = free[column * words + word] >> shift
        if word + 1 < words:
            marked |= (free[column * words + word + 1] << ONE) << (np.uint64(63) - shift)
        common &= marked
    return common


@inlined
def advance_slopes(
    common: np.uint64,  # layers that are marked throughout a slab
    enter: float,  # cells from the sensor to where beams enter the slab, and leave it
    leave: float,
    height: float,  # of the sensor above the lowest of these layers, cells
    marked: NDArray[np.int64],  # (SLOPES,) in, out: slabs marked
    slab: int,
) -> bool:
    """Count a slab for slopes whose beams cross only marked cells; return whether for any."""
    missing, width, any_more = ~common, 2.0 * STEEPEST / SLOPES, 0
    for k in range(SLOPES):
        # The heights at which beams of this class of slopes may be within the slab.
        min_slope = k * width - STEEPEST
        max_slope = min_slope + width
        low = height + min(min_slope * enter, min_slope * leave) - ROUNDING
        high = height + max(max_slope * enter, max_slope * leave) + ROUNDING
        within = (low >= 0.0) & (high < 64.0)
        bottom, top = np.uint64(np.int64(low) & 63), np.uint64(np.int64(high) & 63)
        crossed = (TWO << top) - (ONE << bottom)
        more = within & (marked[k] == slab) & (crossed & missing == 0)
        marked[k] += more
        any_more |= more
    return any_more != 0


@kernel
def survey(
    wedge: Wedge,
    sensor: tuple[int, int, int],  # 1/1024 of a cell
    window: Window,
    free: NDArray[np.uint64],
    marked: NDArray[np.int64],  # (SLOPES,) out
) -> None:
    """Find how far from the sensor all that beams of a wedge cross is marked already.

    A slab is all columns at one place along the wedge's longer axis. For each class of slopes it
    is counted how many slabs, from the sensor's own on, are marked wherever such a beam may go.
    """
    along_x, forward, min_slope, max_slope = wedge
    shape, box = window.shape, window.box
    # The sensor's place along both axes, and the part of its own cell that lies behind it.
    near, across = (sensor[0], sensor[1]) if along_x else (sensor[1], sensor[0])
    own, middle = near >> HALVES_BITS, across / HALVES
    part = (near - own * HALVES) / HALVES  # of the sensor's own cell
    behind = part if forward else 1.0 - part
    # 64 layers around the sensor's height.
    bottom = max(min((sensor[2] >> HALVES_BITS) - 32, box[5] - 63), box[2], 0)
    height = sensor[2] / HALVES - bottom
    for k in range(SLOPES):
        marked[k] = 0
    slab, any_marked = int(np.int64(0)), bottom < 64 * shape[2]
    while any_marked:
        # The columns of the slab that beams between the wedge's slopes may cross.
        enter, leave = max(slab - behind, 0.0), slab + 1.0 - behind
        first = int(np.floor(middle + min(min_slope * enter, min_slope * leave) - ROUNDING))
        last = int(np.floor(middle + max(max_slope * enter, max_slope * leave) + ROUNDING))
        place = own + slab if forward else own - slab
        common = common_cells(free, shape, along_x, place, first, last, bottom)
        any_marked = common != 0 and advance_slopes(common, enter, leave, height, marked, slab)
        slab += 1


@inlined
def marked_slabs(
    low: int,  # lowest and highest of a column's ends
    high: int,
    sensor: int,  # its height, 1/1024 of a cell
    distance: int,  # along the wedge's longer axis, 1/1024 of a cell
    marked: NDArray[np.int64],  # (SLOPES,)
) -> int:
    """Return the number of slabs from the sensor on that are marked for all beams to a column."""
    scale = SLOPES / (2.0 * STEEPEST)
    first = ((low * HALVES + SUBCELLS - sensor) / distance + STEEPEST) * scale
    last = ((high * HALVES + SUBCELLS - sensor) / distance + STEEPEST) * scale
    if not (0.0 <= first and last < SLOPES):
        return 0
    slabs = int(marked[int(first)])
    for k in range(int(first) + 1, int(last) + 1):
        slabs = min(slabs, int(marked[k]))
    return slabs
