"""Casting rays that share nothing, each alone down a tree over the geoms' boxes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wayproof.models._jit import kernel
from wayproof.models.arrays import Array
from wayproof.models.rays.kernels import (
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

LEAST_INVERTED = 1e-30
"""A direction's component counts as no less: what that turns a ray by is inside the margin."""


@kernel
def reach_shape(
    kind: int,
    px: float,
    py: float,
    pz: float,
    vx: float,
    vy: float,
    vz: float,
    sx: float,
    sy: float,
    sz: float,
) -> float:
    """Distance of one ray to one geom, both in the geom's frame."""
    if kind == PLANE:
        return plane(px, py, pz, vx, vy, vz, sx, sy)
    if kind == SPHERE:
        return sphere(px, py, pz, vx, vy, vz, sx)
    if kind == CAPSULE:
        return capsule(px, py, pz, vx, vy, vz, sx, sy)
    if kind == ELLIPSOID:
        ix, iy, iz = 1.0 / (sx * sx), 1.0 / (sy * sy), 1.0 / (sz * sz)
        return ellipsoid(px, py, pz, vx, vy, vz, ix, iy, iz)
    if kind == CYLINDER:
        return cylinder(px, py, pz, vx, vy, vz, sx, sy)
    return box(px, py, pz, vx, vy, vz, sx, sy, sz)


@kernel
def reach_row(
    ox: float,
    oy: float,
    oz: float,
    dx: float,
    dy: float,
    dz: float,
    kinds: NDArray[np.int32],
    sizes: Array,
    positions: Array,
    rotations: Array,
    g: int,
) -> float:
    """Distance of one ray in the world to the geom in row g."""
    x, y, z = ox - positions[g, 0], oy - positions[g, 1], oz - positions[g, 2]
    m0, m1, m2 = rotations[g, 0], rotations[g, 1], rotations[g, 2]
    m3, m4, m5 = rotations[g, 3], rotations[g, 4], rotations[g, 5]
    m6, m7, m8 = rotations[g, 6], rotations[g, 7], rotations[g, 8]
    return reach_shape(
        kinds[g],
        m0 * x + m3 * y + m6 * z, m1 * x + m4 * y + m7 * z, m2 * x + m5 * y + m8 * z,
        m0 * dx + m3 * dy + m6 * dz, m1 * dx + m4 * dy + m7 * dz, m2 * dx + m5 * dy + m8 * dz,
        sizes[g, 0], sizes[g, 1], sizes[g, 2],
    )  # fmt: skip


@kernel
def between(low: float, high: float, near: float, far: float) -> tuple[float, float]:
    """What two crossings, in either order, leave of an interval."""
    enter = low if low < high else high
    leave = high if low < high else low
    return (enter if enter > near else near), (leave if leave < far else far)


@kernel
def enters(
    boxes: Array,
    node: int,
    ox: float,
    oy: float,
    oz: float,
    ix: float,
    iy: float,
    iz: float,
    best: float,
) -> bool:
    """Whether a ray, given by its origin and inverse direction, enters a box before `best`."""
    near, far = 0.0, best
    near, far = between((boxes[node, 0] - ox) * ix, (boxes[node, 3] - ox) * ix, near, far)
    near, far = between((boxes[node, 1] - oy) * iy, (boxes[node, 4] - oy) * iy, near, far)
    near, far = between((boxes[node, 2] - oz) * iz, (boxes[node, 5] - oz) * iz, near, far)
    return near <= far


@kernel
def cast_rays(
    origins: Array,
    directions: Array,
    ids: NDArray[np.int32],
    kinds: NDArray[np.int32],
    sizes: Array,
    positions: Array,
    rotations: Array,
    boxes: Array,
    links: NDArray[np.int32],
    order: NDArray[np.int32],
    everywhere: int,
    limit: float,
    distance: Array,
    geom_id: NDArray[np.int32],
) -> None:
    """Cast rays that have nothing in common, each alone down a tree over the geoms' boxes.

    Args:
        origins: (n, 3) in the world, m.
        directions: (n, 3) unit vectors in the world.
        ids: (g,) geom id in the model, ascending.
        kinds: (g,) MuJoCo's `mjtGeom`, primitives only.
        sizes: (g, 3) MuJoCo's sizes, m.
        positions: (g, 3) in the world, m.
        rotations: (g, 9) R_world_geom, row-major.
        boxes: (k, 6) nodes of the tree over the geoms with bounds; none if there is no such geom.
        links: (k, 3) of a leaf its first place in `order` and how many; of an inner node its first
            child, of which the second is the next node, and 0; then the axis of the split.
        order: (g,) rows of the geoms as the leaves list them, then those without bounds.
        everywhere: First of these in `order`; every ray is tried on them.
        limit: Longest distance, m; finite.
        distance: (n,) is written: m, -1 without a hit.
        geom_id: (n,) likewise, -1 without a hit.
    """
    stack = np.empty(TREE_STACK, np.int32)
    for i in range(len(origins)):
        ox, oy, oz = origins[i, 0], origins[i, 1], origins[i, 2]
        dx, dy, dz = directions[i, 0], directions[i, 1], directions[i, 2]
        # A finite inverse keeps 0 * infinity out.
        ix = 1.0 / (dx if abs(dx) > LEAST_INVERTED else LEAST_INVERTED)
        iy = 1.0 / (dy if abs(dy) > LEAST_INVERTED else LEAST_INVERTED)
        iz = 1.0 / (dz if abs(dz) > LEAST_INVERTED else LEAST_INVERTED)
        best, best_row = limit, len(ids)
        waiting, first, stop = 0, everywhere, len(order)
        if len(boxes) > 0:
            stack[0] = 0
            waiting = 1
        while True:
            for place in range(first, stop):
                g = order[place]
                x = reach_row(ox, oy, oz, dx, dy, dz, kinds, sizes, positions, rotations, g)
                if (x < best) | ((x == best) & (g < best_row)):
                    best, best_row = x, g
            if waiting == 0:
                break
            waiting -= 1
            node = stack[waiting]
            first, stop = 0, 0
            if not enters(boxes, node, ox, oy, oz, ix, iy, iz, best):
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
