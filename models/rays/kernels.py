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

from wayproof.models._jit import kernel
from wayproof.models.arrays import Array

PLANE, SPHERE, CAPSULE, ELLIPSOID, CYLINDER, BOX = 0, 2, 3, 4, 5, 6
"""MuJoCo's `mjtGeom`."""

LEAST = 1e-15
"""MuJoCo's mjMINVAL: a component or a coefficient below it counts as 0."""

MARGIN = 1e-9
"""Bounds are wider than what they bound by this, m, so that rounding never rules out a hit."""

ANGLE_MARGIN = 1e-12
"""Likewise for cosines and slopes of directions."""

WIDE = 0.1
"""Cosine of a cone's half angle from which on there are no planes about its beams."""

FEW = 2
"""Candidates of a tile that are tried at once: for so few, planes cost more than they save."""


class Geoms(NamedTuple):
    """Tables over the ray-visible primitives, in the order of their ids.

    Each is, in its own frame, the Minkowski sum of an ellipsoid and a box, either of which may be
    flat: a capsule that of a ball and a line, a cylinder that of a disc and a line.

    Attributes:
        ids: (g,) geom id in the model.
        kinds: (g,) MuJoCo's `mjtGeom`.
        sizes: (g, 3) MuJoCo's sizes, m.
        axes: (g, 3) half axes of the ellipsoid, m.
        sides: (g, 3) half sides of the box, m; those of a plane may be as good as endless.
        radii: (g,) radius of the ball about each geom, m.
        positions: (g, 3) in the world, m.
        rotations: (g, 9) R_world_geom, row-major; of a sphere the identity, which MuJoCo's caster
            does not turn either.
    """

    ids: NDArray[np.int32]
    kinds: NDArray[np.int32]
    sizes: NDArray[np.float64]
    axes: NDArray[np.float64]
    sides: NDArray[np.float64]
    radii: NDArray[np.float64]
    positions: NDArray[np.float64]
    rotations: NDArray[np.float64]


class Pattern(NamedTuple):
    """Beams of one sweep in the order of their tiles, and the cones about them.

    Attributes:
        beams: (3, n) unit directions, sensor frame, in the order of the tiles.
        places: (n,) place of each beam in the order that the sensor reports.
        tile_starts: (t + 1,) first beam of each tile, and n.
        tile_cones: (t, 5) axis in the sensor frame, cosine and sine of the half angle.
        block_starts: (b + 1,) first tile of each block, and t.
        block_cones: (b, 5) likewise.
        moments: (n,) which of the sweep's m sensor poses each beam leaves from, in the order of
            the tiles; 0 when there is one.
    """

    beams: NDArray[np.float64]
    places: NDArray[np.int64]
    tile_starts: NDArray[np.int64]
    tile_cones: NDArray[np.float64]
    block_starts: NDArray[np.int64]
    block_cones: NDArray[np.float64]
    moments: NDArray[np.int32]


class Sweep(NamedTuple):
    """Where a pattern is cast from, and how the geoms look from there.

    Attributes:
        origins: (m, 3) in the world, m.
        turns: (m, 3, 3) R_world_sensor.
        R: (3, 3) that turns `beams` to the world: R_world_sensor, or the identity.
        beams: (3, n) directions in the order of the tiles: the pattern's own if all beams leave
            from one pose, else in the world, written block by block as that is cast.
        spread: Radius of the ball about the first origin that holds them all, m.
        limit: Longest distance of a hit, m; finite.
        tile_cones: (t, 5) cones about the beams in the world, written likewise.
        block_cones: (b, 5) likewise.
        order: (g,) rows of `Geoms` by ascending lower bound of the distance.
        views: (6, g) in that order, by `look`.
        local: (g, 3) first origin in each geom's frame, m, in the order of the ids.
    """

    origins: NDArray[np.float64]
    turns: NDArray[np.float64]
    R: NDArray[np.float64]
    beams: NDArray[np.float64]
    spread: float
    limit: float
    tile_cones: NDArray[np.float64]
    block_cones: NDArray[np.float64]
    order: NDArray[np.int64]
    views: NDArray[np.float64]
    local: NDArray[np.float64]


