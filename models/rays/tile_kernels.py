"""Casting one sweep: the beams of a tile against the geoms that its bounds leave.

Loops over the beams of a tile have no branches, so that they become vector instructions.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wayproof.kernel_compiler import allocating, kernel
from wayproof.models.arrays import Array, Vector3
from wayproof.models.rays.bounds import enclose, fit_cone, may_meet, select_views
from wayproof.models.rays.records import Geoms, Pattern, Room, Soup, Sweep, Waiting
from wayproof.models.rays.shapes import (
    BOX,
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
from wayproof.models.rays.walks import meet_triangles

MAX_UNWALLED = 2
"""Maximum number of candidates of a tile that are tried without planes, which cost more."""


@kernel
def aim_rolling(
    start: int, stop: int, beams: Array, pose_indices: NDArray[np.int32], R: Array, v: Array
) -> None:
    """Turn the beams from `start` to `stop` to the world, each by its scan pose's rotation."""
    for i in range(start, stop):
        x, y, z, k = beams[0, i], beams[1, i], beams[2, i], pose_indices[i]
        for axis in range(3):
            v[axis, i] = x * R[k, axis, 0] + y * R[k, axis, 1] + z * R[k, axis, 2]


@kernel
def aim(start: int, n: int, beams: Array, R: Array, v: Array) -> None:
    """Turn the directions of the n beams from `start`, all alike, to the world."""
    a0, a1, a2 = R[0, 0], R[0, 1], R[0, 2]
    b0, b1, b2 = R[1, 0], R[1, 1], R[1, 2]
    c0, c1, c2 = R[2, 0], R[2, 1], R[2, 2]
    for i in range(n):
        x, y, z = beams[0, start + i], beams[1, start + i], beams[2, start + i]
        v[0, i] = x * a0 + y * a1 + z * a2
        v[1, i] = x * b0 + y * b1 + z * b2
        v[2, i] = x * c0 + y * c1 + z * c2


@kernel
def copy_origins(
    start: int, n: int, pose_indices: NDArray[np.int32], origins: Array, starts: Array
) -> None:
    """Copy the origins of the n beams from `start`, each at its scan pose."""
    for i in range(n):
        k = pose_indices[start + i]
        starts[0, i], starts[1, i], starts[2, i] = origins[k, 0], origins[k, 1], origins[k, 2]


@kernel
def localize_origins(
    n: int, g: int, positions: Array, rotations: Array, starts: Array, local_starts: Array
) -> None:
    """Express the origins of n beams in the frame of geom g, with the sums of `view_geoms`."""
    x, y, z = positions[g, 0], positions[g, 1], positions[g, 2]
    for axis in range(3):
        m0, m3, m6 = rotations[g, axis], rotations[g, 3 + axis], rotations[g, 6 + axis]
        for i in range(n):
            dx, dy, dz = starts[0, i] - x, starts[1, i] - y, starts[2, i] - z
            local_starts[axis, i] = m0 * dx + m3 * dy + m6 * dz


@kernel
def turn(m: tuple[float, ...], x: float, y: float, z: float) -> Vector3:
    """Return a world direction in the frame whose rotation is m (9,), row-major: m^T v."""
    return (
        m[0] * x + m[3] * y + m[6] * z,
        m[1] * x + m[4] * y + m[7] * z,
        m[2] * x + m[5] * y + m[8] * z,
    )


@kernel
def origin_of(shared: Vector3, local_starts: Array | None, i: int) -> Vector3:
    """Return the origin of beam i; numba settles as it compiles which of the two there is."""
    if local_starts is None:
        return shared
    return local_starts[0, i], local_starts[1, i], local_starts[2, i]


@kernel
def shape_of(g: int, sizes: Array, rotations: Array) -> tuple[Vector3, tuple[float, ...]]:
    """Return size (3,), m, and R_world_geom (9,), row-major, of row g as scalars."""
    r = rotations
    rotation = r[g, 0], r[g, 1], r[g, 2], r[g, 3], r[g, 4], r[g, 5], r[g, 6], r[g, 7], r[g, 8]
    return (sizes[g, 0], sizes[g, 1], sizes[g, 2]), rotation


