"""Beams of a tile as packets, and their intersection with triangles.

A tile has up to 64 beams, its lanes, in eight packets; the eight beams of a packet are handled as
one vector, with a triangle's constants loaded once for all of them. A beam that a packet carries in
vain costs a lane, never a wrong answer, so packets may be of any beams.

Whether a ray passes a triangle is decided by the side on which it passes each edge, in Plücker
coordinates (Jones, "Intersecting a ray and a triangle with Plücker coordinates", Ray Tracing News
13(1), 2000). The numbers of an edge are those of its neighbour's with the other sign, to the last
bit, so that no ray slips through between two triangles.

All numbers of a tile stand in one flat array: the compiler then knows which of them can be the
same memory, and makes vectors of loops that write. Unsigned indices keep negative ones out.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from wayproof.models._jit import kernel
from wayproof.models.arrays import Array, Vector3

WIDTH = 8
"""Rays of a packet: a row of a tile, and one 512-bit register of doubles."""

LANES = 64
"""Maximum number of beams that are handled together: those of a tile."""

U = np.uint64

MIN_SLOPE = 1e-15
"""MuJoCo's mjMINVAL: a triangle of less area than this, as a ray sees it, is not met, m^2."""

# First places of the rows of a tile.
(
    WX, WY, WZ,  # direction in the world
    PX, PY, PZ,  # origin in the world, m
    DX, DY, DZ,  # direction in a geom's frame
    OX, OY, OZ,  # origin there, m
    MX, MY, MZ,  # moment there, origin x direction
    ALONG, ACROSS, ABOVE,  # components along the axes of the tile's fan
    BEST,  # nearest hit so far, m
    ROW,  # row of the triangle of a geom that it is on; see `start_geom`
) = (U(LANES * row) for row in range(20))  # fmt: skip
TILE_NUMBERS = 20 * LANES

NO_ROW = 1e18
"""Sentinel for no triangle: above any row."""


@kernel
def cross(a: Vector3, b: Vector3) -> Vector3:
    """Return a x b; b x a is the same to the last bit but for the sign."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@kernel
def edge_of(a: Vector3, b: Vector3) -> tuple[float, ...]:
    """Return Plücker coordinates (6,) of the line from a to b: midpoint x edge, edge."""
    e = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    # From the middle: both triangles at an edge get the same numbers, but for the sign.
    middle = (a[0] + b[0]) * 0.5, (a[1] + b[1]) * 0.5, (a[2] + b[2]) * 0.5
    moment = cross(middle, e)
    return moment[0], moment[1], moment[2], e[0], e[1], e[2]


@kernel
def numbers_of(a: Vector3, b: Vector3, c: Vector3) -> tuple[float, ...]:
    """Return the numbers (22,) of a triangle: three edges, normal, its product with a vertex.

    The normal has twice the area as its length. They are worked out anew each time: to load them
    would take longer, as a terrain's do not fit into the caches.
    """
    n = cross((a[0] - c[0], a[1] - c[1], a[2] - c[2]), (b[0] - c[0], b[1] - c[1], b[2] - c[2]))
    offset = n[0] * c[0] + n[1] * c[1] + n[2] * c[2]
    return edge_of(a, b) + edge_of(b, c) + edge_of(c, a) + (n[0], n[1], n[2], offset)


@kernel
def triangle_of(vertices: Array, corners: NDArray[np.int32], row: int) -> tuple[float, ...]:
    """Return the numbers (22,) of the triangle in a row."""
    i, j, k = corners[row, 0], corners[row, 1], corners[row, 2]
    a = vertices[i, 0], vertices[i, 1], vertices[i, 2]
    b = vertices[j, 0], vertices[j, 1], vertices[j, 2]
    c = vertices[k, 0], vertices[k, 1], vertices[k, 2]
    return numbers_of(a, b, c)


@kernel
def keep_nearest(rays: Array, first: np.uint64, triangle: tuple[float, ...], row: int) -> int:
    """Keep nearer hits of the packet from lane `first` on, from either side; return their number.

    Of equal distances the lower row wins.
    """
    (ax, ay, az, au, av, aw, bx, by, bz, bu, bv, bw, cx, cy, cz, cu, cv, cw,
     nx, ny, nz, offset) = triangle  # fmt: skip
    own, count = np.float64(row), 0
    for lane in range(WIDTH):
        i = first + U(lane)
        dx, dy, dz = rays[DX + i], rays[DY + i], rays[DZ + i]
        mx, my, mz = rays[MX + i], rays[MY + i], rays[MZ + i]
        a = (dx * ax + dy * ay + dz * az) + (mx * au + my * av + mz * aw)
        b = (dx * bx + dy * by + dz * bz) + (mx * bu + my * bv + mz * bw)
        c = (dx * cx + dy * cy + dz * cz) + (mx * cu + my * cv + mz * cw)
        inside = ((a >= 0.0) & (b >= 0.0) & (c >= 0.0)) | ((a <= 0.0) & (b <= 0.0) & (c <= 0.0))
        slope = dx * nx + dy * ny + dz * nz
        x = (offset - (rays[OX + i] * nx + rays[OY + i] * ny + rays[OZ + i] * nz)) / slope
        x = x if inside & (abs(slope) >= MIN_SLOPE) & (x >= 0.0) else math.inf
        best, best_row = rays[BEST + i], rays[ROW + i]
        nearer = (x < best) | ((x == best) & (own < best_row))
        rays[BEST + i] = x if nearer else best
        rays[ROW + i] = own if nearer else best_row
        count += nearer
    return count


@kernel
def farthest_hit(rays: Array, bits: NDArray[np.int64], first: np.uint64) -> np.float32:
    """Return the farthest hit so far of the packet from lane `first` on, m, rounded up.

    It is found on the bits, which for numbers >= 0 are in the order of the numbers.
    """
    top = 0
    for lane in range(WIDTH):
        top = max(top, bits[BEST + first + U(lane)])
    bits[ALONG] = top
    return np.float32(rays[ALONG] * (1.0 + 2e-7))


@kernel
def localize(rays: Array, poses: Array, g: int) -> None:
    """Turn a tile from the world to a geom's frame."""
    px, py, pz = poses[g, 0], poses[g, 1], poses[g, 2]
    m0, m1, m2 = poses[g, 3], poses[g, 4], poses[g, 5]
    m3, m4, m5 = poses[g, 6], poses[g, 7], poses[g, 8]
    m6, m7, m8 = poses[g, 9], poses[g, 10], poses[g, 11]
    for lane in range(LANES):
        i = U(lane)
        x, y, z = rays[WX + i], rays[WY + i], rays[WZ + i]
        dx = m0 * x + m3 * y + m6 * z
        dy = m1 * x + m4 * y + m7 * z
        dz = m2 * x + m5 * y + m8 * z
        x, y, z = rays[PX + i] - px, rays[PY + i] - py, rays[PZ + i] - pz
        ox = m0 * x + m3 * y + m6 * z
        oy = m1 * x + m4 * y + m7 * z
        oz = m2 * x + m5 * y + m8 * z
        rays[DX + i], rays[DY + i], rays[DZ + i] = dx, dy, dz
        rays[OX + i], rays[OY + i], rays[OZ + i] = ox, oy, oz
        rays[MX + i], rays[MY + i], rays[MZ + i] = (
            oy * dz - oz * dy,
            oz * dx - ox * dz,
            ox * dy - oy * dx,
        )
