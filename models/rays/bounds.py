"""Bounds that rule geoms out for whole tiles: lower distances, cones and planes.

Bounds are wider than what they bound, so that rounding never rules out a hit.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from wayproof.kernel_compiler import kernel
from wayproof.models.arrays import Array, Vector3
from wayproof.models.rays.records import Geoms
from wayproof.models.rays.shapes import PLANE

MARGIN = 1e-9
"""Excess of bounds over what they bound, m."""

ANGLE_MARGIN = 1e-12
"""Excess of bounds of directions, in their cosines and slopes."""

MIN_WALLED_COSINE = 0.1
"""Minimum cosine of a cone's half angle for planes about its beams."""


@kernel
def view_geoms(origin: Array, spread: float, geoms: Geoms, local: Array, views: Array) -> None:
    """Compute each geom's lower distance and cone as seen from a ball of origins.

    Args:
        origin: (3,) centre of the ball in the world, m.
        spread: Radius of the ball, m.
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
def select_views(
    cones: Array, k: int, count: int, views: Array, slack: Array, chosen: NDArray[np.int64]
) -> int:
    """List those of the first `count` views that cone k touches, in order; return their number.

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
def fit_cone(start: int, stop: int, beams: Array, k: int, cones: Array) -> None:
    """Fit cone k about the mean direction of the beams from `start` to `stop`; see `fit_cones`."""
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
    """Fit cones about the mean directions of runs of beams.

    Args:
        beams: (3, n) unit directions.
        starts: (k + 1,) first beam of each run, and n.
        cones: (k, 5) is written: axis, cosine and sine of the half angle.
    """
    for k in range(len(cones)):
        fit_cone(starts[k], starts[k + 1], beams, k, cones)


@kernel
def turn_cones(cones: Array, R: Array, turned: Array) -> None:
    """Turn cones (k, 5) from the sensor frame to the world."""
    for k in range(len(cones)):
        x, y, z = cones[k, 0], cones[k, 1], cones[k, 2]
        for axis in range(3):
            turned[k, axis] = x * R[axis, 0] + y * R[axis, 1] + z * R[axis, 2]
        turned[k, 3], turned[k, 4] = cones[k, 3], cones[k, 4]


@kernel
def enclose(n: int, v: Array, tile: int, cones: Array, up: Array, walls: Array) -> None:
    """Compute five planes through the origin about the n beams of a tile.

    Args:
        n: Number of beams.
        v: (3, n or more) directions in the world.
        tile: Row of the tile in `cones`.
        cones: (t, 5) cones about the tiles' beams in the world.
        up: (3,) the sensor's z axis, which lies about in a plane with each column of its beams.
        walls: (5, 3) normals are written. Four point inwards: n . v >= 0 for each beam v. The
            last one is the cone's axis. Where beams are far apart they have no length, and so are
            no bound.
    """
    ax, ay, az = cones[tile, 0], cones[tile, 1], cones[tile, 2]
    ex, ey, ez = up[1] * az - up[2] * ay, up[2] * ax - up[0] * az, up[0] * ay - up[1] * ax
    length = math.sqrt(ex * ex + ey * ey + ez * ez)
    if (cones[tile, 3] < MIN_WALLED_COSINE) | (length < MIN_WALLED_COSINE):
        for wall in range(5):
            walls[wall, 0] = walls[wall, 1] = walls[wall, 2] = 0.0
        return
    # Tangents of the beams along e and f, axes across the cone's own, bound the tile.
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
    n: Vector3, g: int, rotations: Array, axes: Array, sides: Array, local: Array, spread: float
) -> float:
    """Return the greatest n . (x - o) over the points x of a geom and the origins o, m.

    It is the geom's support function: that of its ellipsoid plus that of its box.
    """
    nx, ny, nz = n
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
    """Return whether a geom is inside a tile's planes, and nearer than the tile's hits so far."""
    x, y, z = walls[4, 0], walls[4, 1], walls[4, 2]
    if farthest_along((-x, -y, -z), g, rotations, axes, sides, local, spread) < -farthest:
        return False
    for i in range(4):
        x, y, z = walls[i, 0], walls[i, 1], walls[i, 2]
        if farthest_along((x, y, z), g, rotations, axes, sides, local, spread) < 0.0:
            return False
    return True
