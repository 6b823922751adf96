"""Rays against triangles: each walks down a tree of boxes, nearest first.

Boxes are single precision, and widened by a margin above all rounding: what is ruled out is not
met, and the rest is decided on triangles.

Whether a ray passes a triangle is decided by the side on which it passes each edge, in Plücker
coordinates (Jones, "Intersecting a ray and a triangle with Plücker coordinates", Ray Tracing News
13(1), 2000). The numbers of an edge are those of its neighbour's with the other sign, to the last
bit, so that no ray slips through between two triangles.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from wayproof.kernel_compiler import inlined
from wayproof.models.arrays import Array, Vector3
from wayproof.models.rays.records import Soup, Waiting
from wayproof.models.rays.tree import CHILDREN, LEAF_BITS

U = np.uint64
"""Unsigned indices keep negative ones out, and so a test for them."""

MIN_SLOPE = 1e-15
"""MuJoCo's mjMINVAL: a triangle of less area than this, as a ray sees it, is not met, m^2."""

MIN_COMPONENT = 1e-18
"""Least component of a direction in tests of boxes; its inverse is a finite single."""

ROUNDING = 2.0**-20
"""Margin of boxes as a share of the largest coordinate: 16 units of rounding. A corner, an origin
and an inverse, each rounded, and their difference and product take at most five."""

FARTHER = 1.0 + 2e-7
"""Factor that rounds a distance up as it becomes a single."""

LOWEST = np.array([0] + [(m & -m).bit_length() - 1 for m in range(1, 1 << CHILDREN)])
"""Lowest element of each set of children, by the bits of its number."""


Slab = tuple[np.uint64, np.uint64, np.float32, np.float32, np.float32]
"""How a ray enters and leaves boxes along one axis, by `slab_of`."""


