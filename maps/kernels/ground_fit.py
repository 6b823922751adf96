"""Kernels that fit a plane to the returns of a floor, and level a sweep by it.

A plane is five numbers, (5,): height at the anchor, m; slope along x and along y, m/m; the anchor's
x and y, m, world. Sums go over the beams in their order, so that a repeat has the same bits.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wayproof.kernel_compiler import allocating, kernel

DROPPED_MM = 0
NO_RETURN_MM = 65535

FARTHEST = 8.0
"""Horizontal distance up to which returns are fitted, m: farther ones meet the floor at less than
a tenth of a radian from the heights of usual sensors."""

TILT = 0.06
"""Steepest plane that is fitted, rad: an error of a sensor's mounting, not a ramp."""

HEIGHT = 0.15
"""Highest plane that is looked for, m at the sensor."""

BANDS = np.array([0.3, 0.15, 0.1, 0.075, 0.05, 0.0375, 0.0375, 0.0375])
"""Half widths of the bands around the plane that the rounds of the fit take returns from, m; never
below three deviations of the round before."""

NARROW_BANDS = np.array([0.075, 0.06, 0.05, 0.0375, 0.0375, 0.0375])
"""Half widths of the bands of a fit from z = 0, m: a floor up to 7.5 cm off is found."""

ABOVE, ASYMMETRIC = 0.1, 3
"""Weight of returns above the plane in the three rounds after the first: asymmetric least squares
(Newey and Powell 1987), by which it settles on the floor where pallets cover half of that."""

AT_ZERO, JUST_BELOW, DEEPER = 0.25, 0.02, 0.05
"""A floor is as expected where a quarter of the returns near it are at z = 0, and up to 5 cm below
there are fewer than a fiftieth of these; deeper is a pit. Of 112 sweeps among shelves, desks and
crates all were found so, and none with noise of 1 cm or a tilt of a degree."""

TOLERANCE = 4.0
"""Deviations by which a return of the floor may be off it: one of 16,000 is off by more."""

BENEATH = 6.0
"""Deviations by which one may be below it: one of 10^9 is by more. A ghost above the floor goes as
later beams pass through it; a hole below the floor stays, as none reaches it again."""

SIGNIFICANT = 4.0
"""Deviations of its mean by which a tile is above the floor for no chance."""

HOLE_BEAMS = 20
"""Fewest silent beams, and none that came back, by which floor is missing: of 20 that each lose 6
of 10 echoes, all are lost once in 27,000 times."""

ANSWERED = -1


@kernel
def returns_near_floor(
    origins: NDArray[np.float64],  # (m, 3) m, world; the last is the sensor's place
    moments: NDArray[np.int32],  # (n,) origin of each beam
    directions: NDArray[np.float64],  # (n, 3) unit vectors
    ranges_mm: NDArray[np.uint16] | NDArray[np.uint32],  # (n,)
    stride: int,  # of the beams, one is taken
    near: NDArray[np.float64],  # (n // stride + 1, 3) out: m from below the sensor, and height
) -> int:
    """List the returns near z = 0 and the sensor; return their number."""
    count = 0
    x0, y0 = origins[-1, 0], origins[-1, 1]
    for i in range(0, ranges_mm.shape[0], stride):
        if ranges_mm[i] == DROPPED_MM or ranges_mm[i] == NO_RETURN_MM:
            continue
        k, r = moments[i], ranges_mm[i] * 1e-3
        z = origins[k, 2] + r * directions[i, 2]
        x, y = origins[k, 0] + r * directions[i, 0] - x0, origins[k, 1] + r * directions[i, 1] - y0
        squared = x * x + y * y
        if squared <= FARTHEST * FARTHEST and abs(z) <= BANDS[0] + TILT * np.sqrt(squared):
            near[count, 0], near[count, 1], near[count, 2] = x, y, z
            count += 1
    return count


@kernel
def count_at_zero(
    near: NDArray[np.float64],  # (n, 3) x and y from below the sensor, and height, m
    quiet: float,  # m
) -> int:
    """Count the returns within `quiet` of z = 0; 0 if the floor is not as expected by them."""
    at_zero = just_below = int(np.int64(0))
    for i in range(near.shape[0]):
        z = near[i, 2]
        if abs(z) <= quiet:
            at_zero += 1
        elif -DEEPER < z < 0.0:
            just_below += 1
    expected = at_zero >= AT_ZERO * near.shape[0] and just_below <= JUST_BELOW * at_zero
    return at_zero if expected else 0