class Room(NamedTuple):
    """What one thread writes on while it casts tiles of up to w beams against g geoms.

    Attributes:
        v: (3, w) directions in the world.
        starts: (3, w) origins in the world, m, and
        spots: (3, w) in a geom's frame; both only for sweeps from several poses.
        reach: (w,) distances to one geom, m.
        best: (w + 1,) nearest ones so far, m, and the farthest of these.
        best_bits: (w + 1,) the same memory as integers.
        best_geom: (w,) rows of `Geoms`.
        walls: (5, 3) normals by `enclose`.
        slack: (g,) by `list_meeting`.
        block_views: (6, g) of the geoms that a block may meet, and
        block_rows: (g,) their rows of `Geoms`.
        chosen: (g + 1,) by `list_meeting`.
    """

    v: NDArray[np.float64]
    starts: NDArray[np.float64]
    spots: NDArray[np.float64]
    reach: NDArray[np.float64]
    best: NDArray[np.float64]
    best_bits: NDArray[np.int64]
    best_geom: NDArray[np.int64]
    walls: NDArray[np.float64]
    slack: NDArray[np.float64]
    block_views: NDArray[np.float64]
    block_rows: NDArray[np.int64]
    chosen: NDArray[np.int64]


@kernel
def first_root(a: float, b: float, c: float) -> float:
    """Smallest root >= 0 of a x^2 + 2 b x + c, infinite without one."""
    determinant = b * b - a * c
    root = math.sqrt(determinant if determinant > 0.0 else 0.0)
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
    root = math.sqrt(determinant if determinant > 0.0 else 0.0)
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
def turn(m: tuple[float, ...], x: float, y: float, z: float) -> tuple[float, float, float]:
    """A world direction in the frame whose rotation is m (9,), row-major: m^T v."""
    return (
        m[0] * x + m[3] * y + m[6] * z,
        m[1] * x + m[4] * y + m[7] * z,
        m[2] * x + m[5] * y + m[8] * z,
    )


@kernel
def spot(p: tuple[float, float, float], spots: Array | None, i: int) -> tuple[float, float, float]:
    """Where beam i leaves; which of the two it is, is settled as this compiles."""
    if spots is None:
        return p
    return spots[0, i], spots[1, i], spots[2, i]


@kernel
def reach_geom(
    n: int,
    kind: int,
    g: int,
    sizes: Array,
    rotations: Array,
    local: Array,
    spots: Array | None,
    v: Array,
    reach: Array,
) -> None:
    """Distances of a tile's first n beams to one geom, infinite where they miss it.

    Args:
        n: Number of beams.
        kind: MuJoCo's `mjtGeom`.
        g: Row in the next three.
        sizes: (g, 3) MuJoCo's sizes, m.
        rotations: (g, 9) R_world_geom, row-major.
        local: (g, 3) origin of all beams in each geom's frame, m; not looked at if there are
        spots: (3, n or more) origin of each beam in this geom's frame, m.
        v: (3, n or more) directions in the world.
        reach: (n or more,) is written.
    """
    sx, sy, sz = sizes[g, 0], sizes[g, 1], sizes[g, 2]
    o = (local[g, 0], local[g, 1], local[g, 2])
    r = rotations
    m = (r[g, 0], r[g, 1], r[g, 2], r[g, 3], r[g, 4], r[g, 5], r[g, 6], r[g, 7], r[g, 8])
    a, b, c = v[0], v[1], v[2]
    if kind == PLANE:
        for i in range(n):
            vx, vy, vz = turn(m, a[i], b[i], c[i])
            px, py, pz = spot(o, spots, i)
            reach[i] = plane(px, py, pz, vx, vy, vz, sx, sy)
    elif kind == SPHERE:
        for i in range(n):
            vx, vy, vz = turn(m, a[i], b[i], c[i])
            px, py, pz = spot(o, spots, i)
            reach[i] = sphere(px, py, pz, vx, vy, vz, sx)
    elif kind == CAPSULE:
        for i in range(n):
            vx, vy, vz = turn(m, a[i], b[i], c[i])
            px, py, pz = spot(o, spots, i)
            reach[i] = capsule(px, py, pz, vx, vy, vz, sx, sy)
    elif kind == ELLIPSOID:
        ix, iy, iz = 1.0 / (sx * sx), 1.0 / (sy * sy), 1.0 / (sz * sz)
        for i in range(n):
            vx, vy, vz = turn(m, a[i], b[i], c[i])
            px, py, pz = spot(o, spots, i)
            reach[i] = ellipsoid(px, py, pz, vx, vy, vz, ix, iy, iz)
    elif kind == CYLINDER:
        for i in range(n):
            vx, vy, vz = turn(m, a[i], b[i], c[i])
            px, py, pz = spot(o, spots, i)
            reach[i] = cylinder(px, py, pz, vx, vy, vz, sx, sy)
    elif kind == BOX:
        for i in range(n):
            vx, vy, vz = turn(m, a[i], b[i], c[i])
            px, py, pz = spot(o, spots, i)
            reach[i] = box(px, py, pz, vx, vy, vz, sx, sy, sz)


