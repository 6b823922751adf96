"""Casting one sweep: which geoms a tile can meet at all, and where its beams meet them.

Each shape is a function of one ray in the geom's frame, without branches, so that the loop over a
tile's beams becomes vector instructions. Sums and quotients are those of MuJoCo 4.0's `mj_ray`,
term by term: results agree with it to the last digits. No ray is shorter or longer than 1.

The tables stand here because numba's cache would not notice if their fields were put in another
order in another file.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from models._jit import kernel

Array = NDArray[np.float64]

PLANE, SPHERE, CAPSULE, ELLIPSOID, CYLINDER, BOX = 0, 2, 3, 4, 5, 6
"""MuJoCo's `mjtGeom`."""

LEAST = 1e-15
"""MuJoCo's mjMINVAL: a component or a coefficient below it counts as 0."""

MARGIN = 1e-9
"""Bounds are wider than what they bound by this, m, so that rounding never rules out a hit."""


class Geoms(NamedTuple):
    """Tables over the ray-visible geoms, in the order of their ids.

    Attributes:
        ids: (g,) geom id in the model.
        kinds: (g,) MuJoCo's `mjtGeom`.
        sizes: (g, 3) MuJoCo's sizes, m.
        extents: (g, 3) half sides of the box about each geom in its own frame, m; of a plane 0.
        radii: (g,) radius of the sphere about each geom, m; of a plane 0.
        positions: (g, 3) in the world, m.
        rotations: (g, 9) R_world_geom, row-major; of a sphere the identity, which MuJoCo's caster
            does not turn either.
    """

    ids: NDArray[np.int32]
    kinds: NDArray[np.int32]
    sizes: NDArray[np.float64]
    extents: NDArray[np.float64]
    radii: NDArray[np.float64]
    positions: NDArray[np.float64]
    rotations: NDArray[np.float64]


class Pattern(NamedTuple):
    """Beams of one sweep in the order of their tiles, and the cones about them.

    Attributes:
        beams: (3, n) unit directions, sensor frame, in the order of the tiles.
        places: (n,) row-major place of each beam in the sensor's pattern.
        tile_starts: (t + 1,) first beam of each tile, and n.
        tile_cones: (t, 5) axis in the sensor frame, cosine and sine of the half angle.
        block_starts: (b + 1,) first tile of each block, and t.
        block_cones: (b, 5) likewise.
    """

    beams: NDArray[np.float64]
    places: NDArray[np.int64]
    tile_starts: NDArray[np.int64]
    tile_cones: NDArray[np.float64]
    block_starts: NDArray[np.int64]
    block_cones: NDArray[np.float64]


@kernel
def first_root(a: float, b: float, c: float) -> float:
    """Smallest root >= 0 of a x^2 + 2 b x + c, infinite without one."""
    determinant = b * b - a * c
    root = math.sqrt(determinant)
    near = (-b - root) / a
    far = (-b + root) / a
    x = near if near >= 0.0 else far
    return x if (determinant >= 0.0) & (a >= LEAST) & (x >= 0.0) else math.inf


@kernel
def plane(
    px: float, py: float, pz: float, vx: float, vy: float, vz: float, sx: float, sy: float
) -> float:
    """Distance to the plane z = 0 from above; half sides of 0 are infinite."""
    x = -pz / vz
    inside = (sx <= 0.0) | (abs(px + x * vx) <= sx)
    inside &= (sy <= 0.0) | (abs(py + x * vy) <= sy)
    return x if (vz <= -LEAST) & (x >= 0.0) & inside else math.inf


@kernel
def sphere(
    px: float, py: float, pz: float, vx: float, vy: float, vz: float, radius: float
) -> float:
    """Distance to a sphere about the origin."""
    a = vx * vx + vy * vy + vz * vz
    b = vx * px + vy * py + vz * pz
    c = px * px + py * py + pz * pz - radius * radius
    return first_root(a, b, c)


@kernel
def ellipsoid(
    px: float,
    py: float,
    pz: float,
    vx: float,
    vy: float,
    vz: float,
    ix: float,
    iy: float,
    iz: float,
) -> float:
    """Distance to an ellipsoid; ix, iy, iz are the inverse squares of its half axes."""
    a = ix * vx * vx + iy * vy * vy + iz * vz * vz
    b = ix * vx * px + iy * vy * py + iz * vz * pz
    c = ix * px * px + iy * py * py + iz * pz * pz - 1.0
    return first_root(a, b, c)


