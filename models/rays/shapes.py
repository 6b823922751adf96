"""Distances along one ray to each primitive shape, in the geom's frame.

Each shape is a function without branches, so that a loop over rays becomes vector instructions.
Sums and quotients are those of MuJoCo 4.0's `mj_ray`, term by term: results agree with it to the
last digits. Throughout, `p` is the ray's origin, m, and `v` its direction, a unit vector; the
distance is in m and infinite for a miss.
"""

from __future__ import annotations

import math

from wayproof.kernel_compiler import kernel
from wayproof.models.arrays import Vector3

PLANE, SPHERE, CAPSULE, ELLIPSOID, CYLINDER, BOX = 0, 2, 3, 4, 5, 6
"""MuJoCo's `mjtGeom`."""

MIN_VALUE = 1e-15
"""MuJoCo's mjMINVAL: a component or a coefficient below it counts as 0."""


@kernel
def first_root(a: float, b: float, c: float) -> float:
    """Return the smallest root >= 0 of a x^2 + 2 b x + c, infinite without one."""
    determinant = b * b - a * c
    root = math.sqrt(determinant if determinant > 0.0 else 0.0)
    near = -b - root
    x = (near if near >= 0.0 else -b + root) / a
    return x if (determinant >= 0.0) & (a >= MIN_VALUE) & (x >= 0.0) else math.inf


@kernel
def plane(p: Vector3, v: Vector3, sx: float, sy: float) -> float:
    """Return the distance to the plane z = 0 from above; half sides of 0 are infinite."""
    px, py, pz = p
    vx, vy, vz = v
    x = -pz / vz
    inside = (sx <= 0.0) | (abs(px + x * vx) <= sx)
    inside &= (sy <= 0.0) | (abs(py + x * vy) <= sy)
    return x if (vz <= -MIN_VALUE) & (x >= 0.0) & inside else math.inf


@kernel
def sphere(p: Vector3, v: Vector3, radius: float) -> float:
    """Return the distance to a sphere about the origin."""
    px, py, pz = p
    vx, vy, vz = v
    a = vx * vx + vy * vy + vz * vz
    b = vx * px + vy * py + vz * pz
    c = px * px + py * py + pz * pz - radius * radius
    return first_root(a, b, c)


@kernel
def ellipsoid(p: Vector3, v: Vector3, inverse_squares: Vector3) -> float:
    """Return the distance to an ellipsoid, given the inverse squares of its half axes, 1/m^2."""
    px, py, pz = p
    vx, vy, vz = v
    ix, iy, iz = inverse_squares
    a = ix * vx * vx + iy * vy * vy + iz * vz * vz
    b = ix * vx * px + iy * vy * py + iz * vz * pz
    c = ix * px * px + iy * py * py + iz * pz * pz - 1.0
    return first_root(a, b, c)


@kernel
def capsule(p: Vector3, v: Vector3, radius: float, half: float) -> float:
    """Return the distance to a capsule about z.

    One of the two caps is enough: the one that the ray leads to through the side, or the one that
    it starts above.
    """
    px, py, pz = p
    vx, vy, vz = v
    around = px * px + py * py - radius * radius
    side = first_root(vx * vx + vy * vy, vx * px + vy * py, around)
    z = pz + side * vz
    past_end = max(abs(pz) - half, 0.0)
    inside = around + past_end * past_end < 0.0
    at_end = (past_end > 0.0) | ((around == 0.0) & (abs(pz) == half))  # or on its rim
    above_end = (around <= 0.0) & at_end & (not inside)
    # The origin in the frame of the chosen cap's centre.
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
def cylinder(p: Vector3, v: Vector3, radius: float, half: float) -> float:
    """Return the distance to a cylinder about z, its side or the disc that can be met first."""
    px, py, pz = p
    vx, vy, vz = v
    around = px * px + py * py - radius * radius
    side = first_root(vx * vx + vy * vy, vx * px + vy * py, around)
    side = side if abs(pz + side * vz) <= half else math.inf
    # From outside only the near disc can be entered, from inside only the one ahead be left.
    inside = (around <= 0.0) & (abs(pz) < half)  # on the side, a ray along it leaves by a disc
    disc = (math.copysign(half, vz if inside else pz) - pz) / vz
    qx = px + disc * vx
    qy = py + disc * vy
    met = (abs(vz) > MIN_VALUE) & (disc >= 0.0) & (qx * qx + qy * qy <= radius * radius)
    disc = disc if met else math.inf
    return side if side < disc else disc


@kernel
def face(p: Vector3, v: Vector3, s: Vector3, inside: bool) -> float:
    """Return the distance to the face of a box that a ray can enter, or leave, across axis 0.

    The other two axes give the face's own extent; `s` is the box's half sides in that order, m. A
    ray that starts on a face has met it at once; one that runs along it leaves by another.
    """
    leaves = inside & (abs(p[0]) < s[0])
    x = (math.copysign(s[0], v[0] if leaves else p[0]) - p[0]) / v[0]
    met = (abs(v[0]) > MIN_VALUE) & (x >= 0.0)
    met &= (abs(p[1] + x * v[1]) <= s[1]) & (abs(p[2] + x * v[2]) <= s[2])
    return x if met else math.inf


@kernel
def box(p: Vector3, v: Vector3, s: Vector3) -> float:
    """Return the distance to a box of half sides s, m."""
    px, py, pz = p
    vx, vy, vz = v
    sx, sy, sz = s
    inside = (abs(px) <= sx) & (abs(py) <= sy) & (abs(pz) <= sz)
    x = face(p, v, s, inside)
    y = face((py, pz, px), (vy, vz, vx), (sy, sz, sx), inside)
    z = face((pz, px, py), (vz, vx, vy), (sz, sx, sy), inside)
    x = x if x < y else y
    return x if x < z else z