@kernel
def fit_plane(
    near: NDArray[np.float64],  # (n, 3) x and y from below the sensor, and height, m
    sensor: tuple[float, float, float],  # m, world
    bands: NDArray[np.float64],  # half widths of the rounds, m
    tilt: float,  # by which the first is wider at each metre from the sensor
    plane: NDArray[np.float64],  # (5,) out
    figures: NDArray[np.float64],  # (3,) out, m: deviation of the floor; least deviation of x and
    # y; error of the ranges that gives such a deviation
) -> int:
    """Fit a plane to points by least squares, trimmed in rounds to those near the last plane.

    The deviation is that of the points below the plane: above there are things on the floor, whose
    foot would widen the band until the plane lies half way up to them.

    Returns:
        Number of points of the last round; 0 if they hold no plane.
    """
    plane[:] = 0.0
    plane[3], plane[4] = sensor[0], sensor[1]
    figures[:] = 0.0
    count = int(np.int64(0))
    for k in range(bands.shape[0]):
        band, count = max(bands[k], 3.0 * figures[0]), 0
        n = sx = sy = sz = xx = xy = yy = xz = yz = 0.0
        for i in range(near.shape[0]):
            x, y, z = near[i]
            wide = band + (tilt * np.sqrt(x * x + y * y) if k == 0 else 0.0)
            off = z - (plane[0] + plane[1] * x + plane[2] * y)
            if abs(off) > wide:
                continue
            w = ABOVE if off > 0.0 and 0 < k <= ASYMMETRIC else 1.0
            n += w
            count += 1
            sx, sy, sz = sx + w * x, sy + w * y, sz + w * z
            xx, xy, yy = xx + w * x * x, xy + w * x * y, yy + w * y * y
            xz, yz = xz + w * x * z, yz + w * y * z
        if count < 3:
            return 0
        mx, my, mz = sx / n, sy / n, sz / n
        a, b, c = xx / n - mx * mx, xy / n - mx * my, yy / n - my * my
        determinant = a * c - b * b
        least = 0.5 * (a + c) - np.sqrt(0.25 * (a - c) * (a - c) + b * b)
        if not (least > 0.0 and determinant > 0.0):
            return 0
        u, v = xz / n - mx * mz, yz / n - my * mz
        plane[1], plane[2] = (c * u - b * v) / determinant, (a * v - b * u) / determinant
        plane[0] = mz - plane[1] * mx - plane[2] * my
        rest = shares = under = 0.0
        for i in range(near.shape[0]):
            x, y, z = near[i]
            off = z - (plane[0] + plane[1] * x + plane[2] * y)
            if -band <= off <= 0.0:
                below = sensor[2] - z
                under += 1.0
                rest += off * off
                shares += below * below / (x * x + y * y + below * below)
        figures[0], figures[1] = np.sqrt(rest / under) if under > 0.0 else 0.0, np.sqrt(least)
        figures[2] = np.sqrt(rest / shares) if shares > 0.0 else 0.0
    return count


@kernel
def tile_of(x: float, y: float, centre: tuple[float, float], edge: float, size: int) -> int:
    """Return the index of the tile of a point, row by row; -1 outside `size` x `size` tiles."""
    i = int(np.floor((x - centre[0]) / edge)) + size // 2
    j = int(np.floor((y - centre[1]) / edge)) + size // 2
    return i * size + j if 0 <= i < size and 0 <= j < size else -1