@kernel
def keep_nearest(
    n: int,
    geom: int,
    reach: Array,
    best: Array,
    best_bits: NDArray[np.int64],
    best_geom: NDArray[np.int64],
) -> float:
    """Take over the nearer hits, and tell the farthest that a beam has now, m.

    Of equal ones the lower geom id's, whatever the order of tests. The farthest is found on the
    bits, which for numbers >= 0 are in the order of the numbers: a maximum of integers becomes
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
def look(origin: Array, spread: float, geoms: Geoms, local: Array, views: Array) -> None:
    """How each geom looks from a ball of origins.

    Args:
        origin: (3,) centre of the ball in the world, m.
        spread: Its radius, m.
        geoms: Tables over g geoms.
        local: (g, 3) is written: the centre in each geom's frame, m.
        views: (6, g) is written: a lower bound of the distance to each geom, m; then a cone that
            holds every direction in which it is met: axis, cosine and sine of the half angle.
    """
    for g in range(len(geoms.kinds)):
        dx = origin[0] - geoms.positions[g, 0]
        dy = origin[1] - geoms.positions[g, 1]
        dz = origin[2] - geoms.positions[g, 2]
        squared, outside = dx * dx + dy * dy + dz * dz, 0.0
        for axis in range(3):
            m = geoms.rotations
            p = m[g, axis] * dx + m[g, 3 + axis] * dy + m[g, 6 + axis] * dz
            local[g, axis] = p
            past_side = abs(p) - geoms.axes[g, axis] - geoms.sides[g, axis]
            outside += max(past_side, 0.0) ** 2
        length, bound = math.sqrt(squared), math.sqrt(outside)
        radius = geoms.radii[g] + spread + MARGIN * (1.0 + geoms.radii[g])
        x, y, z, cosine, sine = 0.0, 0.0, 0.0, -1.0, 1.0  # seen in every direction
        if geoms.kinds[g] == PLANE:  # met from above, by all that goes down
            x, y, z = -geoms.rotations[g, 2], -geoms.rotations[g, 5], -geoms.rotations[g, 8]
            cosine = 0.0
            bound = bound if local[g, 2] >= -spread else math.inf
        else:
            bound = max(bound, length - geoms.radii[g])
            if length > radius * (1.0 + 1e-6):
                x, y, z = -dx / length, -dy / length, -dz / length
                cosine, sine = math.sqrt(1.0 - (radius / length) ** 2), radius / length
        views[0, g] = max(bound - spread - MARGIN * (1.0 + bound), 0.0)
        views[1, g], views[2, g], views[3, g] = x, y, z
        views[4, g], views[5, g] = cosine, sine


@kernel
def list_meeting(
    cones: Array, k: int, count: int, views: Array, slack: Array, chosen: NDArray[np.int64]
) -> int:
    """Which of the first `count` views cone k touches, in their order; their number.

    Two cones touch if the angle between their axes is no wider than both half angles.
    """
    ax, ay, az, cosine, sine = cones[k, 0], cones[k, 1], cones[k, 2], cones[k, 3], cones[k, 4]
    x, y, z, c, s = views[1], views[2], views[3], views[4], views[5]
    for i in range(count):
        slack[i] = ax * x[i] + ay * y[i] + az * z[i] - (cosine * c[i] - sine * s[i])
    found = 0
    for i in range(count):
        chosen[found] = i
        found += (slack[i] >= -ANGLE_MARGIN) | (cosine <= 0.0)
    return found


@kernel
def take_over(
    count: int, chosen: NDArray[np.int64], order: NDArray[np.int64], views: Array,
    rows: NDArray[np.int64], near: Array,
) -> None:  # fmt: skip
    """Put the chosen views, and the rows of their geoms, side by side for a block's tiles."""
    for i in range(count):
        c = chosen[i]
        rows[i] = order[c]
        for k in range(6):
            near[k, i] = views[k, c]


