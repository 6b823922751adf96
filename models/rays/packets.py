"""Packets of rays, and their intersection with boxes and triangles.

A packet is eight rays that are handled as one vector: eight neighbours of a sweep mostly visit the
same nodes, and a triangle's constants are loaded once for all of them. A ray that a packet carries
in vain costs a lane, never a wrong answer, so packets may be of any rays.

Whether a ray passes a triangle is decided by the side on which it passes each edge, in Plücker
coordinates (Jones, "Intersecting a ray and a triangle with Plücker coordinates", Ray Tracing News
13(1), 2000). The numbers of an edge are those of its neighbour's with the other sign, to the last
bit, so that no ray slips through between two triangles.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from wayproof.models._jit import kernel
from wayproof.models.arrays import Array

WIDTH = 8
"""Rays of a packet: a row of a tile, and one 512-bit register of doubles."""

MIN_SLOPE = 1e-15
"""MuJoCo's mjMINVAL: a triangle of less area than this, as a ray sees it, is not met, m^2."""

MIN_INVERTED = 1e-30
"""Minimum component of a direction that is inverted: over any range it moves a ray by less than
the margin of the boxes."""

# Rows of a packet.
DX, DY, DZ = 0, 1, 2  # direction
OX, OY, OZ = 3, 4, 5  # origin, m
MX, MY, MZ = 6, 7, 8  # moment, origin x direction
IX, IY, IZ = 9, 10, 11  # inverse of the direction
PACKET_ROWS = 12

# Columns of a triangle: three edges of six, then its plane.
EDGE = 6  # midpoint x edge, edge
NORMAL, OFFSET = 18, 21  # normal with twice the area as its length; its product with a vertex
TRIANGLE_COLUMNS = 22


@kernel
def complete(packets: Array, p: int) -> None:
    """Fill in the rows of a packet that follow from its directions and origins."""
    for i in range(WIDTH):
        dx, dy, dz = packets[p, DX, i], packets[p, DY, i], packets[p, DZ, i]
        ox, oy, oz = packets[p, OX, i], packets[p, OY, i], packets[p, OZ, i]
        packets[p, MX, i] = oy * dz - oz * dy
        packets[p, MY, i] = oz * dx - ox * dz
        packets[p, MZ, i] = ox * dy - oy * dx
        # A finite inverse keeps 0 * infinity out.
        packets[p, IX, i] = 1.0 / (dx if abs(dx) > MIN_INVERTED else MIN_INVERTED)
        packets[p, IY, i] = 1.0 / (dy if abs(dy) > MIN_INVERTED else MIN_INVERTED)
        packets[p, IZ, i] = 1.0 / (dz if abs(dz) > MIN_INVERTED else MIN_INVERTED)


@kernel
def count_in_box(packets: Array, p: int, boxes: Array, node: int, best: Array) -> int:
    """Count the rays of a packet that enter a box before their best hit."""
    x0, y0, z0 = boxes[node, 0], boxes[node, 1], boxes[node, 2]
    x1, y1, z1 = boxes[node, 3], boxes[node, 4], boxes[node, 5]
    count = 0
    for i in range(WIDTH):
        low = (x0 - packets[p, OX, i]) * packets[p, IX, i]
        high = (x1 - packets[p, OX, i]) * packets[p, IX, i]
        near = low if low < high else high
        far = high if low < high else low
        low = (y0 - packets[p, OY, i]) * packets[p, IY, i]
        high = (y1 - packets[p, OY, i]) * packets[p, IY, i]
        enter = low if low < high else high
        leave = high if low < high else low
        near = near if near > enter else enter
        far = far if far < leave else leave
        low = (z0 - packets[p, OZ, i]) * packets[p, IZ, i]
        high = (z1 - packets[p, OZ, i]) * packets[p, IZ, i]
        enter = low if low < high else high
        leave = high if low < high else low
        near = near if near > enter else enter
        far = far if far < leave else leave
        count += (near <= far) & (far >= 0.0) & (near <= best[p, i])
    return count


