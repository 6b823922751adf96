"""Fans of beams, and which of eight boxes they may meet.

The beams of a tile, and those of each of its packets, lie between four planes through their
origin; a row of a tile is so thin a fan that few boxes are met in vain. A box is ruled out if it is
outside of a plane, behind the farthest hit, or outside of the box about all beams of the tile.
Boxes and planes are single precision, with a margin above all rounding: what is ruled out is not
met, and the rest is decided on triangles.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from wayproof.models._jit import kernel
from wayproof.models.arrays import Array, Vector3
from wayproof.models.rays.packets import (
    ABOVE,
    ACROSS,
    ALONG,
    BEST,
    LANES,
    WIDTH,
    WX,
    WY,
    WZ,
    U,
)
from wayproof.models.rays.wide_tree import CHILDREN, COLUMNS, HEIGHTS

TILE = LANES // WIDTH
"""Row of the fan of a whole tile, behind those of its packets."""

PLANES = 5
"""Planes of a fan: two across it, two along it, and the one that distances are measured from."""

BOUNDS = 4 * PLANES
"""First column of the box about a fan: each plane has a normal and an offset."""

FAN_COLUMNS = BOUNDS + 6

MIN_ALONG = 0.8
"""Minimum component of a beam along the axis of its fan; wider tiles are cut into packets, these
into beams."""

SHIFT = 32.0
"""Offset of the slopes of beams that makes them positive, and their bits ordered."""

SLOPE_MARGIN = 1e-12
"""Excess of the slopes of a fan's planes over those of its beams."""

ROUNDING = 2.0**-20
"""Margin of planes and boxes as a share of the largest coordinate: 16 units of rounding. Sums of
three products of rounded factors, corners of cells and a rounded offset take at most nine."""

NOTHING = np.iinfo(np.int64).max


@kernel
def choose_frame(n: int, rays: Array, frame: Array) -> None:
    """Choose the axes of a tile's fan.

    Args:
        n: Number of beams.
        rays: Lanes of the tile, of which directions are read.
        frame: (3, 3) is written: unit vectors in the world along the beams, along the first row,
            and across both.
    """
    last, end = U(min(WIDTH, n) - 1), U(n - 1)
    ax, ay, az = rays[WX] + rays[WX + end], rays[WY] + rays[WY + end], rays[WZ] + rays[WZ + end]
    length = math.sqrt(ax * ax + ay * ay + az * az)
    scale = 1.0 / (length if length > 1e-3 else 1.0)
    ax, ay, az = ax * scale, ay * scale, az * scale
    ex, ey, ez = rays[WX + last] - rays[WX], rays[WY + last] - rays[WY], rays[WZ + last] - rays[WZ]
    along = ex * ax + ey * ay + ez * az
    ex, ey, ez = ex - along * ax, ey - along * ay, ez - along * az
    length = math.sqrt(ex * ex + ey * ey + ez * ez)
    if length < 1e-9:  # one beam: any axis across it
        near_x = abs(ax) > 0.6
        ex, ey, ez = (-az if near_x else 0.0), (0.0 if near_x else -az), (ax if near_x else ay)
        length = max(math.sqrt(ex * ex + ey * ey + ez * ez), 1e-9)
    ex, ey, ez = ex / length, ey / length, ez / length
    frame[0, 0], frame[0, 1], frame[0, 2] = ax, ay, az
    frame[1, 0], frame[1, 1], frame[1, 2] = ex, ey, ez
    frame[2, 0], frame[2, 1], frame[2, 2] = ay * ez - az * ey, az * ex - ax * ez, ax * ey - ay * ex


@kernel
def measure_slopes(rays: Array, bits: NDArray[np.int64], frame: Array, slopes: Array) -> bool:
    """Measure between which slopes against the fan's axis all beams of a tile lie.

    Minima are found on the bits, which for numbers >= 0 are in the order of the numbers: those of
    integers become vector instructions.

    Args:
        rays: Lanes of the tile; those of components along the axes are written.
        bits: The memory of `rays` as integers.
        frame: (3, 3) by `choose_frame`.
        slopes: (9, 4) of which the last row is written: minimum and maximum across, and above.

    Returns:
        Whether the beams are near enough to the axis.
    """
    ax, ay, az = frame[0, 0], frame[0, 1], frame[0, 2]
    ex, ey, ez = frame[1, 0], frame[1, 1], frame[1, 2]
    fx, fy, fz = frame[2, 0], frame[2, 1], frame[2, 2]
    for lane in range(LANES):
        i = U(lane)
        x, y, z = rays[WX + i], rays[WY + i], rays[WZ + i]
        along = ax * x + ay * y + az * z
        inverse = 1.0 / along
        rays[ALONG + i] = along
        rays[ACROSS + i] = (ex * x + ey * y + ez * z) * inverse + SHIFT
        rays[ABOVE + i] = (fx * x + fy * y + fz * z) * inverse + SHIFT
    least, low, high, bottom, top = NOTHING, NOTHING, 0, NOTHING, 0
    for lane in range(LANES):
        i = U(lane)
        least = min(least, bits[ALONG + i])
        low, high = min(low, bits[ACROSS + i]), max(high, bits[ACROSS + i])
        bottom, top = min(bottom, bits[ABOVE + i]), max(top, bits[ABOVE + i])
    write_slopes(low, high, bottom, top, U(0), rays, bits, slopes, TILE)
    bits[BEST] = least
    return bool(rays[BEST] > MIN_ALONG)


