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
        axes: (g, 3) and
        sides: (g, 3) half axes of an ellipsoid and half sides of a box, m, whose Minkowski sum
            each geom is, in its own frame; an infinite side is `ENDLESS`.
        positions: (g, 3) in the world, m.
        rotations: (g, 9) R_world_geom, row-major; of a sphere the identity, which MuJoCo's caster
            does not turn either.
    """

    ids: NDArray[np.int32]
    kinds: NDArray[np.int32]
    sizes: NDArray[np.float64]
    axes: NDArray[np.float64]
    sides: NDArray[np.float64]
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
    near = -b - root
    x = (near if near >= 0.0 else -b + root) / a
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
def capsule(
    px: float, py: float, pz: float, vx: float, vy: float, vz: float, radius: float, half: float
) -> float:
    """Distance to a capsule about z.

    One of the two caps is enough: the one that the ray's way through the side leads to, or the
    one that it starts above.
    """
    around = px * px + py * py - radius * radius
    side = first_root(vx * vx + vy * vy, vx * px + vy * py, around)
    z = pz + side * vz
    past_end = max(abs(pz) - half, 0.0)
    inside = around + past_end * past_end < 0.0
    above_end = (around <= 0.0) & (past_end > 0.0) & (not inside)
    qz = pz - math.copysign(half, pz if above_end else z)
    a = vx * vx + vy * vy + vz * vz
    b = vx * px + vy * py + vz * qz
    determinant = b * b - a * (px * px + py * py + qz * qz - radius * radius)
    root = math.sqrt(determinant)
    near = -b - root
    cap = (near if (near >= 0.0) & (not inside) else -b + root) / a
    cap = cap if (determinant >= 0.0) & (cap >= 0.0) else math.inf
    return side if (abs(z) <= half) & (not above_end) else cap


@kernel
def cylinder(
    px: float, py: float, pz: float, vx: float, vy: float, vz: float, radius: float, half: float
) -> float:
    """Distance to a cylinder about z; of its discs the one that can be entered, or left."""
    around = px * px + py * py - radius * radius
    side = first_root(vx * vx + vy * vy, vx * px + vy * py, around)
    side = side if abs(pz + side * vz) <= half else math.inf
    inside = (around < 0.0) & (abs(pz) < half)
    disc = (math.copysign(half, vz if inside else pz) - pz) / vz
    qx = px + disc * vx
    qy = py + disc * vy
    met = (abs(vz) > LEAST) & (disc >= 0.0) & (qx * qx + qy * qy <= radius * radius)
    disc = disc if met else math.inf
    return side if side < disc else disc


@kernel
def face(
    p: float, q: float, r: float, v: float, w: float, u: float, s: float, sq: float, sr: float,
    inside: bool,
) -> float:  # fmt: skip
    """Distance to the face of a box that a ray can enter, or leave, across its first axis."""
    x = (math.copysign(s, v if inside else p) - p) / v
    met = (abs(v) > LEAST) & (x >= 0.0) & (abs(q + x * w) <= sq) & (abs(r + x * u) <= sr)
    return x if met else math.inf


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
    """Distance to a box."""
    inside = (abs(px) < sx) & (abs(py) < sy) & (abs(pz) < sz)
    x = face(px, py, pz, vx, vy, vz, sx, sy, sz, inside)
    y = face(py, pz, px, vy, vz, vx, sy, sz, sx, inside)
    z = face(pz, px, py, vz, vx, vy, sz, sx, sy, inside)
    x = x if x < y else y
    return x if x < z else z


@kernel
def reach_geom(
    kind: int, n: int, p: Array, v: Array, m: Array, size: Array, reach: Array
) -> None:
    """Distances of a tile's first n beams to one geom, infinite where they miss it.

    Args:
        kind: MuJoCo's `mjtGeom`.
        n: Number of beams.
        p: (3,) origin in the geom's frame, m.
        v: (3, n or more) directions in the world.
        m: (9,) R_world_geom, row-major.
        size: (3,) MuJoCo's sizes, m.
        reach: (n or more,) is written.
    """
    px, py, pz = p[0], p[1], p[2]
    sx, sy, sz = size[0], size[1], size[2]
    m0, m1, m2, m3, m4, m5, m6, m7, m8 = m[0], m[1], m[2], m[3], m[4], m[5], m[6], m[7], m[8]
    a, b, c = v[0], v[1], v[2]
    if kind == PLANE:
        for i in range(n):
            x = m0 * a[i] + m3 * b[i] + m6 * c[i]
            y = m1 * a[i] + m4 * b[i] + m7 * c[i]
            z = m2 * a[i] + m5 * b[i] + m8 * c[i]
            reach[i] = plane(px, py, pz, x, y, z, sx, sy)
    elif kind == SPHERE:
        for i in range(n):
            reach[i] = sphere(px, py, pz, a[i], b[i], c[i], sx)
    elif kind == CAPSULE:
        for i in range(n):
            x = m0 * a[i] + m3 * b[i] + m6 * c[i]
            y = m1 * a[i] + m4 * b[i] + m7 * c[i]
            z = m2 * a[i] + m5 * b[i] + m8 * c[i]
            reach[i] = capsule(px, py, pz, x, y, z, sx, sy)
    elif kind == ELLIPSOID:
        ix, iy, iz = 1.0 / (sx * sx), 1.0 / (sy * sy), 1.0 / (sz * sz)
        for i in range(n):
            x = m0 * a[i] + m3 * b[i] + m6 * c[i]
            y = m1 * a[i] + m4 * b[i] + m7 * c[i]
            z = m2 * a[i] + m5 * b[i] + m8 * c[i]
            reach[i] = ellipsoid(px, py, pz, x, y, z, ix, iy, iz)
    elif kind == CYLINDER:
        for i in range(n):
            x = m0 * a[i] + m3 * b[i] + m6 * c[i]
            y = m1 * a[i] + m4 * b[i] + m7 * c[i]
            z = m2 * a[i] + m5 * b[i] + m8 * c[i]
            reach[i] = cylinder(px, py, pz, x, y, z, sx, sy)
    elif kind == BOX:
        for i in range(n):
            x = m0 * a[i] + m3 * b[i] + m6 * c[i]
            y = m1 * a[i] + m4 * b[i] + m7 * c[i]
            z = m2 * a[i] + m5 * b[i] + m8 * c[i]
            reach[i] = box(px, py, pz, x, y, z, sx, sy, sz)


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
def greatest(n: int, bits: NDArray[np.int64]) -> int:
    """Bits of the greatest of n numbers >= 0; integers, as only these make vector instructions."""
    top = 0
    for i in range(n):
        top = max(top, bits[i])
    return top


@kernel
def approach(
    centre: Array, spread: float, geoms: Geoms, local: Array, views: Array
) -> None:
    """How each geom looks from a ball of origins.

    Args:
        centre: (3,) in the world, m.
        spread: Radius of the ball, m.
        geoms: Tables over g geoms.
        local: (g, 3) is written: centre in each geom's frame, m.
        views: (6, g) is written: a lower bound of the distance, m; then a cone that every ray
            to the geom is in: axis, cosine and sine of the half angle.
    """
    for g in range(len(geoms.kinds)):
        dx = centre[0] - geoms.positions[g, 0]
        dy = centre[1] - geoms.positions[g, 1]
        dz = centre[2] - geoms.positions[g, 2]
        outside, radius = 0.0, 0.0
        for axis in range(3):
            m = geoms.rotations[g]
            p = m[axis] * dx + m[3 + axis] * dy + m[6 + axis] * dz
            local[g, axis] = p
            extent = geoms.axes[g, axis] + geoms.sides[g, axis]
            outside += max(abs(p) - extent, 0.0) ** 2
            radius += extent**2
        bound = math.sqrt(outside)
        radius = math.sqrt(radius)
        if geoms.kinds[g] == SPHERE:
            bound = math.sqrt(dx*dx+dy*dy+dz*dz) - geoms.axes[g, 0]
            radius = geoms.axes[g, 0]
        elif geoms.kinds[g] == CAPSULE:
            radius = geoms.axes[g, 0] + geoms.sides[g, 2]
        elif geoms.kinds[g] == ELLIPSOID:
            radius = max(geoms.axes[g, 0], geoms.axes[g, 1], geoms.axes[g, 2])
        radius = (radius + spread) + MARGIN * (1.0 + radius)
        squared = dx * dx + dy * dy + dz * dz
        views[1:, g] = 0.0
        if geoms.kinds[g] == PLANE:  # met from above by what goes down
            bound = bound if local[g, 2] >= -spread else math.inf
            for axis in range(3):
                views[1 + axis, g] = -geoms.rotations[g, 3 * axis + 2]
            views[5, g] = 1.0
        elif squared > radius * radius * 1.000001:
            length = math.sqrt(squared)
            views[1, g] = -dx / length
            views[2, g] = -dy / length
            views[3, g] = -dz / length
            views[4, g] = math.sqrt((squared - radius * radius) / squared)
            views[5, g] = radius / length
        else:
            views[4, g], views[5, g] = -1.0, 1.0
        views[0, g] = max(bound - spread - MARGIN * (1.0 + bound), 0.0)


@kernel
def list_meeting(
    cone: Array, views: Array, count: int, slack: Array, chosen: NDArray[np.int64]
) -> int:
    """Write which of the first `count` views a cone of beams touches, in order; their number."""
    ax, ay, az, cosine, sine = cone[0], cone[1], cone[2], cone[3], cone[4]
    x, y, z, c, s = views[1], views[2], views[3], views[4], views[5]
    for i in range(count):
        slack[i] = ax * x[i] + ay * y[i] + az * z[i] - (cosine * c[i] - sine * s[i])
    found = 0
    for i in range(count):
        chosen[found] = i
        found += (slack[i] >= -1e-12) | (cosine <= 0.0)
    return found


@kernel
def frame(n: int, v: Array, cone: Array, up: Array, walls: Array) -> None:
    """Normals of the four planes about a tile's beams, which are on their inner side, (4, 3)."""
    ax, ay, az = cone[0], cone[1], cone[2]
    ex, ey, ez = up[1] * az - up[2] * ay, up[2] * ax - up[0] * az, up[0] * ay - up[1] * ax
    length = math.sqrt(ex * ex + ey * ey + ez * ez)
    if (cone[3] < 0.1) | (length < 0.01):
        walls[:] = 0.0
        return
    ex, ey, ez = ex / length, ey / length, ez / length
    fx, fy, fz = ay * ez - az * ey, az * ex - ax * ez, ax * ey - ay * ex
    x, y, z = v[0], v[1], v[2]
    e_low, e_high, f_low, f_high = math.inf, -math.inf, math.inf, -math.inf
    for i in range(n):
        w = 1.0 / (ax * x[i] + ay * y[i] + az * z[i])
        e = (ex * x[i] + ey * y[i] + ez * z[i]) * w
        f = (fx * x[i] + fy * y[i] + fz * z[i]) * w
        e_low = e if e < e_low else e_low
        e_high = e if e > e_high else e_high
        f_low = f if f < f_low else f_low
        f_high = f if f > f_high else f_high
    e_low -= 1e-12
    f_low -= 1e-12
    e_high += 1e-12
    f_high += 1e-12
    walls[0, 0], walls[0, 1], walls[0, 2] = ex - e_low * ax, ey - e_low * ay, ez - e_low * az
    walls[1, 0], walls[1, 1], walls[1, 2] = e_high * ax - ex, e_high * ay - ey, e_high * az - ez
    walls[2, 0], walls[2, 1], walls[2, 2] = fx - f_low * ax, fy - f_low * ay, fz - f_low * az
    walls[3, 0], walls[3, 1], walls[3, 2] = f_high * ax - fx, f_high * ay - fy, f_high * az - fz