@kernel
def reach_geom(
    n: int,
    kind: int,
    size: Vector3,
    m: tuple[float, ...],
    origin: Vector3,
    local_starts: Array | None,
    v: Array,
    reach: Array,
) -> None:
    """Compute the distances of a tile's first n beams to one geom, infinite where they miss it.

    Args:
        n: Number of beams.
        kind: MuJoCo's `mjtGeom`.
        size: MuJoCo's sizes, m.
        m: (9,) R_world_geom, row-major.
        origin: Origin of all beams in the geom's frame, m; unused if there are `local_starts`.
        local_starts: (3, n or more) origin of each beam in the geom's frame, m.
        v: (3, n or more) directions in the world.
        reach: (n or more,) is written.
    """
    sx, sy, sz = size
    a, b, c = v[0], v[1], v[2]
    # One loop for each shape: a branch inside the loop would keep it from becoming vectors.
    if kind == PLANE:
        for i in range(n):
            p = origin_of(origin, local_starts, i)
            reach[i] = plane(p, turn(m, a[i], b[i], c[i]), sx, sy)
    elif kind == SPHERE:
        for i in range(n):
            p = origin_of(origin, local_starts, i)
            reach[i] = sphere(p, turn(m, a[i], b[i], c[i]), sx)
    elif kind == CAPSULE:
        for i in range(n):
            p = origin_of(origin, local_starts, i)
            reach[i] = capsule(p, turn(m, a[i], b[i], c[i]), sx, sy)
    elif kind == ELLIPSOID:
        inverse_squares = 1.0 / (sx * sx), 1.0 / (sy * sy), 1.0 / (sz * sz)
        for i in range(n):
            p = origin_of(origin, local_starts, i)
            reach[i] = ellipsoid(p, turn(m, a[i], b[i], c[i]), inverse_squares)
    elif kind == CYLINDER:
        for i in range(n):
            p = origin_of(origin, local_starts, i)
            reach[i] = cylinder(p, turn(m, a[i], b[i], c[i]), sx, sy)
    elif kind == BOX:
        for i in range(n):
            p = origin_of(origin, local_starts, i)
            reach[i] = box(p, turn(m, a[i], b[i], c[i]), size)


@kernel
def reach_soup(
    n: int, shape: tuple[int, float, tuple[float, ...], Vector3], local_starts: Array | None,
    v: Array, best: Array, soup: Soup, waiting: Waiting, reach: Array,
) -> None:  # fmt: skip
    """Compute the distances of a tile's first n beams to a geom of triangles, as `reach_geom` does.

    Args:
        n: Number of beams.
        shape: Node that holds the triangles, radius of the ball about the geom, m, and its `m` and
            `origin` as for `reach_geom`.
        local_starts: As for `reach_geom`.
        v: Likewise.
        best: (n or more,) nearest hits so far, m; what is farther is a miss.
        soup: Triangles.
        waiting: Scratch.
        reach: (n or more,) is written.
    """
    root, radius, m, origin = shape
    for i in range(n):
        o, d = origin_of(origin, local_starts, i), turn(m, v[0, i], v[1, i], v[2, i])
        reach[i] = meet_triangles(root, o, d, radius, best[i], soup, waiting)


@kernel
def keep_nearest(
    n: int,
    geom: int,
    reach: Array,
    best: Array,
    best_bits: NDArray[np.int64],
    best_geom: NDArray[np.int64],
) -> float:
    """Keep the nearer hits; return the farthest distance that a beam has now, m.

    Of equal distances the lower geom id wins, whatever the order of tests. The farthest is found on
    the bits, which for numbers >= 0 are in the order of the numbers: a maximum of integers becomes
    vector instructions, one of floating-point numbers does not.
    """
    for i in range(n):
        equal = (reach[i] == best[i]) & (geom < best_geom[i])
        nearer = (reach[i] < best[i]) | equal
        best[i] = reach[i] if nearer else best[i]
        best_geom[i] = geom if nearer else best_geom[i]
    top = 0
    for i in range(n):
        top = max(top, best_bits[i])
    last = len(best) - 1
    best_bits[last] = top
    return float(best[last])


@kernel
def copy_views(
    count: int, chosen: NDArray[np.int64], order: NDArray[np.int64], views: Array,
    rows: NDArray[np.int64], near: Array,
) -> None:  # fmt: skip
    """Copy the chosen views, and the rows of their geoms, side by side for a block's tiles."""
    for i in range(count):
        c = chosen[i]
        rows[i] = order[c]
        for k in range(6):
            near[k, i] = views[k, c]


@kernel
def clear_hits(
    n: int, limit: float, no_geom: int, best: Array, best_geom: NDArray[np.int64]
) -> None:
    """Start without hits: all beams at the limit, with a row that gives way to any geom."""
    for i in range(n):
        best[i] = limit
        best_geom[i] = no_geom


