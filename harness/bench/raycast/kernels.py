"""Casting of single rays, each alone down a tree over the geoms' boxes."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayproof.models._jit import allocating, kernel
from wayproof.models.arrays import Array, Vector3
from wayproof.models.rays.shapes import (
    CAPSULE,
    CYLINDER,
    ELLIPSOID,
    PLANE,
    SPHERE,
    box,
    capsule,
    cylinder,
    ellipsoid,
    plane,
    sphere,
)

TREE_STACK = 128
"""Nodes that wait while a ray walks a tree: more than any tree is deep."""

MIN_INVERTED = 1e-30
"""Minimum component of a direction that is inverted: it turns a ray by less than the margin."""


class RayGeoms(NamedTuple):
    """Primitives that rays meet.

    Attributes:
        ids: (g,) geom id in the model, ascending.
        kinds: (g,) MuJoCo's `mjtGeom`, primitives only.
        sizes: (g, 3) MuJoCo's sizes, m.
        positions: (g, 3) in the world, m.
        rotations: (g, 9) R_world_geom, row-major.
    """

    ids: NDArray[np.int32]
    kinds: NDArray[np.int32]
    sizes: Array
    positions: Array
    rotations: Array


class GeomTree(NamedTuple):
    """Tree over the geoms with bounds, and the geoms without.

    Attributes:
        boxes: (k, 6) nodes; none if there is no geom with bounds.
        links: (k, 3) see `Tree.links`.
        order: (g,) rows of the geoms as the leaves list them, then those without bounds.
        bounded: Number of geoms with bounds; every ray is tried on the others.
    """

    boxes: Array
    links: NDArray[np.int32]
    order: NDArray[np.int32]
    bounded: int


@kernel
def reach_shape(kind: int, p: Vector3, v: Vector3, size: Vector3) -> float:
    """Return the distance of one ray to one geom, both in the geom's frame."""
    sx, sy, sz = size
    if kind == PLANE:
        return plane(p, v, sx, sy)
    if kind == SPHERE:
        return sphere(p, v, sx)
    if kind == CAPSULE:
        return capsule(p, v, sx, sy)
    if kind == ELLIPSOID:
        return ellipsoid(p, v, (1.0 / (sx * sx), 1.0 / (sy * sy), 1.0 / (sz * sz)))
    if kind == CYLINDER:
        return cylinder(p, v, sx, sy)
    return box(p, v, size)


@kernel
def reach_row(o: Vector3, d: Vector3, geoms: RayGeoms, g: int) -> float:
    """Return the distance of one ray in the world to the geom in row g."""
    _, kinds, sizes, positions, rotations = geoms
    x, y, z = o[0] - positions[g, 0], o[1] - positions[g, 1], o[2] - positions[g, 2]
    m0, m1, m2 = rotations[g, 0], rotations[g, 1], rotations[g, 2]
    m3, m4, m5 = rotations[g, 3], rotations[g, 4], rotations[g, 5]
    m6, m7, m8 = rotations[g, 6], rotations[g, 7], rotations[g, 8]
    p = m0 * x + m3 * y + m6 * z, m1 * x + m4 * y + m7 * z, m2 * x + m5 * y + m8 * z
    v = (
        m0 * d[0] + m3 * d[1] + m6 * d[2],
        m1 * d[0] + m4 * d[1] + m7 * d[2],
        m2 * d[0] + m5 * d[1] + m8 * d[2],
    )
    return reach_shape(kinds[g], p, v, (sizes[g, 0], sizes[g, 1], sizes[g, 2]))


@kernel
def between(low: float, high: float, near: float, far: float) -> tuple[float, float]:
    """Clip an interval by two crossings, in either order."""
    enter = low if low < high else high
    leave = high if low < high else low
    return (enter if enter > near else near), (leave if leave < far else far)


@kernel
def enters(boxes: Array, node: int, o: Vector3, inverse: Vector3, best: float) -> bool:
    """Return whether a ray, by origin and inverse direction, enters a box before `best`."""
    ox, oy, oz = o
    ix, iy, iz = inverse
    near, far = 0.0, best
    near, far = between((boxes[node, 0] - ox) * ix, (boxes[node, 3] - ox) * ix, near, far)
    near, far = between((boxes[node, 1] - oy) * iy, (boxes[node, 4] - oy) * iy, near, far)
    near, far = between((boxes[node, 2] - oz) * iz, (boxes[node, 5] - oz) * iz, near, far)
    return near <= far


@kernel
def inverse_of(d: float) -> float:
    """Return 1 / d, finite, which keeps 0 * infinity out."""
    return 1.0 / (d if abs(d) > MIN_INVERTED else MIN_INVERTED)


@allocating
def cast_rays(
    origins: Array,
    directions: Array,
    geoms: RayGeoms,
    tree: GeomTree,
    limit: float,
    distance: Array,
    geom_id: NDArray[np.int32],
) -> None:
    """Cast independent rays, each alone.

    Args:
        origins: (n, 3) in the world, m.
        directions: (n, 3) unit vectors in the world.
        geoms: Primitives.
        tree: Tree over them.
        limit: Longest distance, m; finite.
        distance: (n,) is written: m, -1 without a hit.
        geom_id: (n,) likewise, -1 without a hit.
    """
    ids = geoms.ids
    boxes, links, order, bounded = tree
    stack = np.empty(TREE_STACK, np.int32)
    for i in range(len(origins)):
        o = origins[i, 0], origins[i, 1], origins[i, 2]
        d = directions[i, 0], directions[i, 1], directions[i, 2]
        inverse = inverse_of(d[0]), inverse_of(d[1]), inverse_of(d[2])
        best, best_row = limit, len(ids)
        # The geoms without bounds first, then the leaves that the ray enters, nearest child first.
        waiting, first, stop = 0, bounded, len(order)
        if len(boxes) > 0:
            stack[0] = 0
            waiting = 1
        while True:
            for place in range(first, stop):
                g = order[place]
                x = reach_row(o, d, geoms, g)
                if (x < best) | ((x == best) & (g < best_row)):
                    best, best_row = x, g
            if waiting == 0:
                break
            waiting -= 1
            node = stack[waiting]
            first, stop = 0, 0
            if not enters(boxes, node, o, inverse, best):
                continue
            first = links[node, 0]
            stop = first + links[node, 1]
            if stop == first:
                backwards = directions[i, links[node, 2]] < 0.0
                stack[waiting] = first if backwards else first + 1
                stack[waiting + 1] = first + 1 if backwards else first
                waiting += 2
        hit = best_row < len(ids)
        distance[i] = best if hit else -1.0
        geom_id[i] = ids[best_row] if hit else -1