@kernel
def forget(n: int, limit: float, no_geom: int, best: Array, best_geom: NDArray[np.int64]) -> None:
    """No hit yet: as if all beams met at the limit something that gives way to any geom."""
    for i in range(n):
        best[i] = limit
        best_geom[i] = no_geom


@kernel
def enclose(n: int, v: Array, tile: int, cones: Array, up: Array, walls: Array) -> None:
    """Five planes through the origin about the n beams of a tile.

    Args:
        n: Number of beams.
        v: (3, n or more) directions in the world.
        tile: Row in
        cones: (t, 5) in the world.
        up: (3,) the sensor's z axis, which is about in a plane with each column of its beams.
        walls: (5, 3) normals are written. Four point inwards: n . v >= 0 for each beam v. The
            last one is the cone's axis. Where beams are far apart they have no length, and so are
            no bound.
    """
    ax, ay, az = cones[tile, 0], cones[tile, 1], cones[tile, 2]
    ex, ey, ez = up[1] * az - up[2] * ay, up[2] * ax - up[0] * az, up[0] * ay - up[1] * ax
    length = math.sqrt(ex * ex + ey * ey + ez * ez)
    if (cones[tile, 3] < WIDE) | (length < WIDE):
        for wall in range(5):
            walls[wall, 0] = walls[wall, 1] = walls[wall, 2] = 0.0
        return
    ex, ey, ez = ex / length, ey / length, ez / length
    fx, fy, fz = ay * ez - az * ey, az * ex - ax * ez, ax * ey - ay * ex
    e_low, e_high, f_low, f_high = math.inf, -math.inf, math.inf, -math.inf
    for i in range(n):
        x, y, z = v[0, i], v[1, i], v[2, i]
        along = 1.0 / (ax * x + ay * y + az * z)
        e, f = (ex * x + ey * y + ez * z) * along, (fx * x + fy * y + fz * z) * along
        e_low, e_high = e if e < e_low else e_low, e if e > e_high else e_high
        f_low, f_high = f if f < f_low else f_low, f if f > f_high else f_high
    e_low, e_high = e_low - ANGLE_MARGIN, e_high + ANGLE_MARGIN
    f_low, f_high = f_low - ANGLE_MARGIN, f_high + ANGLE_MARGIN
    walls[0, 0], walls[0, 1], walls[0, 2] = ex - e_low * ax, ey - e_low * ay, ez - e_low * az
    walls[1, 0], walls[1, 1], walls[1, 2] = e_high * ax - ex, e_high * ay - ey, e_high * az - ez
    walls[2, 0], walls[2, 1], walls[2, 2] = fx - f_low * ax, fy - f_low * ay, fz - f_low * az
    walls[3, 0], walls[3, 1], walls[3, 2] = f_high * ax - fx, f_high * ay - fy, f_high * az - fz
    walls[4, 0], walls[4, 1], walls[4, 2] = ax, ay, az