@kernel
def report(
    n: int, start: int, places: NDArray[np.int64], best: Array, best_geom: NDArray[np.int64],
    ids: NDArray[np.int32], distance: Array, geom_id: NDArray[np.int32],
) -> None:  # fmt: skip
    """Write a tile's hits in the order that the sensor reports."""
    for i in range(n):
        if best_geom[i] < len(ids):
            distance[places[start + i]] = best[i]
            geom_id[places[start + i]] = ids[best_geom[i]]


@allocating
def cast_blocks(
    pattern: Pattern,
    geoms: Geoms,
    sweep: Sweep,
    room: Room,
    soup: Soup | None,
    waiting: Waiting,
    distance: Array,
    geom_id: NDArray[np.int32],
) -> None:
    """Cast the beams of a pattern, block by block.

    Arrays are taken out of the tables once: numba counts references at every taking, and passes
    whole tables by value, which for each tile would take as long as a geom.

    Args:
        pattern: Beams, tiles and blocks.
        geoms: Tables over g geoms.
        sweep: Poses, and views of the geoms.
        room: Scratch arrays.
        soup: Triangles; None without any, so that no kernel for these is compiled.
        waiting: Scratch arrays of walks.
        distance: (n,) hits are written in the pattern's own order, m; misses are not.
        geom_id: (n,) likewise.
    """
    sensor_beams, places, tile_starts, _, block_starts, _, pose_indices = pattern
    ids, kinds, sizes, axes, sides, radii, roots, positions, rotations = geoms
    origins, turns, R, beams, spread, limit, tile_cones, block_cones, order, views, local = sweep
    v, starts, local_starts, reach, best, bits, best_geom, walls, slack, near, rows, chosen = room
    rolling = len(origins) > 1
    within = int(np.searchsorted(views[0], limit, "right"))
    up = turns[0, :, 2].copy()
    unwalled = MAX_UNWALLED if soup is None else 0
    for block in range(len(block_cones)):
        if rolling:  # the sensor turns, so tiles and blocks change their shapes
            start, stop = tile_starts[block_starts[block]], tile_starts[block_starts[block + 1]]
            aim_rolling(start, stop, sensor_beams, pose_indices, turns, beams)
            fit_cone(start, stop, beams, block, block_cones)
            for tile in range(block_starts[block], block_starts[block + 1]):
                fit_cone(tile_starts[tile], tile_starts[tile + 1], beams, tile, tile_cones)
        # Rule geoms out for the whole block, then for each of its tiles.
        count = select_views(block_cones, block, within, views, slack, chosen)
        copy_views(count, chosen, order, views, rows, near)
        for tile in range(block_starts[block], block_starts[block + 1]):
            start, n = tile_starts[tile], tile_starts[tile + 1] - tile_starts[tile]
            candidates = select_views(tile_cones, tile, count, near, slack, chosen)
            if candidates == 0:
                continue
            aim(start, n, beams, R, v)
            if rolling:
                copy_origins(start, n, pose_indices, origins, starts)
            clear_hits(n, limit, len(ids), best, best_geom)
            if candidates > unwalled:
                enclose(n, v, tile, tile_cones, up, walls)
            # Nearest lower bound first: once it is beyond the farthest hit, no geom can be nearer.
            farthest = limit
            for i in range(candidates):
                g = rows[chosen[i]]
                if near[0, chosen[i]] > farthest:
                    break
                if candidates > unwalled and not may_meet(
                    walls, farthest, g, rotations, axes, sides, local, spread
                ):
                    continue
                size, m = shape_of(g, sizes, rotations)
                origin = local[g, 0], local[g, 1], local[g, 2]
                if rolling:
                    localize_origins(n, g, positions, rotations, starts, local_starts)
                if soup is not None and roots[g] >= 0:
                    shape = roots[g], radii[g], m, origin
                    if rolling:
                        reach_soup(n, shape, local_starts, v, best, soup, waiting, reach)
                    else:
                        reach_soup(n, shape, None, v, best, soup, waiting, reach)
                elif rolling:
                    reach_geom(n, kinds[g], size, m, origin, local_starts, v, reach)
                else:
                    reach_geom(n, kinds[g], size, m, origin, None, v, reach)
                farthest = keep_nearest(n, g, reach, best, bits, best_geom)
            report(n, start, places, best, best_geom, ids, distance, geom_id)