@kernel
def round_side(
    px: float, py: float, pz: float, vx: float, vy: float, vz: float, radius: float, half: float
) -> float:
    """Distance to the side of a cylinder about z between -half and half."""
    x = first_root(vx * vx + vy * vy, vx * px + vy * py, px * px + py * py - radius * radius)
    return x if abs(pz + x * vz) <= half else math.inf


@kernel
def cap(
    px: float, py: float, pz: float, vx: float, vy: float, vz: float, radius: float, half: float
) -> float:
    """Distance to the half sphere that closes a capsule at z = half."""
    qz = pz - half
    a = vx * vx + vy * vy + vz * vz
    b = vx * px + vy * py + vz * qz
    determinant = b * b - a * (px * px + py * py + qz * qz - radius * radius)
    root = math.sqrt(determinant)
    near = (-b - root) / a
    far = (-b + root) / a
    near = near if (near >= 0.0) & (pz + near * vz >= half) else math.inf
    far = far if (far >= 0.0) & (pz + far * vz >= half) else math.inf
    x = near if near < far else far
    return x if determinant >= 0.0 else math.inf


@kernel
def capsule(
    px: float, py: float, pz: float, vx: float, vy: float, vz: float, radius: float, half: float
) -> float:
    """Distance to a capsule about z."""
    side = round_side(px, py, pz, vx, vy, vz, radius, half)
    top = cap(px, py, pz, vx, vy, vz, radius, half)
    bottom = cap(px, py, -pz, vx, vy, -vz, radius, half)
    end = top if top < bottom else bottom
    return side if side < end else end


@kernel
def disc(
    px: float, py: float, pz: float, vx: float, vy: float, vz: float, radius: float, height: float
) -> float:
    """Distance to the disc about z at a height, from both sides."""
    x = (height - pz) / vz
    qx = px + x * vx
    qy = py + x * vy
    hit = (abs(vz) > LEAST) & (x >= 0.0) & (qx * qx + qy * qy <= radius * radius)
    return x if hit else math.inf


@kernel
def cylinder(
    px: float, py: float, pz: float, vx: float, vy: float, vz: float, radius: float, half: float
) -> float:
    """Distance to a cylinder about z."""
    side = round_side(px, py, pz, vx, vy, vz, radius, half)
    top = disc(px, py, pz, vx, vy, vz, radius, half)
    bottom = disc(px, py, pz, vx, vy, vz, radius, -half)
    end = top if top < bottom else bottom
    return side if side < end else end


@kernel
def slab(p: float, v: float, half: float) -> tuple[float, float]:
    """Where a ray enters and leaves -half..half on one axis; never, or always, if parallel."""
    low = (-half - p) / v
    high = (half - p) / v
    enter = low if low < high else high
    leave = high if low < high else low
    parallel = abs(v) <= LEAST
    within = abs(p) <= half
    enter = (-math.inf if within else math.inf) if parallel else enter
    leave = (math.inf if within else -math.inf) if parallel else leave
    return enter, leave