@kernel
def load(triangles: Array, row: int) -> tuple[float, ...]:
    """Return one row as scalars: loaded before a loop over rays, they let it become vectors."""
    t, k = triangles, row
    return (
        t[k, 0], t[k, 1], t[k, 2], t[k, 3], t[k, 4], t[k, 5],
        t[k, 6], t[k, 7], t[k, 8], t[k, 9], t[k, 10], t[k, 11],
        t[k, 12], t[k, 13], t[k, 14], t[k, 15], t[k, 16], t[k, 17],
        t[k, 18], t[k, 19], t[k, 20], t[k, 21],
    )  # fmt: skip


@kernel
def reach_triangle(packets: Array, p: int, i: int, triangle: tuple[float, ...]) -> float:
    """Return the distance of one ray to a triangle from either side, infinite for a miss."""
    ax, ay, az, au, av, aw, bx, by, bz, bu, bv, bw, cx, cy, cz, cu, cv, cw = triangle[:NORMAL]
    nx, ny, nz, offset = triangle[NORMAL:]
    dx, dy, dz = packets[p, DX, i], packets[p, DY, i], packets[p, DZ, i]
    mx, my, mz = packets[p, MX, i], packets[p, MY, i], packets[p, MZ, i]
    a = (dx * ax + dy * ay + dz * az) + (mx * au + my * av + mz * aw)
    b = (dx * bx + dy * by + dz * bz) + (mx * bu + my * bv + mz * bw)
    c = (dx * cx + dy * cy + dz * cz) + (mx * cu + my * cv + mz * cw)
    inside = ((a >= 0.0) & (b >= 0.0) & (c >= 0.0)) | ((a <= 0.0) & (b <= 0.0) & (c <= 0.0))
    slope = dx * nx + dy * ny + dz * nz
    x = (
        offset - (packets[p, OX, i] * nx + packets[p, OY, i] * ny + packets[p, OZ, i] * nz)
    ) / slope
    return x if inside & (abs(slope) >= MIN_SLOPE) & (x >= 0.0) else math.inf


@kernel
def count_on_triangle(packets: Array, p: int, triangles: Array, row: int, best: Array) -> int:
    """Count the rays of a packet that meet a triangle no farther than their best hit."""
    triangle = load(triangles, row)
    count = 0
    for i in range(WIDTH):
        count += reach_triangle(packets, p, i, triangle) <= best[p, i]
    return count


@kernel
def keep_nearest(
    packets: Array,
    p: int,
    triangles: Array,
    row: int,
    geom: int,
    best: Array,
    found: NDArray[np.int32],
) -> None:
    """Keep nearer hits; of equal ones the lower geom id's, then the lower row's."""
    triangle = load(triangles, row)
    for i in range(WIDTH):
        x = reach_triangle(packets, p, i, triangle)
        lower = (geom < found[p, 0, i]) | ((geom == found[p, 0, i]) & (row < found[p, 1, i]))
        if (x < best[p, i]) | ((x == best[p, i]) & lower):
            best[p, i] = x
            found[p, 0, i] = geom
            found[p, 1, i] = row


@kernel
def localize(packets: Array, p: int, poses: Array, g: int, local: Array) -> None:
    """Turn a packet from the world to a geom's frame."""
    px, py, pz = poses[g, 0], poses[g, 1], poses[g, 2]
    m0, m1, m2 = poses[g, 3], poses[g, 4], poses[g, 5]
    m3, m4, m5 = poses[g, 6], poses[g, 7], poses[g, 8]
    m6, m7, m8 = poses[g, 9], poses[g, 10], poses[g, 11]
    for i in range(WIDTH):
        x, y, z = packets[p, DX, i], packets[p, DY, i], packets[p, DZ, i]
        local[p, DX, i] = m0 * x + m3 * y + m6 * z
        local[p, DY, i] = m1 * x + m4 * y + m7 * z
        local[p, DZ, i] = m2 * x + m5 * y + m8 * z
        x, y, z = packets[p, OX, i] - px, packets[p, OY, i] - py, packets[p, OZ, i] - pz
        local[p, OX, i] = m0 * x + m3 * y + m6 * z
        local[p, OY, i] = m1 * x + m4 * y + m7 * z
        local[p, OZ, i] = m2 * x + m5 * y + m8 * z
    complete(local, p)