@kernel
def tilt_back(
    origins: NDArray[np.float64],  # (m, 3) m, world
    moments: NDArray[np.int32],  # (n,) origin of each beam
    directions: NDArray[np.float64],  # (n, 3) unit vectors
    ranges_mm: NDArray[np.uint16] | NDArray[np.uint32],  # (n,)
    plane: NDArray[np.float64],  # (5,)
    level_origins: NDArray[np.float64],  # (m, 3) out
    ends: NDArray[np.float64],  # (n, 3) out: returns from their origin, m; else a direction
) -> None:
    """Shear a sweep along z so that the plane is z = 0."""
    height, along_x, along_y, anchor_x, anchor_y = plane
    for k in range(origins.shape[0]):
        lever = along_x * (origins[k, 0] - anchor_x) + along_y * (origins[k, 1] - anchor_y)
        level_origins[k, 0], level_origins[k, 1] = origins[k, 0], origins[k, 1]
        level_origins[k, 2] = origins[k, 2] - height - lever
    for i in range(ranges_mm.shape[0]):
        returned = ranges_mm[i] != DROPPED_MM and ranges_mm[i] != NO_RETURN_MM
        r = ranges_mm[i] * 1e-3 if returned else 1.0
        dx, dy, dz = directions[i, 0], directions[i, 1], directions[i, 2]
        ends[i, 0], ends[i, 1] = r * dx, r * dy
        ends[i, 2] = r * (dz - along_x * dx - along_y * dy)


@allocating
def put_on_floor(
    origins: NDArray[np.float64],  # (m, 3) m, the plane at z = 0
    moments: NDArray[np.int32],  # (n,)
    ranges_mm: NDArray[np.uint16] | NDArray[np.uint32],  # (n,)
    deviations: tuple[float, float, float],  # of a range, of the rest, greatest tolerance, m
    tiling: tuple[float, int],  # edge of a tile, m, and tiles along an axis
    ends: NDArray[np.float64],  # (n, 3) in, out, m from the origins
    on_floor: NDArray[np.bool_],  # (n,) out
) -> None:
    """Put returns near z = 0 on it, but in tiles whose mean is off it by more than chance.

    What is above is gathered where it is; what is below, where its beam met z = 0, as beams that
    noise makes longer leave a tile at the edge of what the sensor sees, and none come in.
    """
    edge, size = tiling
    along, rest, most = deviations
    centre = origins[0, 0], origins[0, 1]
    above, below = np.zeros((3, size * size)), np.zeros((3, size * size))  # sums, squares, counts
    tiles, crossed = np.full((2, ranges_mm.shape[0]), -1)
    for i in range(ranges_mm.shape[0]):
        x, y, z = origins[moments[i]]
        on_floor[i] = False
        if ranges_mm[i] == DROPPED_MM or ranges_mm[i] == NO_RETURN_MM:
            continue
        height = z + ends[i, 2]
        share = abs(ends[i, 2]) / max(ranges_mm[i] * 1e-3, 1e-3)  # of the range's error in height
        deviation = np.sqrt(along * along * share * share + rest * rest)
        limit = min(TOLERANCE * deviation, most)
        if height < 0.0:
            limit = BENEATH * deviation
        if not abs(height) <= limit:
            continue
        on_floor[i] = True
        tiles[i] = tile_of(x + ends[i, 0], y + ends[i, 1], centre, edge, size)
        add_to_tile(above, tiles[i], height, deviation)
        if z > 0.0 > ends[i, 2]:
            part = -z / ends[i, 2]
            crossed[i] = tile_of(x + part * ends[i, 0], y + part * ends[i, 1], centre, edge, size)
            add_to_tile(below, crossed[i], height, deviation)
    for i in range(ranges_mm.shape[0]):
        if not on_floor[i]:
            continue
        height = origins[moments[i], 2] + ends[i, 2]
        if (height > 0.0 and tiles[i] >= 0 and is_off(above, tiles[i], 1.0, SIGNIFICANT, rest)) or (
            height < 0.0 and crossed[i] >= 0 and is_off(below, crossed[i], -1.0, BENEATH, rest)
        ):
            on_floor[i] = False
        else:
            ends[i, 2] = -origins[moments[i], 2]


@kernel
def add_to_tile(
    tiles: NDArray[np.float64],  # (3, tiles) in, out: sums of heights, of variances; counts
    tile: int,  # -1: none
    height: float,  # m
    deviation: float,  # of the height, m
) -> None:
    """Add a return to the sums of its tile."""
    if tile >= 0:
        tiles[0, tile] += height
        tiles[1, tile] += deviation * deviation
        tiles[2, tile] += 1.0


@kernel
def is_off(
    tiles: NDArray[np.float64],  # (3, tiles) sums of heights, m, and of variances, m2; counts
    tile: int,
    side: float,  # 1: above, -1: below
    significant: float,  # deviations of the mean
    rest: float,  # m
) -> bool:
    """Return whether the mean height of a tile is off z = 0 by more than chance."""
    n = tiles[2, tile]
    return bool(side * tiles[0, tile] / n > significant * np.sqrt(tiles[1, tile]) / n + rest)