@inlined
def cross(a: Vector3, b: Vector3) -> Vector3:
    """Return a x b; b x a is the same to the last bit but for the sign."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@inlined
def side_of(a: Vector3, b: Vector3, d: Vector3, moment: Vector3) -> float:
    """Return on which side a ray of direction d passes the line from a to b, by its sign."""
    e = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    # From the middle: both triangles at an edge get the same numbers, but for the sign.
    m = cross(((a[0] + b[0]) * 0.5, (a[1] + b[1]) * 0.5, (a[2] + b[2]) * 0.5), e)
    return (d[0] * m[0] + d[1] * m[1] + d[2] * m[2]) + (
        moment[0] * e[0] + moment[1] * e[1] + moment[2] * e[2]
    )


@inlined
def point_of(vertices: Array, row: int) -> Vector3:
    """Return a vertex, m."""
    i = U(row)
    return vertices[i, 0], vertices[i, 1], vertices[i, 2]


@inlined
def reach_triangle(
    vertices: Array, corners: NDArray[np.int32], row: int, o: Vector3, d: Vector3, m: Vector3
) -> float:
    """Return the distance to a triangle from either side, m; infinite for a miss.

    Args:
        vertices: (v, 3) m.
        corners: (t, 3) rows of vertices.
        row: Triangle.
        o: Origin of the ray, m.
        d: Direction.
        m: Moment, origin x direction.
    """
    i = U(row)
    a, b = point_of(vertices, corners[i, 0]), point_of(vertices, corners[i, 1])
    c = point_of(vertices, corners[i, 2])
    x, y, z = side_of(a, b, d, m), side_of(b, c, d, m), side_of(c, a, d, m)
    if ((x < 0.0) | (y < 0.0) | (z < 0.0)) & ((x > 0.0) | (y > 0.0) | (z > 0.0)):
        return math.inf
    n = cross((a[0] - c[0], a[1] - c[1], a[2] - c[2]), (b[0] - c[0], b[1] - c[1], b[2] - c[2]))
    offset = n[0] * c[0] + n[1] * c[1] + n[2] * c[2]
    slope = d[0] * n[0] + d[1] * n[1] + d[2] * n[2]
    x = (offset - (o[0] * n[0] + o[1] * n[1] + o[2] * n[2])) / slope
    return x if (abs(slope) >= MIN_SLOPE) & (x >= 0.0) else math.inf


@inlined
def slab_of(o: float, d: float, margin: float, axis: int) -> Slab:
    """Return how a ray enters and leaves boxes along one axis.

    Returns:
        Columns of the sides that it meets first and last, the origin as measured from each, m, and
        the inverse of the direction.
    """
    inverse = np.float32(1.0 / math.copysign(max(abs(d), MIN_COMPONENT), d))
    shift = math.copysign(margin, d)
    low, high = U(CHILDREN * axis), U(CHILDREN * (axis + 3))
    near, far = (low, high) if inverse > 0.0 else (high, low)
    return near, far, np.float32(o + shift), np.float32(o - shift), inverse


@inlined
def open_node(
    boxes: NDArray[np.float32], links: NDArray[np.int32], node: int, slabs: tuple[Slab, Slab, Slab],
    farthest: np.float32, bottom: int, waiting: Waiting,
) -> int:  # fmt: skip
    """Let the children of a node that a ray enters wait, nearest on top; return the top.

    Args:
        boxes: (k, 48) nodes.
        links: (k, 8) likewise.
        node: Row.
        slabs: By `slab_of`, for x, y and z.
        farthest: Farthest distance of use, m.
        bottom: Number of those that wait already.
        waiting: Children are added.
    """
    (ax, bx, nx, fx, ix), (ay, by, ny, fy, iy), (az, bz, nz, fz, iz) = slabs
    row, mask = U(node), 0
    # As many as a node has, given by the table: a loop of a known length would not become vectors.
    for child in range(links.shape[1]):
        k = U(child)
        x, u = (boxes[row, ax + k] - nx) * ix, (boxes[row, bx + k] - fx) * ix
        y, v = (boxes[row, ay + k] - ny) * iy, (boxes[row, by + k] - fy) * iy
        z, w = (boxes[row, az + k] - nz) * iz, (boxes[row, bz + k] - fz) * iz
        x = x if x > y else y
        x = x if x > z else z
        u = u if u < v else v
        u = u if u < w else w
        mask += ((x <= u) & (u >= np.float32(0.0)) & (x <= farthest)) << child
    top = bottom
    while mask > 0:
        k = U(LOWEST[mask])
        mask &= mask - 1
        x, y = (boxes[row, ax + k] - nx) * ix, (boxes[row, ay + k] - ny) * iy
        ahead, at = max(max(x, y), (boxes[row, az + k] - nz) * iz), top
        while at > bottom and waiting.ahead[at - 1] < ahead:
            waiting.links[at], waiting.ahead[at] = waiting.links[at - 1], waiting.ahead[at - 1]
            at -= 1
        waiting.links[at], waiting.ahead[at] = links[row, k], ahead
        top += 1
    return top


@inlined
def slabs_of(o: Vector3, d: Vector3, reach: float) -> tuple[Slab, Slab, Slab]:
    """Return how a ray enters and leaves boxes within `reach` of the frame's origin, m."""
    margin = ROUNDING * (reach + abs(o[0]) + abs(o[1]) + abs(o[2]))
    return (
        slab_of(o[0], d[0], margin, 0),
        slab_of(o[1], d[1], margin, 1),
        slab_of(o[2], d[2], margin, 2),
    )


@inlined
def meet_triangles(
    root: int, o: Vector3, d: Vector3, reach: float, limit: float, soup: Soup, waiting: Waiting
) -> float:
    """Return the distance to the nearest triangle of an asset, m; infinite beyond the limit.

    Args:
        root: Node that holds the asset.
        o: Origin of the ray in its frame, m.
        d: Direction there.
        reach: Largest coordinate of the asset, m.
        limit: Farthest distance of use, m.
        soup: Triangles of all assets.
        waiting: Scratch.
    """
    slabs, moment, best, found = slabs_of(o, d, reach), cross(o, d), limit, math.inf
    waiting.links[0], waiting.ahead[0] = root, np.float32(0.0)
    top = 1
    while top > 0:
        top -= 1
        link, farthest = waiting.links[top], np.float32(best * FARTHER)
        if waiting.ahead[top] > farthest:
            continue
        if link >= 0:
            top = open_node(soup.boxes, soup.links, link, slabs, farthest, top, waiting)
            continue
        first, count = (-link) >> LEAF_BITS, (-link) & ((1 << LEAF_BITS) - 1)
        for row in range(first, first + count):
            x = reach_triangle(soup.vertices, soup.corners, row, o, d, moment)
            if x <= best:
                best = found = x
    return found