@kernel
def farthest_along(
    nx: float, ny: float, nz: float, g: int, rotations: Array, axes: Array, sides: Array,
    local: Array, spread: float,
) -> float:  # fmt: skip
    """Greatest n . (x - o) over the points x of a geom and the origins o: its support function."""
    m = rotations
    x = m[g, 0] * nx + m[g, 3] * ny + m[g, 6] * nz
    y = m[g, 1] * nx + m[g, 4] * ny + m[g, 7] * nz
    z = m[g, 2] * nx + m[g, 5] * ny + m[g, 8] * nz
    ellipsoid = math.sqrt((x * axes[g, 0]) ** 2 + (y * axes[g, 1]) ** 2 + (z * axes[g, 2]) ** 2)
    box = abs(x) * sides[g, 0] + abs(y) * sides[g, 1] + abs(z) * sides[g, 2]
    centre = -(x * local[g, 0] + y * local[g, 1] + z * local[g, 2])
    return float(centre + ellipsoid + box + spread * (abs(nx) + abs(ny) + abs(nz)) + MARGIN)


@kernel
def may_meet(
    walls: Array, farthest: float, g: int, rotations: Array, axes: Array, sides: Array,
    local: Array, spread: float,
) -> bool:  # fmt: skip
    """Whether a geom is on the inner side of a tile's planes, and nearer than its hits so far."""
    x, y, z = walls[4, 0], walls[4, 1], walls[4, 2]
    if farthest_along(-x, -y, -z, g, rotations, axes, sides, local, spread) < -farthest:
        return False
    for i in range(4):
        x, y, z = walls[i, 0], walls[i, 1], walls[i, 2]
        if farthest_along(x, y, z, g, rotations, axes, sides, local, spread) < 0.0:
            return False
    return True


@kernel
def fit_cone(start: int, stop: int, beams: Array, k: int, cones: Array) -> None:
    """Cone k about the mean direction of the beams from `start` to `stop`, see `fit_cones`."""
    x, y, z = 0.0, 0.0, 0.0
    for i in range(start, stop):
        x, y, z = x + beams[0, i], y + beams[1, i], z + beams[2, i]
    length = math.sqrt(x * x + y * y + z * z)
    if length > 1e-9:
        x, y, z = x / length, y / length, z / length
    else:
        x, y, z = beams[0, start], beams[1, start], beams[2, start]
    cosine = 1.0
    for i in range(start, stop):
        along = x * beams[0, i] + y * beams[1, i] + z * beams[2, i]
        cosine = along if along < cosine else cosine
    cosine = max(cosine - ANGLE_MARGIN, -1.0)
    cones[k, 0], cones[k, 1], cones[k, 2] = x, y, z
    cones[k, 3], cones[k, 4] = cosine, math.sqrt(1.0 - cosine * cosine)


@kernel
def fit_cones(beams: Array, starts: NDArray[np.int64], cones: Array) -> None:
    """Cones about the mean directions of runs of beams.

    Args:
        beams: (3, n) unit directions.
        starts: (k + 1,) first beam of each run, and n.
        cones: (k, 5) is written: axis, cosine and sine of the half angle.
    """
    for k in range(len(cones)):
        fit_cone(starts[k], starts[k + 1], beams, k, cones)


@kernel
def aim_rolling(
    start: int, stop: int, beams: Array, moments: NDArray[np.int32], R: Array, v: Array
) -> None:
    """World directions (3, n) of the beams from `start` to `stop` by the rotations (m, 3, 3)."""
    for i in range(start, stop):
        x, y, z, k = beams[0, i], beams[1, i], beams[2, i], moments[i]
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
def depart(start: int, n: int, moments: NDArray[np.int32], origins: Array, starts: Array) -> None:
    """Origins of the n beams from `start`, each at its moment."""
    for i in range(n):
        k = moments[start + i]
        starts[0, i], starts[1, i], starts[2, i] = origins[k, 0], origins[k, 1], origins[k, 2]


@kernel
def place_spots(
    n: int, g: int, positions: Array, rotations: Array, starts: Array, spots: Array
) -> None:
    """Origin of each of n beams in the frame of geom g, as `look` does it."""
    x, y, z = positions[g, 0], positions[g, 1], positions[g, 2]
    for axis in range(3):
        m0, m3, m6 = rotations[g, axis], rotations[g, 3 + axis], rotations[g, 6 + axis]
        for i in range(n):
            dx, dy, dz = starts[0, i] - x, starts[1, i] - y, starts[2, i] - z
            spots[axis, i] = m0 * dx + m3 * dy + m6 * dz