@kernel
def measure_packets(count: int, rays: Array, bits: NDArray[np.int64], slopes: Array) -> None:
    """Write the slopes of the first packets of a tile; see `measure_slopes`."""
    for p in range(count):
        first = U(WIDTH * p)
        low, high, bottom, top = NOTHING, 0, NOTHING, 0
        for lane in range(WIDTH):
            i = first + U(lane)
            low, high = min(low, bits[ACROSS + i]), max(high, bits[ACROSS + i])
            bottom, top = min(bottom, bits[ABOVE + i]), max(top, bits[ABOVE + i])
        write_slopes(low, high, bottom, top, first, rays, bits, slopes, p)


@kernel
def write_slopes(
    low: int, high: int, bottom: int, top: int, first: np.uint64,
    rays: Array, bits: NDArray[np.int64], slopes: Array, row: int,
) -> None:  # fmt: skip
    """Write the slopes whose bits are given; the lanes of best hits are scratch."""
    i = BEST + first
    bits[i], bits[i + U(1)], bits[i + U(2)], bits[i + U(3)] = low, high, bottom, top
    slopes[row, 0] = rays[i] - (SHIFT + SLOPE_MARGIN)
    slopes[row, 1] = rays[i + U(1)] - (SHIFT - SLOPE_MARGIN)
    slopes[row, 2] = rays[i + U(2)] - (SHIFT + SLOPE_MARGIN)
    slopes[row, 3] = rays[i + U(3)] - (SHIFT - SLOPE_MARGIN)


@kernel
def least_offset(n: Vector3, rays: Array, row: np.uint64, first: int, stop: int) -> float:
    """Return the least product of a vector with the origins, from `row` on, of some lanes."""
    least = math.inf
    for lane in range(first, stop):
        i = row + U(lane)
        product = n[0] * rays[i] + n[1] * rays[i + U(LANES)] + n[2] * rays[i + U(2 * LANES)]
        least = product if product < least else least
    return least


@kernel
def set_plane(
    fan: int, plane: int, n: Vector3, offset: float, margin: float,
    fans: NDArray[np.float32], sides: NDArray[np.uint64],
) -> None:  # fmt: skip
    """Write a plane: boxes may be met where n . x >= offset for their farthest corner x along n.

    Args:
        fan: Row of the fan.
        plane: Number of the plane.
        n: Normal.
        offset: Offset, m.
        margin: Margin for each unit of the normal, m.
        fans: (9, 26) is written.
        sides: (9, 15) is written: columns of that corner's x, y and z in `WideTree.boxes`.
    """
    column = 4 * plane
    reach = margin * (abs(n[0]) + abs(n[1]) + abs(n[2]) + 1.0)
    fans[fan, column], fans[fan, column + 1], fans[fan, column + 2] = n[0], n[1], n[2]
    fans[fan, column + 3] = offset - reach
    for axis in range(3):
        sides[fan, 3 * plane + axis] = COLUMNS[axis + 3 if n[axis] >= 0.0 else axis]


@kernel
def set_fan(
    fan: int, slopes: Array, frame: Array, rays: Array, row: np.uint64, first: int, stop: int,
    margin: float, fans: NDArray[np.float32], sides: NDArray[np.uint64],
) -> None:  # fmt: skip
    """Write the planes of a fan.

    Args:
        fan: Row of the fan.
        slopes: (9, 4) by `measure_slopes`.
        frame: (3, 3) axes of the fan, in the frame of the boxes.
        rays: Lanes of the tile.
        row: First place of the origins in that frame.
        first: First lane of the fan.
        stop: One past its last lane, or past the first one if all have one origin.
        margin: Margin, m.
        fans: (9, 26) is written, see `set_plane`; the plane ahead has its normal backwards, so
            that -offset is the least distance ahead.
        sides: (9, 15) is written.
    """
    a = frame[0, 0], frame[0, 1], frame[0, 2]
    for plane in range(4):
        axis, slope = 1 + plane // 2, slopes[fan, plane]
        sign = 1.0 if plane % 2 == 0 else -1.0
        n = (
            sign * (frame[axis, 0] - slope * a[0]),
            sign * (frame[axis, 1] - slope * a[1]),
            sign * (frame[axis, 2] - slope * a[2]),
        )
        offset = least_offset(n, rays, row, first, stop)
        set_plane(fan, plane, n, offset, margin, fans, sides)
    back = -a[0], -a[1], -a[2]
    offset = least_offset(back, rays, row, first, stop)
    set_plane(fan, 4, back, offset, margin, fans, sides)