@kernel
def farthest_along(nx: float, ny: float, nz: float, p: Array, m: Array, axes: Array, sides: Array, spread: float) -> float:
    """How far a geom reaches along a vector from origins: the support function."""
    kx = nx * m[0] + ny * m[3] + nz * m[6]
    ky = nx * m[1] + ny * m[4] + nz * m[7]
    kz = nx * m[2] + ny * m[5] + nz * m[8]
    rx, ry, rz = kx * axes[0], ky * axes[1], kz * axes[2]
    return (
        math.sqrt(rx * rx + ry * ry + rz * rz)
        + abs(kx) * sides[0] + abs(ky) * sides[1] + abs(kz) * sides[2]
        - (kx * p[0] + ky * p[1] + kz * p[2])
        + spread * (abs(nx) + abs(ny) + abs(nz))
    )


@kernel
def may_meet(
    walls: Array, cone: Array, farthest: float, p: Array, m: Array, axes: Array, sides: Array,
    spread: float,
) -> bool:  # fmt: skip
    if -farthest_along(-cone[0], -cone[1], -cone[2], p, m, axes, sides, spread) > farthest + MARGIN:
        return False
    for i in range(4):
        if farthest_along(walls[i, 0], walls[i, 1], walls[i, 2], p, m, axes, sides, spread) < -MARGIN:
            return False
    return True