@kernel
def report(
    n: int, start: int, places: NDArray[np.int64], best: Array, best_geom: NDArray[np.int64],
    ids: NDArray[np.int32], distance: Array, geom_id: NDArray[np.int32],
) -> None:  # fmt: skip
    """Write a tile's hits where its beams have their places."""
    for i in range(n):
        if best_geom[i] < len(ids):
            distance[places[start + i]] = best[i]
            geom_id[places[start + i]] = ids[best_geom[i]]


@kernel
def cast_blocks(
    first: int,
    step: int,
    pattern: Pattern,
    geoms: Geoms,
    sweep: Sweep,
    room: Room,
    distance: Array,
    geom_id: NDArray[np.int32],
) -> None:
    """Cast the beams of every `step`-th block of a pattern from block `first` on.

    What is in the tables is taken out of them once: numba counts references at every taking, and
    passes whole tables by value, which for each tile would take as long as a geom.

    Args:
        first: Block.
        step: Blocks to the next one.
        pattern: Beams, tiles and blocks.
        geoms: Tables over g geoms.
        sweep: Poses, and views of the geoms.
        room: To write on, for this thread alone.
        distance: (n,) hits are written in the pattern's own order, m; misses are not.
        geom_id: (n,) likewise.
    """
    sensor_beams, places, tile_starts, _, block_starts, _, moments = pattern
    ids, kinds, sizes, axes, sides, _, positions, rotations = geoms
    origins, turns, R, beams, spread, limit, tile_cones, block_cones, order, views, local = sweep
    v, starts, spots, reach, best, bits, best_geom, walls, slack, near, rows, chosen = room
    rolling = len(origins) > 1
    within = int(np.searchsorted(views[0], limit, "right"))
    up = turns[0, :, 2].copy()
    for block in range(first, len(block_cones), step):
        if rolling:  # the sensor turns, so tiles and blocks change their shapes
            start, stop = tile_starts[block_starts[block]], tile_starts[block_starts[block + 1]]
            aim_rolling(start, stop, sensor_beams, moments, turns, beams)
            fit_cone(start, stop, beams, block, block_cones)
            for tile in range(block_starts[block], block_starts[block + 1]):
                fit_cone(tile_starts[tile], tile_starts[tile + 1], beams, tile, tile_cones)
        count = list_meeting(block_cones, block, within, views, slack, chosen)
        take_over(count, chosen, order, views, rows, near)
        for tile in range(block_starts[block], block_starts[block + 1]):
            start, n = tile_starts[tile], tile_starts[tile + 1] - tile_starts[tile]
            candidates = list_meeting(tile_cones, tile, count, near, slack, chosen)
            if candidates == 0:
                continue
            aim(start, n, beams, R, v)
            if rolling:
                depart(start, n, moments, origins, starts)
            forget(n, limit, len(ids), best, best_geom)
            if candidates > FEW:
                enclose(n, v, tile, tile_cones, up, walls)
            farthest = limit
            for i in range(candidates):
                g = rows[chosen[i]]
                if near[0, chosen[i]] > farthest:
                    break
                if candidates > FEW and not may_meet(
                    walls, farthest, g, rotations, axes, sides, local, spread
                ):
                    continue
                if rolling:
                    place_spots(n, g, positions, rotations, starts, spots)
                    reach_geom(n, kinds[g], g, sizes, rotations, local, spots, v, reach)
                else:
                    reach_geom(n, kinds[g], g, sizes, rotations, local, None, v, reach)
                farthest = keep_nearest(n, g, reach, best, bits, best_geom)
            report(n, start, places, best, best_geom, ids, distance, geom_id)


@kernel
def turn_cones(cones: Array, R: Array, turned: Array) -> None:
    """Cones (k, 5) of the sensor frame in the world."""
    for k in range(len(cones)):
        x, y, z = cones[k, 0], cones[k, 1], cones[k, 2]
        for axis in range(3):
            turned[k, axis] = x * R[axis, 0] + y * R[axis, 1] + z * R[axis, 2]
        turned[k, 3], turned[k, 4] = cones[k, 3], cones[k, 4]