@kernel
def bound_fan(
    slopes: Array, frame: Array, rays: Array, row: np.uint64, stop: int, limit: float,
    margin: float, fans: NDArray[np.float32],
) -> None:  # fmt: skip
    """Write the box about all beams of a tile up to the limit: of their origins and the corners.

    Arguments are those of `set_fan`; packets have the box of the whole tile.
    """
    for axis in range(3):
        low, high = 0.0, 0.0
        for corner in range(4):
            across, above = slopes[TILE, corner % 2], slopes[TILE, 2 + corner // 2]
            reach = frame[0, axis] + across * frame[1, axis] + above * frame[2, axis]
            low, high = min(low, reach * limit), max(high, reach * limit)
        least, most = math.inf, -math.inf
        for lane in range(stop):
            origin = rays[row + U(LANES * axis + lane)]
            least, most = min(least, origin), max(most, origin)
        for fan in range(TILE + 1):
            fans[fan, BOUNDS + axis] = least + low - margin
            fans[fan, BOUNDS + 3 + axis] = most + high + margin


@kernel
def boxes_met(
    boxes: NDArray[np.float32], node: int, heights: NDArray[np.float32], level: int, skipped: int,
    fans: NDArray[np.float32], sides: NDArray[np.uint64], f: int, farthest: np.float32,
) -> int:  # fmt: skip
    """Return a bit for each child of a node that fan f may meet no farther than `farthest`.

    Args:
        boxes: (k, 48) nodes, see `WideTree`.
        node: Row of the node.
        heights: Table of its children's lower and upper z: `boxes`, or `Fields.ranges`.
        level: Row there.
        skipped: Columns of a node that are missing there in front.
        fans: (9, 26) by `set_fan` and `bound_fan`.
        sides: (9, 15) by `set_fan`.
        f: Row of the fan.
        farthest: Farthest hit so far, m.
    """
    a0, a1, a2, a3 = fans[f, 0], fans[f, 1], fans[f, 2], fans[f, 3]
    b0, b1, b2, b3 = fans[f, 4], fans[f, 5], fans[f, 6], fans[f, 7]
    c0, c1, c2, c3 = fans[f, 8], fans[f, 9], fans[f, 10], fans[f, 11]
    d0, d1, d2, d3 = fans[f, 12], fans[f, 13], fans[f, 14], fans[f, 15]
    e0, e1, e2, e3 = fans[f, 16], fans[f, 17], fans[f, 18], fans[f, 19] - farthest
    x0, y0, z0 = fans[f, 20], fans[f, 21], fans[f, 22]
    x1, y1, z1 = fans[f, 23], fans[f, 24], fans[f, 25]
    ax, ay, bx, by, cx, cy = (
        sides[f, 0], sides[f, 1], sides[f, 3], sides[f, 4], sides[f, 6], sides[f, 7]
    )  # fmt: skip
    dx, dy, ex, ey = sides[f, 9], sides[f, 10], sides[f, 12], sides[f, 13]
    s = U(skipped)
    az, bz, cz, dz = sides[f, 2] - s, sides[f, 5] - s, sides[f, 8] - s, sides[f, 11] - s
    ez, low, high = sides[f, 14] - s, U(HEIGHTS) - s, U(HEIGHTS + CHILDREN) - s
    row, z, mask = U(node), U(level), 0
    for child in range(CHILDREN):
        k = U(child)
        a = a0 * boxes[row, ax + k] + a1 * boxes[row, ay + k] + a2 * heights[z, az + k]
        b = b0 * boxes[row, bx + k] + b1 * boxes[row, by + k] + b2 * heights[z, bz + k]
        c = c0 * boxes[row, cx + k] + c1 * boxes[row, cy + k] + c2 * heights[z, cz + k]
        d = d0 * boxes[row, dx + k] + d1 * boxes[row, dy + k] + d2 * heights[z, dz + k]
        e = e0 * boxes[row, ex + k] + e1 * boxes[row, ey + k] + e2 * heights[z, ez + k]
        met = (a >= a3) & (b >= b3) & (c >= c3) & (d >= d3) & (e >= e3)
        met &= (boxes[row, k] <= x1) & (boxes[row, U(8) + k] <= y1)
        met &= (boxes[row, U(16) + k] >= x0) & (boxes[row, U(24) + k] >= y0)
        met &= (heights[z, low + k] <= z1) & (heights[z, high + k] >= z0)
        mask += met << child
    return mask


@kernel
def distance_ahead(
    boxes: NDArray[np.float32], node: int, heights: NDArray[np.float32], level: int, skipped: int,
    child: int, fans: NDArray[np.float32], sides: NDArray[np.uint64], f: int,
) -> np.float32:  # fmt: skip
    """Return a lower bound of the distance along fan f to a child's box, m; see `boxes_met`."""
    row, z_row, k = U(node), U(level), U(child)
    x = fans[f, 16] * boxes[row, sides[f, 12] + k]
    y = fans[f, 17] * boxes[row, sides[f, 13] + k]
    z = fans[f, 18] * heights[z_row, sides[f, 14] - U(skipped) + k]
    ahead: np.float32 = fans[f, 19] - (x + y + z)
    return ahead