@kernel
def aim(pattern: Pattern, start: int, n: int, R: Array, v: Array) -> None:
    """Directions of the n beams from `start` in the world frame, into v (3, n or more)."""
    x, y, z = pattern.beams[0], pattern.beams[1], pattern.beams[2]
    for axis in range(3):
        component = v[axis]
        r0, r1, r2 = R[0, axis, 0], R[0, axis, 1], R[0, axis, 2]
        for i in range(n):
            component[i] = x[start + i] * r0 + y[start + i] * r1 + z[start + i] * r2


@kernel
def cast_blocks(
    first: int,
    step: int,
    pattern: Pattern,
    tile_cones: Array,
    block_cones: Array,
    R: Array,
    spread: float,
    geoms: Geoms,
    local: Array,
    order: NDArray[np.int64],
    views: Array,
    limit: float,
    distance: Array,
    geom_id: NDArray[np.int32],
    stats: NDArray[np.int64],
) -> None:
    no_geom = len(order)
    widest = np.max(np.diff(pattern.tile_starts))
    v = np.empty((3, widest))
    walls = np.empty((4, 3))
    reach, best, best_geom = np.empty(widest), np.empty(widest), np.empty(widest, np.int64)
    bits = best.view(np.int64)
    as_bits = np.empty(1)
    as_int = as_bits.view(np.int64)
    slack = np.empty(no_geom)
    near = np.empty((6, no_geom))
    rows = np.empty(no_geom, np.int64)
    chosen = np.empty(no_geom + 1, np.int64)
    up = R[0, :, 2].copy()
    within = 0
    while within < no_geom and views[0, within] <= limit:
        within += 1
    for block in range(first, len(block_cones), step):
        count = list_meeting(block_cones[block], views, within, slack, chosen)
        stats[0] += within
        stats[1] += count
        for k in range(6):
            for i in range(count):
                near[k, i] = views[k, chosen[i]]
        for i in range(count):
            rows[i] = order[chosen[i]]
        for tile in range(pattern.block_starts[block], pattern.block_starts[block + 1]):
            start = pattern.tile_starts[tile]
            n = pattern.tile_starts[tile + 1] - start
            cone = tile_cones[tile]
            candidates = list_meeting(cone, near, count, slack, chosen)
            stats[2] += candidates
            if candidates == 0:
                for i in range(n):
                    place = pattern.places[start + i]
                    distance[place] = -1.0
                    geom_id[place] = -1
                continue
            stats[6] += 1
            best[:] = limit
            best_geom[:] = no_geom
            aim(pattern, start, n, R, v)
            frame(n, v, cone, up, walls)
            farthest = limit
            for i in range(candidates):
                c = chosen[i]
                if near[0, c] > farthest:
                    break
                g = rows[c]
                stats[3] += 1
                p, m = local[g], geoms.rotations[g]
                if may_meet(walls, cone, farthest, p, m, geoms.axes[g], geoms.sides[g], spread):
                    stats[4] += 1
                    stats[10 + geoms.kinds[g]] += 1
                    reach_geom(geoms.kinds[g], n, p, v, m, geoms.sizes[g], reach)
                    keep_nearest(n, reach, g, best, best_geom)
                    as_int[0] = greatest(n, bits)
                    farthest = as_bits[0]
            for i in range(n):
                place = pattern.places[start + i]
                hit = best_geom[i] < no_geom
                distance[place] = best[i] if hit else -1.0
                geom_id[place] = geoms.ids[best_geom[i]] if hit else -1