@kernel
def beams_of(
    ends: NDArray[np.float64],  # (n, 3) m from the origins
    ranges_mm: NDArray[np.uint16] | NDArray[np.uint32],  # (n,)
    directions: NDArray[np.float64],  # (n, 3) out: unit vectors
    new_mm: NDArray[np.uint16] | NDArray[np.uint32],  # (n,) out
) -> None:
    """Make beams of ends again; those without a return keep their report."""
    for i in range(ranges_mm.shape[0]):
        x, y, z = ends[i, 0], ends[i, 1], ends[i, 2]
        length = np.sqrt(x * x + y * y + z * z)
        new_mm[i] = ranges_mm[i]
        if ranges_mm[i] != DROPPED_MM and ranges_mm[i] != NO_RETURN_MM:
            mm = int(np.rint(length * 1e3))
            if mm != DROPPED_MM and mm < NO_RETURN_MM:
                new_mm[i] = mm
        directions[i, 0], directions[i, 1], directions[i, 2] = x / length, y / length, z / length


@kernel
def silent_about(silent: NDArray[np.int64], i: int, j: int) -> int:
    """Count the silent beams of a tile and those beside it; `ANSWERED` if any came back there."""
    total = int(np.int64(0))
    for p in range(max(i - 1, 0), min(i + 2, silent.shape[0])):
        for q in range(max(j - 1, 0), min(j + 2, silent.shape[1])):
            if silent[p, q] < 0:
                return ANSWERED
            total += silent[p, q]
    return total


@allocating
def find_lost(
    origins: NDArray[np.float64],  # (m, 3) m, the plane at z = 0
    moments: NDArray[np.int32],  # (n,)
    directions: NDArray[np.float64],  # (n, 3)
    range_m: float,  # of the sensor
    centre: tuple[float, float],  # least corner of the middle tile, m
    edge: float,  # of a tile, m
    within: float,  # beyond the floor, in which a return is one of what lies there, m
    least_sweeps: int,  # in which floor is silent, in a row, where it is missing
    ranges_mm: NDArray[np.uint16] | NDArray[np.uint32],  # (n,)
    silent_sweeps: NDArray[np.uint8],  # (tiles, tiles) in, out; up to `least_sweeps`
    lost: NDArray[np.bool_],  # (n,) out
) -> None:
    """Find the beams without return that head for floor z = 0 and are no evidence of a hole.

    Of those that head for a hole none comes back, from the floor or from what stands before it, and
    they are many. Where floor is missing, that is so in one sweep after the other.
    """
    size = silent_sweeps.shape[0]
    silent = np.zeros((size, size), np.int64)  # beams; ANSWERED where one came back
    tiles = np.empty(ranges_mm.shape[0], np.int64)
    for i in range(ranges_mm.shape[0]):
        tiles[i] = -1
        k = moments[i]
        if ranges_mm[i] == DROPPED_MM or directions[i, 2] >= 0.0 or origins[k, 2] <= 0.0:
            continue
        r = -origins[k, 2] / directions[i, 2]
        if r > range_m:
            continue
        x, y = origins[k, 0] + r * directions[i, 0], origins[k, 1] + r * directions[i, 1]
        tile = tile_of(x, y, centre, edge, size)
        tiles[i] = tile
        if tile < 0:
            continue
        p, q = tile // size, tile % size
        if ranges_mm[i] != NO_RETURN_MM:
            if ranges_mm[i] * 1e-3 <= r + within:
                silent[p, q] = ANSWERED
        elif silent[p, q] != ANSWERED:
            silent[p, q] += 1
    for p in range(size):
        for q in range(size):
            if silent[p, q] == 0:
                continue  # no beam went there
            about = silent_about(silent, p, q)
            if about < 0:
                silent_sweeps[p, q] = 0
            elif about >= HOLE_BEAMS:
                silent_sweeps[p, q] = min(silent_sweeps[p, q] + 1, least_sweeps)
    for i in range(ranges_mm.shape[0]):
        lost[i] = False
        if ranges_mm[i] == NO_RETURN_MM and tiles[i] >= 0:
            lost[i] = silent_sweeps[tiles[i] // size, tiles[i] % size] < least_sweeps