@kernel
def box(
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
    """Distance to a box by its three slabs (Kay & Kajiya 1986)."""
    enter, leave = slab(px, vx, sx)
    enter_y, leave_y = slab(py, vy, sy)
    enter_z, leave_z = slab(pz, vz, sz)
    enter = enter if enter > enter_y else enter_y
    enter = enter if enter > enter_z else enter_z
    leave = leave if leave < leave_y else leave_y
    leave = leave if leave < leave_z else leave_z
    x = enter if enter >= 0.0 else leave
    return x if (enter <= leave) & (leave >= 0.0) else math.inf


@kernel
def turn(n: int, v: Array, m: Array, u: Array) -> None:
    """Directions (3, n) in the frame whose rotation in that of `v` is m (9,): u = m^T v."""
    m0, m1, m2, m3, m4, m5, m6, m7, m8 = m[0], m[1], m[2], m[3], m[4], m[5], m[6], m[7], m[8]
    vx, vy, vz = v[0], v[1], v[2]
    ux, uy, uz = u[0], u[1], u[2]
    for i in range(n):
        ux[i] = m0 * vx[i] + m3 * vy[i] + m6 * vz[i]
        uy[i] = m1 * vx[i] + m4 * vy[i] + m7 * vz[i]
        uz[i] = m2 * vx[i] + m5 * vy[i] + m8 * vz[i]


@kernel
def reach_geom(
    kind: int, n: int, p: Array, v: Array, m: Array, size: Array, u: Array, reach: Array
) -> None:
    """Distances of a tile's first n beams to one geom, infinite where they miss it.

    Args:
        kind: MuJoCo's `mjtGeom`.
        n: Number of beams.
        p: (3,) origin in the geom's frame, m.
        v: (3, n or more) directions in the world.
        m: (9,) R_world_geom, row-major.
        size: (3,) MuJoCo's sizes, m.
        u: (3, n or more) room for the directions in the geom's frame.
        reach: (n or more,) is written.
    """
    turn(n, v, m, u)
    px, py, pz = p[0], p[1], p[2]
    sx, sy, sz = size[0], size[1], size[2]
    x, y, z = u[0], u[1], u[2]
    if kind == PLANE:
        for i in range(n):
            reach[i] = plane(px, py, pz, x[i], y[i], z[i], sx, sy)
    elif kind == SPHERE:
        for i in range(n):
            reach[i] = sphere(px, py, pz, x[i], y[i], z[i], sx)
    elif kind == CAPSULE:
        for i in range(n):
            reach[i] = capsule(px, py, pz, x[i], y[i], z[i], sx, sy)
    elif kind == ELLIPSOID:
        ix, iy, iz = 1.0 / (sx * sx), 1.0 / (sy * sy), 1.0 / (sz * sz)
        for i in range(n):
            reach[i] = ellipsoid(px, py, pz, x[i], y[i], z[i], ix, iy, iz)
    elif kind == CYLINDER:
        for i in range(n):
            reach[i] = cylinder(px, py, pz, x[i], y[i], z[i], sx, sy)
    elif kind == BOX:
        for i in range(n):
            reach[i] = box(px, py, pz, x[i], y[i], z[i], sx, sy, sz)


@kernel
def keep_nearest(
    n: int, reach: Array, geom: int, best: Array, best_geom: NDArray[np.int64]
) -> None:
    """Take over the nearer hits; of equal ones the lower geom id's, whatever the order of tests."""
    for i in range(n):
        equal = (reach[i] == best[i]) & (geom < best_geom[i])
        nearer = (reach[i] < best[i]) | equal
        best[i] = reach[i] if nearer else best[i]
        best_geom[i] = geom if nearer else best_geom[i]


@kernel
def count_beyond(n: int, best: Array, distance: float) -> int:
    """How many beams could still be met at a distance or farther."""
    count = 0
    for i in range(n):
        count += best[i] > distance
    return count


@kernel
def approach(origin: Array, geoms: Geoms, local: Array, nearest: Array) -> None:
    """Origin in each geom's frame, (g, 3), and a lower bound on the distance to it, (g,)."""
    for g in range(len(geoms.kinds)):
        dx = origin[0] - geoms.positions[g, 0]
        dy = origin[1] - geoms.positions[g, 1]
        dz = origin[2] - geoms.positions[g, 2]
        m = geoms.rotations[g]
        squared = 0.0
        for axis in range(3):
            p = m[axis] * dx + m[3 + axis] * dy + m[6 + axis] * dz
            local[g, axis] = p
            squared += max(abs(p) - geoms.extents[g, axis], 0.0) ** 2
        bound = math.sqrt(squared)
        if geoms.kinds[g] == PLANE:  # seen from above only
            bound = local[g, 2] if local[g, 2] >= 0.0 else math.inf
        nearest[g] = max(bound - MARGIN * (1.0 + bound), 0.0)


@kernel
def may_meet(cone: Array, R: Array, origin: Array, geoms: Geoms, g: int) -> bool:
    """Whether a cone of beams from the origin touches the sphere about a geom.

    Args:
        cone: (5,) axis in the sensor frame, cosine and sine of the half angle.
        R: (3, 3) R_world_sensor.
        origin: (3,) in the world, m.
        geoms: Tables.
        g: Row in them.
    """
    cosine, sine = cone[3], cone[4]
    if cosine <= 0.0:
        return True
    ax = R[0, 0] * cone[0] + R[0, 1] * cone[1] + R[0, 2] * cone[2]
    ay = R[1, 0] * cone[0] + R[1, 1] * cone[1] + R[1, 2] * cone[2]
    az = R[2, 0] * cone[0] + R[2, 1] * cone[1] + R[2, 2] * cone[2]
    m = geoms.rotations[g]
    if geoms.kinds[g] == PLANE:  # met by beams that go down on it
        return bool(ax * m[2] + ay * m[5] + az * m[8] <= sine + MARGIN)
    cx = geoms.positions[g, 0] - origin[0]
    cy = geoms.positions[g, 1] - origin[1]
    cz = geoms.positions[g, 2] - origin[2]
    radius = geoms.radii[g] + MARGIN * (1.0 + geoms.radii[g])
    squared = cx * cx + cy * cy + cz * cz
    if squared <= radius * radius:
        return True
    along = cx * ax + cy * ay + cz * az
    across = math.sqrt(max(squared - along * along, 0.0))
    return bool(
        (across * cosine - along * sine <= radius) & (along * cosine + across * sine >= 0.0)
    )


@kernel
def cast_tile(
    n: int,
    v: Array,
    u: Array,
    reach: Array,
    best: Array,
    best_geom: NDArray[np.int64],
    cone: Array,
    R: Array,
    origin: Array,
    geoms: Geoms,
    local: Array,
    nearest: Array,
    candidates: NDArray[np.int64],
) -> None:
    """Walk the candidates, nearest first, until no beam of the tile can meet the next one."""
    for g in candidates:
        if count_beyond(n, best, nearest[g]) == 0:
            break
        if may_meet(cone, R, origin, geoms, g):
            m, size = geoms.rotations[g], geoms.sizes[g]
            reach_geom(geoms.kinds[g], n, local[g], v, m, size, u, reach)
            keep_nearest(n, reach, g, best, best_geom)


@kernel
def aim(pattern: Pattern, start: int, n: int, R: Array, v: Array) -> None:
    """Directions of the n beams from `start` in the world frame, into v (3, n or more)."""
    x, y, z = pattern.beams[0], pattern.beams[1], pattern.beams[2]
    for axis in range(3):
        component = v[axis]
        r0, r1, r2 = R[axis, 0], R[axis, 1], R[axis, 2]
        for i in range(n):
            component[i] = x[start + i] * r0 + y[start + i] * r1 + z[start + i] * r2


@kernel
def list_candidates(
    cone: Array,
    R: Array,
    origin: Array,
    geoms: Geoms,
    nearest: Array,
    order: NDArray[np.int64],
    limit: float,
    candidates: NDArray[np.int64],
) -> int:
    """Write the geoms within range that a block's cone may meet, nearest first; their number."""
    count = 0
    for g in order:
        if nearest[g] > limit:
            break
        if may_meet(cone, R, origin, geoms, g):
            candidates[count] = g
            count += 1
    return count


@kernel
def cast_sweep(
    pattern: Pattern,
    R: Array,
    origin: Array,
    geoms: Geoms,
    local: Array,
    nearest: Array,
    order: NDArray[np.int64],
    limit: float,
    distance: Array,
    geom_id: NDArray[np.int32],
) -> None:
    """Cast every beam of a pattern.

    Args:
        pattern: Beams, tiles and blocks.
        R: (3, 3) R_world_sensor.
        origin: (3,) in the world, m.
        geoms: Tables over g geoms.
        local: (g, 3) and
        nearest: (g,) by `approach`.
        order: (g,) rows by ascending `nearest`.
        limit: Longest distance, m; finite.
        distance: (n,) is written in the pattern's row-major order: m, -1 without a hit.
        geom_id: (n,) likewise, -1 without a hit.
    """
    no_geom = len(order)
    widest = np.max(np.diff(pattern.tile_starts))
    v, u = np.empty((3, widest)), np.empty((3, widest))
    reach, best, best_geom = np.empty(widest), np.empty(widest), np.empty(widest, np.int64)
    candidates = np.empty(no_geom, np.int64)
    for block in range(len(pattern.block_cones)):
        cone = pattern.block_cones[block]
        count = list_candidates(cone, R, origin, geoms, nearest, order, limit, candidates)
        for tile in range(pattern.block_starts[block], pattern.block_starts[block + 1]):
            start = pattern.tile_starts[tile]
            n = pattern.tile_starts[tile + 1] - start
            aim(pattern, start, n, R, v)
            best[:] = limit
            best_geom[:] = no_geom
            cast_tile(
                n, v, u, reach, best, best_geom, pattern.tile_cones[tile], R, origin, geoms, local,
                nearest, candidates[:count],
            )  # fmt: skip
            for i in range(n):
                place = pattern.places[start + i]
                hit = best_geom[i] < no_geom
                distance[place] = best[i] if hit else -1.0
                geom_id[place] = geoms.ids[best_geom[i]] if hit else -1
