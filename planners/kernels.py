"""Kernels over a distance field: the cells along a segment, shortcuts, the nearest free cell.

A segment is walked in exact integers: its end points are rounded down to 1/65536 of a cell, which
never moves a point to another cell, and crossing times are compared by cross-multiplication. Cells
are half-open; where a segment passes exactly through an edge or corner shared by several cells it
touches them all (a supercover). Traversal after Amanatides and Woo, "A Fast Voxel Traversal
Algorithm for Ray Tracing", Eurographics 1987.

All kernels of the package that call each other live here: numba's cache does not see a change of a
callee in another file.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayproof.planners._jit import kernel

SUBCELL_BITS = 16
SUBCELLS = 1 << SUBCELL_BITS
# Rows of cells along y share a block where it is noted who looked: `BLOCK_ROWS` of the costmap's
# distance field.
BLOCK_BITS = 3
# Farther from the origin the products that compare crossing times could overflow 64 bits.
FARTHEST_CELL = 1 << 14
OUTSIDE = -1
TURN = 2.0 * math.pi
# A sweep is cut into steps in which no disc 1 m from the reference point bows out by 0.4 mm from
# the straight line that is checked: 1 - cos(0.05 / 2).
TURN_STEP = 0.05  # [rad]
# What a turn costs against length: a quadruped that turns at 1 rad/s loses 0.1 s of a walk at
# 1 m/s for each radian that it turns while it walks.
TURN_PRICE = 0.1  # [m/rad]
# What each turn on the spot costs more: there a path has a corner, which takes speed [m].
CORNER_PRICE = 0.2
LEAST_CORNER = 1e-3  # [rad]
# What motion off the heading costs more than motion along it: sideways twice, backwards thrice.
SIDEWAYS = 1.0
# So many edges of a path are looked at together, but none that is longer than this [m].
BOXES = (16, 4, 1)
LONGEST_BOX = 1.0
# Each shrinking halves a blend; after five the corner is taken as it is.
BLEND_SHRINKINGS = 5
# A blend has at least this many edges, so that its curvature can be read from its points.
LEAST_BLEND_EDGES = 8
# A shorter edge is what rounding leaves over, and its direction is noise [m].
LEAST_EDGE = 1e-6
# A long body goes back at a corner that turns by more than 135 degrees.
COSINE_BACK = -0.7
# A cost has to fall by more than its own rounding error before a path is changed [m].
LEAST_GAIN = 1e-9

Floats = NDArray[np.float64]
Point = tuple[float, float, float]
Pose = tuple[float, float, float, float]  # x, y, z [m] and heading [rad]
SubcellPoint = tuple[int, int, int]


class Grid(NamedTuple):
    """A distance field as the kernels see it."""

    field: NDArray[np.uint16]  # (nx, ny, nz) squared cell distances
    looked_at: NDArray[np.bool_]  # (blocks, nx) out: where any was read, in blocks along y
    origin: Floats  # (3,) low corner [m]
    resolution: float  # [m]
    cost_by_distance: Floats  # (t,) cost of a cell by its squared distance


class Discs(NamedTuple):
    """The discs or balls of a body along its x axis."""

    offsets: Floats  # (m,) of the centres [m]
    thresholds: NDArray[np.int64]  # (m,) largest forbidden squared cell distance of each


@kernel
def inside_value(
    field: NDArray[np.uint16], looked_at: NDArray[np.bool_], i: int, j: int, k: int
) -> int:
    """Field value of a cell of the grid; as an unsigned index none is taken for one from behind."""
    looked_at[np.uint64(j) >> np.uint64(BLOCK_BITS), np.uint64(i)] = True
    return int(field[np.uint64(i), np.uint64(j), np.uint64(k)])


@kernel
def squared_distance(grid: Grid, i: int, j: int, k: int) -> int:
    """Field value of a cell; beyond the grid ``OUTSIDE``, which is below every threshold."""
    nx, ny, nz = grid.field.shape
    if i < 0 or j < 0 or k < 0 or i >= nx or j >= ny or k >= nz:
        return OUTSIDE
    return inside_value(grid.field, grid.looked_at, i, j, k)


@kernel
def to_subcells(grid: Grid, point: Point) -> tuple[bool, SubcellPoint]:
    """Whether a point [m] is near enough for exact arithmetic, and its sub-cells rounded down."""
    x = (point[0] - grid.origin[0]) / grid.resolution
    y = (point[1] - grid.origin[1]) / grid.resolution
    z = (point[2] - grid.origin[2]) / grid.resolution
    if not (abs(x) < FARTHEST_CELL and abs(y) < FARTHEST_CELL and abs(z) < FARTHEST_CELL):
        return False, (0, 0, 0)  # also NaN
    return True, (
        math.floor(x * SUBCELLS),
        math.floor(y * SUBCELLS),
        math.floor(z * SUBCELLS),
    )


@kernel
def least_at_corners(grid: Grid, i: int, j: int, k: int, di: int, dj: int, dk: int) -> int:
    """Least field value of the cells that meet where a step crosses several faces, its ends apart.

    A cell beside a step along two axes is one of its ends, which does no harm.
    """
    least = squared_distance(grid, i + di, j, k)
    for corner in range(2, 7):
        along_i, along_j, along_k = corner & 1, (corner >> 1) & 1, corner >> 2
        cell = i + along_i * di, j + along_j * dj, k + along_k * dk
        least = min(least, squared_distance(grid, cell[0], cell[1], cell[2]))
    return least


@kernel
def axis_steps(start: int, end: int) -> tuple[int, int, int, int]:
    """One axis of a walk: faces to cross, direction, sub-cells to the first face, and in all."""
    faces = abs((end >> SUBCELL_BITS) - (start >> SUBCELL_BITS))
    into_cell = start & (SUBCELLS - 1)
    if end > start:
        return faces, 1, SUBCELLS - into_cell, end - start
    return faces, -1, into_cell, start - end


@kernel
def walk_anywhere(
    grid: Grid, threshold: int, start: SubcellPoint, end: SubcellPoint
) -> tuple[float, int, float]:
    """``walk`` also beyond the grid, and where a step crosses several faces at once."""
    i, j, k = start[0] >> SUBCELL_BITS, start[1] >> SUBCELL_BITS, start[2] >> SUBCELL_BITS
    # An axis crosses its next face at time next / span.
    faces_x, step_x, next_x, span_x = axis_steps(start[0], end[0])
    faces_y, step_y, next_y, span_y = axis_steps(start[1], end[1])
    faces_z, step_z, next_z, span_z = axis_steps(start[2], end[2])
    cost_by_distance = grid.cost_by_distance
    furthest = len(cost_by_distance) - 1
    value = squared_distance(grid, i, j, k)
    least, walked, cost = value, 0.0, 0.0
    if least <= threshold:
        return walked, least, cost
    while faces_x + faces_y + faces_z > 0:
        first, span = 1, 0  # the earliest crossing, at first / span: infinitely late so far
        if faces_x > 0:
            first, span = next_x, span_x
        if faces_y > 0 and next_y * span < first * span_y:
            first, span = next_y, span_y
        if faces_z > 0 and next_z * span < first * span_z:
            first, span = next_z, span_z
        cross_x = faces_x > 0 and next_x * span == first * span_x
        cross_y = faces_y > 0 and next_y * span == first * span_y
        cross_z = faces_z > 0 and next_z * span == first * span_z
        di, dj, dk = cross_x * step_x, cross_y * step_y, cross_z * step_z
        rate = cost_by_distance[np.uint64(min(value, furthest))]
        value = squared_distance(grid, i + di, j + dj, k + dk)
        least = min(least, value)
        if cross_x + cross_y + cross_z > 1:
            least = min(least, least_at_corners(grid, i, j, k, di, dj, dk))
        share = first / span
        if least <= threshold:
            share = max((first - 2) / span, 0.0)
            return share, least, cost + (share - walked) * rate
        cost += (share - walked) * rate
        walked = share
        i, j, k = i + di, j + dj, k + dk
        faces_x, next_x = faces_x - cross_x, next_x + cross_x * SUBCELLS
        faces_y, next_y = faces_y - cross_y, next_y + cross_y * SUBCELLS
        faces_z, next_z = faces_z - cross_z, next_z + cross_z * SUBCELLS
    return 1.0, least, cost + (1.0 - walked) * cost_by_distance[min(value, furthest)]


@kernel
def walk(
    grid: Grid, threshold: int, start: SubcellPoint, end: SubcellPoint
) -> tuple[float, int, float]:
    """Walk every cell that a segment touches, up to the first whose field is <= threshold.

    What is rare is left to ``walk_anywhere``, which takes twice the time.

    Returns:
        Share of the segment walked (two sub-cells short of the face that ended it; 1 if none did),
        the least field value met, and the cost integrated over that share.
    """
    i, j, k = start[0] >> SUBCELL_BITS, start[1] >> SUBCELL_BITS, start[2] >> SUBCELL_BITS
    u, v, w = end[0] >> SUBCELL_BITS, end[1] >> SUBCELL_BITS, end[2] >> SUBCELL_BITS
    value = squared_distance(grid, i, j, k)
    # Between two cells of the grid there are no others.
    if value == OUTSIDE or squared_distance(grid, u, v, w) == OUTSIDE:
        return walk_anywhere(grid, threshold, start, end)
    faces_x, step_x, next_x, span_x = axis_steps(start[0], end[0])
    faces_y, step_y, next_y, span_y = axis_steps(start[1], end[1])
    faces_z, step_z, next_z, span_z = axis_steps(start[2], end[2])
    # Below 0 where of two axes the first one's next face comes first.
    x_y, x_z = next_x * span_y - next_y * span_x, next_x * span_z - next_z * span_x
    y_z = next_y * span_z - next_z * span_y
    field, looked_at, cost_by_distance = grid.field, grid.looked_at, grid.cost_by_distance
    furthest = len(cost_by_distance) - 1
    least, walked, cost = value, 0.0, 0.0
    if least <= threshold:
        return walked, least, cost
    while faces_x + faces_y + faces_z > 0:
        rate = cost_by_distance[np.uint64(min(value, furthest))]
        if faces_x > 0 and (faces_y == 0 or x_y < 0) and (faces_z == 0 or x_z < 0):
            first, span = next_x, span_x
            i, faces_x, next_x = i + step_x, faces_x - 1, next_x + SUBCELLS
            x_y, x_z = x_y + span_y * SUBCELLS, x_z + span_z * SUBCELLS
        elif faces_y > 0 and (faces_x == 0 or x_y > 0) and (faces_z == 0 or y_z < 0):
            first, span = next_y, span_y
            j, faces_y, next_y = j + step_y, faces_y - 1, next_y + SUBCELLS
            x_y, y_z = x_y - span_x * SUBCELLS, y_z + span_z * SUBCELLS
        elif faces_z > 0 and (faces_x == 0 or x_z > 0) and (faces_y == 0 or y_z > 0):
            first, span = next_z, span_z
            k, faces_z, next_z = k + step_z, faces_z - 1, next_z + SUBCELLS
            x_z, y_z = x_z - span_x * SUBCELLS, y_z - span_y * SUBCELLS
        else:
            return walk_anywhere(grid, threshold, start, end)
        value = inside_value(field, looked_at, i, j, k)
        least = min(least, value)
        share = first / span
        if least <= threshold:
            # Before the last face too, if that is as near: rounding must not reach either.
            share = max((first - 2) / span, 0.0)
            return share, least, cost + (share - walked) * rate
        cost += (share - walked) * rate
        walked = share
    return 1.0, least, cost + (1.0 - walked) * cost_by_distance[min(value, furthest)]


@kernel
def walk_between(grid: Grid, threshold: int, a: Point, b: Point) -> tuple[float, int, float]:
    """``walk`` between two points [m]; an end out of reach blocks the whole segment."""
    near_a, start = to_subcells(grid, a)
    near_b, end = to_subcells(grid, b)
    if not (near_a and near_b):
        return 0.0, OUTSIDE, 0.0
    return walk(grid, threshold, start, end)


@kernel
def edge_free(grid: Grid, threshold: int, a: Point, b: Point) -> bool:
    """Whether every cell that the segment touches lies above the threshold."""
    _, least, _ = walk_between(grid, threshold, a, b)
    return bool(least > threshold)


@kernel
def distance(a: Point, b: Point) -> float:
    """Euclidean distance, summed in a fixed order."""
    x, y, z = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    return math.sqrt(x * x + y * y + z * z)


@kernel
def row(points: Floats, n: int) -> Point:
    """One point of an array."""
    return points[n, 0], points[n, 1], points[n, 2]


@kernel
def walk_path(grid: Grid, threshold: int, weight: float, path: Floats) -> tuple[float, int, float]:
    """Walk a polyline, shape (n, 3), up to its first cell whose field is <= threshold.

    Returns:
        Length walked [m], the least field value met, and the integral of 1 + weight * cost over
        that length [m].
    """
    _, least, _ = walk_between(grid, threshold, row(path, 0), row(path, 0))
    length, cost = 0.0, 0.0
    for n in range(len(path) - 1):
        if least <= threshold:
            break
        a, b = row(path, n), row(path, n + 1)
        share, value, inside = walk_between(grid, threshold, a, b)
        length += share * distance(a, b)
        cost += (share + weight * inside) * distance(a, b)
        least = min(least, value)
    return length, least, cost


@kernel
def edge_cost(grid: Grid, threshold: int, weight: float, a: Point, b: Point) -> float:
    """Integral of 1 + weight * cost along an edge [m]; infinite if the edge is not free."""
    _, least, inside = walk_between(grid, threshold, a, b)
    if least <= threshold:
        return math.inf
    return distance(a, b) * (1.0 + weight * inside)


@kernel
def prune(grid: Grid, threshold: int, weight: float, path: Floats) -> Floats:
    """Leave out each way point without which the path costs no more."""
    kept = path.copy()
    count = 1
    for n in range(1, len(path) - 1):
        before, here, after = row(kept, count - 1), row(path, n), row(path, n + 1)
        through = edge_cost(grid, threshold, weight, before, here)
        through += edge_cost(grid, threshold, weight, here, after)
        if edge_cost(grid, threshold, weight, before, after) > through + LEAST_GAIN:
            kept[count] = path[n]
            count += 1
    kept[count] = path[-1]
    return kept[: count + 1].copy()


@kernel
def fewest_corners(grid: Grid, threshold: int, weight: float, price: float, path: Floats) -> Floats:
    """The cheapest path through some of a path's way points, in order, shape (k, 3).

    The optimum by dynamic programming over all edges between two of them, each corner at a price.
    """
    count = len(path)
    least, before = np.full(count, np.inf), np.zeros(count, np.int64)
    least[0] = 0.0
    for n in range(1, count):
        here = row(path, n)
        for m in range(n - 1, -1, -1):
            known = least[m] + price
            if known + distance(row(path, m), here) + LEAST_GAIN >= least[n]:
                continue
            cost = known + edge_cost(grid, threshold, weight, row(path, m), here)
            if cost + LEAST_GAIN < least[n]:
                least[n], before[n] = cost, m
    kept = np.empty((count, 3))
    end, first = count - 1, count
    while True:
        first -= 1
        kept[first] = path[end]
        if end == 0:
            return kept[first:].copy()
        end = before[end]


@kernel
def path_length(path: Floats) -> float:
    """Length of a polyline, shape (n, 3) [m]."""
    length = 0.0
    for n in range(len(path) - 1):
        length += distance(row(path, n), row(path, n + 1))
    return length


@kernel
def between(a: Point, b: Point, share: float) -> Point:
    """The point at a share of an edge."""
    return (
        a[0] + share * (b[0] - a[0]),
        a[1] + share * (b[1] - a[1]),
        a[2] + share * (b[2] - a[2]),
    )


@kernel
def locate(points: Floats, arcs: Floats, count: int, arc: float) -> tuple[int, Point]:
    """Edge and point at an arc length [m] along the first ``count`` points."""
    for n in range(count - 1):
        if arc <= arcs[n + 1] and arcs[n + 1] > arcs[n]:
            share = (arc - arcs[n]) / (arcs[n + 1] - arcs[n])
            return n, between(row(points, n), row(points, n + 1), share)
    return count - 2, row(points, count - 1)


@kernel
def detour(
    grid: Grid,
    threshold: int,
    weight: float,
    ends: tuple[Point, Point, Point, Point],
    apex: Point,
    old: float,
    price: float,
) -> tuple[int, float, float, float, float]:
    """Try to lead from ``ends[1]`` to ``ends[2]`` straight, else over an apex.

    Args:
        grid: The distance field.
        threshold: A cell is forbidden at or below this squared distance.
        weight: Weight of the cell cost against length.
        ends: The point before the cut, its two ends, and the point after it [m].
        apex: Of the detour [m].
        old: What the way from the first to the last of the ends costs now, its corners with it [m].
        price: Of a corner [m].

    Returns:
        How many points the cheaper way has between the first and the last (0 if none is cheaper,
        2 or 3), and the costs of its edges [m].
    """
    outside, u, v, beyond = ends
    # No edge costs less than its length, so most attempts end before a cell is looked at.
    least = distance(outside, u) + distance(v, beyond) + LEAST_GAIN + 2.0 * price
    if least + distance(u, v) >= old:
        return 0, 0.0, 0.0, 0.0, 0.0
    straight = edge_cost(grid, threshold, weight, u, v)
    first, last = math.inf, math.inf
    if least + straight < old:
        first = edge_cost(grid, threshold, weight, outside, u)
        last = edge_cost(grid, threshold, weight, v, beyond)
        if first + straight + last + 2.0 * price < old - LEAST_GAIN:
            return 2, first, straight, last, 0.0
    least += price
    if least + distance(u, apex) + distance(apex, v) >= old:
        return 0, 0.0, 0.0, 0.0, 0.0
    to_apex = edge_cost(grid, threshold, weight, u, apex)
    if least + to_apex + distance(apex, v) >= old:
        return 0, 0.0, 0.0, 0.0, 0.0
    from_apex = edge_cost(grid, threshold, weight, apex, v)
    if least + to_apex + from_apex >= old:
        return 0, 0.0, 0.0, 0.0, 0.0
    if first == math.inf:
        first = edge_cost(grid, threshold, weight, outside, u)
        last = edge_cost(grid, threshold, weight, v, beyond)
    if first + to_apex + from_apex + last + 3.0 * price < old - LEAST_GAIN:
        return 3, first, to_apex, from_apex, last
    return 0, 0.0, 0.0, 0.0, 0.0


@kernel
def shortcut(
    grid: Grid, threshold: int, weight: float, price: float, path: Floats, draws: Floats
) -> Floats:
    """Lower a path's cost by replacing the part between two random points of it.

    Random shortcuts after Geraerts and Overmars, "Creating High-quality Paths for Motion
    Planning", IJRR 2007, judged by cost instead of length. Where the straight cut does not pay, a
    detour over the cut's middle moved by a random offset is tried, so that a path can also draw
    away from what it grazes. What is accepted is free and costs less.

    Args:
        grid: The distance field.
        threshold: A cell is forbidden at or below this squared distance.
        weight: Weight of the cell cost against length.
        price: What each corner costs more [m].
        path: Way points [m], shape (n, 3), n >= 2, free edge by edge.
        draws: Shape (m, 5): two places along the path in [0, 1) and the offset [m].

    Returns:
        Way points between the same ends, shape (k, 3).
    """
    room = len(path) + 3 * len(draws)
    points, arcs, costs = np.empty((room, 3)), np.empty(room), np.empty(room)
    points[: len(path)] = path
    count = len(path)
    for n in range(count - 1):
        costs[n] = edge_cost(grid, threshold, weight, row(points, n), row(points, n + 1))
    changed = True
    for draw in draws:
        if changed:
            arcs[0] = 0.0
            for n in range(count - 1):
                arcs[n + 1] = arcs[n] + distance(row(points, n), row(points, n + 1))
        length = arcs[count - 1]
        i, u = locate(points, arcs, count, min(draw[0], draw[1]) * length)
        j, v = locate(points, arcs, count, max(draw[0], draw[1]) * length)
        middle = between(u, v, 0.5)
        apex = (middle[0] + draw[2], middle[1] + draw[3], middle[2] + draw[4])
        ends = (row(points, i), u, v, row(points, j + 1))
        old = np.sum(costs[i : j + 1]) + price * (j - i)
        added, a, b, c, d = detour(grid, threshold, weight, ends, apex, old, price)
        changed = added > 0
        if changed:
            shift = i + 1 + added - (j + 1)
            last = count + shift
            points[j + 1 + shift : last] = points[j + 1 : count].copy()
            costs[j + 1 + shift : last - 1] = costs[j + 1 : count - 1].copy()
            points[i + 1] = u
            if added == 3:
                points[i + 2] = apex
            points[i + added] = v
            fresh = (a, b, c, d)
            for n in range(added + 1):
                costs[i + n] = fresh[n]
            count = last
    return fewest_corners(grid, threshold, weight, price, points[:count])


@kernel
def wrap(angle: float) -> float:
    """The same angle [rad] in [-pi, pi)."""
    return angle - TURN * math.floor(angle / TURN + 0.5)


@kernel
def heading_of(x: float, y: float) -> float:
    """atan2(y, x) [rad] to 1e-12, by additions, products, quotients and roots.

    Three half-angle steps, atan(t) = 2 atan(t / (1 + sqrt(1 + t^2))), bring the argument below
    0.1, where six terms of the series are enough.
    """
    if x == 0.0 and y == 0.0:
        return 0.0
    steep = abs(y) > abs(x)
    t = abs(x) / abs(y) if steep else abs(y) / abs(x)
    for _ in range(3):
        t = t / (1.0 + math.sqrt(1.0 + t * t))
    q = t * t
    series = 1.0 - q * (1 / 3 - q * (1 / 5 - q * (1 / 7 - q * (1 / 9 - q * (1 / 11)))))
    angle = 8.0 * t * series
    if steep:
        angle = 0.5 * math.pi - angle
    if x < 0.0:
        angle = math.pi - angle
    return -angle if y < 0.0 else angle


@kernel
def edge_headings(tangents: Floats, initial: float) -> Floats:
    """Heading of each edge [rad], shape (n,), without jumps by full turns.

    Args:
        tangents: Unit tangents, shape (n, 3).
        initial: Heading [rad] kept by leading edges that are too steep to have one.
    """
    headings = np.empty(len(tangents))
    heading = initial
    for n in range(len(tangents)):
        x, y, z = tangents[n]
        if x * x + y * y > 1e-4 * z * z:  # steeper than 89.4 degrees: no heading
            heading += wrap(heading_of(x, y) - heading)
        headings[n] = heading
    return headings


@kernel
def turn_after(targets: Floats, initial: float, largest_step: float) -> Floats:
    """Headings [rad] that run after their targets by at most a step at a time, shape (n + 1,)."""
    headings = np.empty(len(targets) + 1)
    headings[0] = initial
    for n in range(len(targets)):
        error = targets[n] - headings[n]
        headings[n + 1] = headings[n] + min(max(error, -largest_step), largest_step)
    return headings


@kernel
def direction(angle: float) -> tuple[float, float]:
    """Cosine and sine of an angle [rad] to 1e-14, by sums, products and a floor only.

    Series for a sixteenth of the angle, and four doublings: no maths library changes a bit.
    """
    small = wrap(angle) / 16.0
    q = small * small
    sine = small * (1.0 - q / 6.0 * (1.0 - q / 20.0 * (1.0 - q / 42.0 * (1.0 - q / 72.0))))
    cosine = 1.0 - q / 2.0 * (
        1.0 - q / 12.0 * (1.0 - q / 30.0 * (1.0 - q / 56.0 * (1.0 - q / 90.0)))
    )
    for _ in range(4):
        cosine, sine = cosine * cosine - sine * sine, 2.0 * sine * cosine
    return cosine, sine


@kernel
def pose_between(a: Pose, b: Pose, share: float) -> Pose:
    """The pose at a share of the way between two."""
    return (
        a[0] + share * (b[0] - a[0]),
        a[1] + share * (b[1] - a[1]),
        a[2] + share * (b[2] - a[2]),
        a[3] + share * wrap(b[3] - a[3]),
    )


@kernel
def pose_row(poses: Floats, n: int) -> Pose:
    """One pose of an array, shape (n, 4)."""
    return poses[n, 0], poses[n, 1], poses[n, 2], poses[n, 3]


@kernel
def step_cost(grid: Grid, discs: Discs, a: Pose, b: Pose) -> tuple[bool, float]:
    """Whether a body is free over a small step, each disc moving straight, and the mean cost."""
    cosine_a, sine_a = direction(a[3])
    cosine_b, sine_b = direction(b[3])
    cost = 0.0
    for n in range(len(discs.offsets)):
        offset, threshold = discs.offsets[n], discs.thresholds[n]
        start = (a[0] + offset * cosine_a, a[1] + offset * sine_a, a[2])
        end = (b[0] + offset * cosine_b, b[1] + offset * sine_b, b[2])
        _, least, inside = walk_between(grid, threshold, start, end)
        if least <= threshold:
            return False, math.inf
        cost += inside
    return True, cost / len(discs.offsets)


@kernel
def sweep_steps(a: Pose, b: Pose) -> int:
    """Steps of a sweep, in none of which the body turns by more than ``TURN_STEP``."""
    return max(math.ceil(abs(wrap(b[3] - a[3])) / TURN_STEP), 1)


@kernel
def all_above(value: int, threshold: int, squared: int) -> bool:
    """Whether no cell so near to one of this field value is at or below a threshold.

    From cell to cell a distance falls by no more than these are apart: the root of the value is to
    exceed those of the threshold and of the squared cells between them.
    """
    spare = value - threshold - squared
    return spare > 0 and spare * spare > 4 * threshold * squared


@kernel
def box_free(grid: Grid, threshold: int, low: Point, high: Point, reach: float) -> bool:
    """Whether all cells of a box, wider by a reach [m] and a cell to each side, are free.

    Then a body is free at any heading whose reference point moves in it. In height the box is wider
    only if it has one.
    """
    near, first = to_subcells(grid, (low[0] - reach, low[1] - reach, low[2]))
    also_near, last = to_subcells(grid, (high[0] + reach, high[1] + reach, high[2]))
    if not (near and also_near):
        return False
    rise = 1 if high[2] > low[2] else 0
    i, j, k = first[0] >> SUBCELL_BITS, first[1] >> SUBCELL_BITS, first[2] >> SUBCELL_BITS
    x, y, z = last[0] >> SUBCELL_BITS, last[1] >> SUBCELL_BITS, last[2] >> SUBCELL_BITS
    i, j, k, x, y, z = i - 1, j - 1, k - rise, x + 1, y + 1, z + rise
    nx, ny, nz = grid.field.shape
    if i < 0 or j < 0 or k < 0 or x >= nx or y >= ny or z >= nz:
        return False
    u, v, w = (i + x) >> 1, (j + y) >> 1, (k + z) >> 1
    du, dv, dw = x - u, y - v, z - w  # on the other side it is no farther to the corners
    middle = inside_value(grid.field, grid.looked_at, u, v, w)
    if all_above(middle, threshold, du * du + dv * dv + dw * dw):
        return True
    for u in range(i, x + 1):
        for v in range(j, y + 1):
            for w in range(k, z + 1):
                if inside_value(grid.field, grid.looked_at, u, v, w) <= threshold:
                    return False
    return True


@kernel
def any_heading_free(grid: Grid, discs: Discs, path: Floats, first: int, last: int) -> bool:
    """Whether a box about some points of a path is free for each disc at any heading."""
    x, y, z = row(path, first)
    low, high = (x, y, z), (x, y, z)
    for n in range(first + 1, last + 1):
        x, y, z = row(path, n)
        low = min(low[0], x), min(low[1], y), min(low[2], z)
        high = max(high[0], x), max(high[1], y), max(high[2], z)
    return body_box_free(grid, discs, low, high)


@kernel
def body_box_free(grid: Grid, discs: Discs, low: Point, high: Point) -> bool:
    """Whether a body is free at any heading while its reference point is in a box."""
    threshold, reach = 0, 0.0
    for n in range(len(discs.offsets)):
        threshold = max(threshold, discs.thresholds[n])
        reach = max(reach, abs(discs.offsets[n]))
    return box_free(grid, threshold, low, high, reach)


@kernel
def turns_freely(grid: Grid, discs: Discs, a: Pose, b: Pose) -> bool:
    """Whether a sweep is a turn on the spot that is seen to be free without a walk."""
    if a[0] != b[0] or a[1] != b[1] or a[2] != b[2]:
        return False
    return body_box_free(grid, discs, a[:3], a[:3])


@kernel
def sweep_free(grid: Grid, discs: Discs, a: Pose, b: Pose) -> bool:
    """Whether a body is free all the way between two poses, the end first."""
    count = sweep_steps(a, b)
    if count > 1 and distance(a[:3], b[:3]) <= LONGEST_BOX:
        low = min(a[0], b[0]), min(a[1], b[1]), min(a[2], b[2])
        high = max(a[0], b[0]), max(a[1], b[1]), max(a[2], b[2])
        if body_box_free(grid, discs, low, high):
            return True
    if not step_cost(grid, discs, b, b)[0]:
        return False
    for n in range(count):
        before, after = pose_between(a, b, n / count), pose_between(a, b, (n + 1) / count)
        if not step_cost(grid, discs, before, after)[0]:
            return False
    return True


@kernel
def poses_free(grid: Grid, discs: Discs, poses: Floats) -> bool:
    """Whether a body is free all the way through poses, shape (n, 4)."""
    for n in range(len(poses) - 1):
        if not sweep_free(grid, discs, pose_row(poses, n), pose_row(poses, n + 1)):
            return False
    return True


@kernel
def poses_free_length(grid: Grid, discs: Discs, poses: Floats) -> float:
    """Length [m] of the way through poses, shape (n, 4), before the step that is not free."""
    length = 0.0
    for edge in range(len(poses) - 1):
        a, b = pose_row(poses, edge), pose_row(poses, edge + 1)
        count = sweep_steps(a, b)
        for n in range(count):
            before, after = pose_between(a, b, n / count), pose_between(a, b, (n + 1) / count)
            if not step_cost(grid, discs, before, after)[0]:
                return length
            length += distance(before[:3], after[:3])
    return length


@kernel
def poses_free_count(grid: Grid, discs: Discs, poses: Floats) -> int:
    """How many of the poses, shape (n, 4), a body gets through one after the other."""
    if not step_cost(grid, discs, pose_row(poses, 0), pose_row(poses, 0))[0]:
        return 0
    for n in range(len(poses) - 1):
        if not sweep_free(grid, discs, pose_row(poses, n), pose_row(poses, n + 1)):
            return n + 1
    return len(poses)


@kernel
def free_up_to(grid: Grid, discs: Discs, path: Floats, first: int) -> int:
    """The point up to which a path's edges from another on are seen to be free at any heading."""
    for edges in BOXES:
        last = min(first + edges, len(path) - 1)
        if distance(row(path, first), row(path, last)) <= LONGEST_BOX and any_heading_free(
            grid, discs, path, first, last
        ):
            return last
    return first


@kernel
def headed_free_length(grid: Grid, discs: Discs, path: Floats) -> float:
    """Length [m] of a path, shape (n, 3), before the edge that a body cannot head along.

    It turns on the spot at each point: nose first, or where that is not free, tail first. Where a
    box about several edges is free they need no look of their own.
    """
    length, heading, begun, known = 0.0, 0.0, False, 0
    for n in range(len(path) - 1):
        a, b = row(path, n), row(path, n + 1)
        if a[0] == b[0] and a[1] == b[1]:
            continue
        ahead = heading_of(b[0] - a[0], b[1] - a[1])
        if n >= known:
            known = free_up_to(grid, discs, path, n)
        if n < known:
            heading, begun = ahead, True
            length += distance(a, b)
            continue
        here = (a[0], a[1], a[2], heading)
        chosen = False
        for way in range(2):
            facing = ahead + way * math.pi
            turned = (a[0], a[1], a[2], facing)
            if not chosen and (not begun or sweep_free(grid, discs, here, turned)):
                chosen = sweep_free(grid, discs, turned, (b[0], b[1], b[2], facing))
                if chosen:
                    heading, begun = facing, True
        if not chosen:
            return length
        length += distance(a, b)
    return length


@kernel
def all_free(grid: Grid, discs: Discs, oriented: bool, path: Floats) -> bool:
    """Whether a whole path, shape (n, 3), is free for one disc or a body that heads along it."""
    if oriented:
        return bool(headed_free_length(grid, discs, path) > path_length(path) - LEAST_EDGE)
    return bool(walk_path(grid, discs.thresholds[0], 0.0, path)[1] > discs.thresholds[0])


@kernel
def blended(
    grid: Grid,
    discs: Discs,
    oriented: bool,
    waypoints: Floats,
    tangents: Floats,
    reaches: Floats,
    spacing: float,
) -> Floats:
    """Way points joined by straight edges, each corner by its largest free blend, shape (m, 3).

    Args:
        grid: The distance field.
        discs: The body's.
        oriented: Whether it heads along the path.
        waypoints: Shape (n, 3) [m].
        tangents: Unit directions before and after each corner, shape (n - 2, 2, 3).
        reaches: Length that each blend may take of both edges [m], shape (n - 2,).
        spacing: Largest distance between points [m].
    """
    pieces = [waypoints[:1].copy()]
    last = row(waypoints, 0)
    for n in range(1, len(waypoints)):
        piece = waypoints[n : n + 1].copy()
        if n < len(waypoints) - 1:
            piece = blend(
                grid, discs, oriented, piece, tangents[n - 1], float(reaches[n - 1]), spacing
            )
        first = row(piece, 0)
        if distance(last, first) < LEAST_EDGE:
            pieces[-1] = pieces[-1][:-1].copy()  # one blend begins where the other ends
            pieces.append(piece)
        else:
            pieces.append(straight_edge(grid, discs, oriented, last, first, spacing))
            pieces.append(piece[1:].copy())
        last = row(piece, len(piece) - 1)
    count = 0
    for piece in pieces:
        count += len(piece)
    path = np.empty((count, 3))
    for piece in pieces[::-1]:
        path[count - len(piece) : count] = piece
        count -= len(piece)
    return path


@kernel
def blend(
    grid: Grid,
    discs: Discs,
    oriented: bool,
    corner: Floats,
    tangents: Floats,
    length: float,
    spacing: float,
) -> Floats:
    """Points of the largest free blend of a corner, shape (k, 3), or the corner itself (1, 3)."""
    before, at, after = row(tangents, 0), row(corner, 0), row(tangents, 1)
    cosine = before[0] * after[0] + before[1] * after[1] + before[2] * after[2]
    if length < LEAST_EDGE or (oriented and cosine < COSINE_BACK):  # there it stands
        return corner
    for _ in range(BLEND_SHRINKINGS):
        edges = max(math.ceil(2.0 * length / spacing), LEAST_BLEND_EDGES)
        points = np.empty((edges + 1, 3))
        for n in range(edges + 1):
            t = n * (1.0 / edges) if n < edges else 1.0
            for i in range(3):
                start, end = at[i] - length * before[i], at[i] + length * after[i]
                points[n, i] = (1.0 - t) * (1.0 - t) * start + 2.0 * t * (1.0 - t) * at[i]
                points[n, i] += t * t * end
        if all_free(grid, discs, oriented, points):
            return points
        length *= 0.5
    return corner


@kernel
def straight_edge(
    grid: Grid, discs: Discs, oriented: bool, a: Point, b: Point, spacing: float
) -> Floats:
    """Points after ``a`` up to ``b``, at most ``spacing`` apart, shape (k, 3)."""
    edges = max(math.ceil(distance(a, b) / spacing), 1)
    points = np.empty((edges + 1, 3))
    for n in range(edges + 1):
        t = n * (1.0 / edges)
        for i in range(3):
            points[n, i] = a[i] + t * (b[i] - a[i])
    points[0], points[edges] = a, b
    # Rounded points can touch a cell that the edge itself just misses.
    if all_free(grid, discs, oriented, points):
        return points[1:].copy()
    return points[edges:].copy()


@kernel
def free_headings(
    grid: Grid, discs: Discs, start: Pose, places: Floats, headings: Floats
) -> tuple[int, NDArray[np.bool_]]:
    """The first place that a sweep leads to, and at which headings it may end there.

    Args:
        grid: The distance field.
        discs: The body's.
        start: Of the sweeps.
        places: Shape (n, 2) [m].
        headings: Shape (m,) [rad].

    Returns:
        The place, and whether a heading is free nose first and tail first, shape (m, 2). Tail first
        is left out where the body would turn by more than a quarter.
    """
    free = np.zeros((len(headings), 2), np.bool_)
    for n in range(len(places)):
        for m in range(len(headings)):
            for gear in range(2):
                there = wrap(headings[m] + gear * math.pi)
                if gear == 1 and abs(wrap(there - start[3])) > 0.5 * math.pi + 1e-9:
                    continue  # nose first takes no longer
                pose = (places[n, 0], places[n, 1], start[2], there)
                free[m, gear] = sweep_free(grid, discs, start, pose)
        if free.any():
            return n, free
    return 0, free


@kernel
def nearest_pose(
    grid: Grid, discs: Discs, pose: Pose, radius: float, headings: Floats
) -> tuple[bool, Pose]:
    """Free pose at a cell's centre nearest to a place, at most ``radius`` cells away.

    Of poses equally near the lowest index wins, and of headings the first.
    """
    near, at = to_subcells(grid, pose[:3])
    if not near:
        return False, pose
    i, j = at[0] >> SUBCELL_BITS, at[1] >> SUBCELL_BITS
    reach = math.ceil(radius) + 1
    found, best, nearest = False, pose, radius * grid.resolution
    for ci in range(max(i - reach, 0), min(i + reach + 1, grid.field.shape[0])):
        for cj in range(max(j - reach, 0), min(j + reach + 1, grid.field.shape[1])):
            x = grid.origin[0] + (ci + 0.5) * grid.resolution
            y = grid.origin[1] + (cj + 0.5) * grid.resolution
            away = distance((x, y, 0.0), (pose[0], pose[1], 0.0))
            if away > nearest or (found and away == nearest):
                continue
            for heading in headings:
                there = (x, y, pose[2], heading)
                if step_cost(grid, discs, there, there)[0]:
                    found, best, nearest = True, there, away
                    break
    return found, best


@kernel
def sweep_cost(grid: Grid, discs: Discs, weight: float, a: Pose, b: Pose) -> float:
    """Cost of a sweep [m]; infinite if it is not free.

    Length costs 1 + weight * (mean cost of the discs' cells), and as much again for each
    ``SIDEWAYS`` that it is off the heading: sensors look ahead. A turn costs ``TURN_PRICE``, and
    on the spot ``CORNER_PRICE`` more.
    """
    x, y = b[0] - a[0], b[1] - a[1]
    level = math.sqrt(x * x + y * y)
    count = sweep_steps(a, b)
    share = distance(a[:3], b[:3]) / count
    cost = TURN_PRICE * abs(wrap(b[3] - a[3])) + corner_cost(a, b)
    if turns_freely(grid, discs, a, b):
        return cost  # what is near costs length
    for n in range(count):
        before, after = pose_between(a, b, n / count), pose_between(a, b, (n + 1) / count)
        free, near = step_cost(grid, discs, before, after)
        if not free:
            return math.inf
        off_heading = 0.0
        if level > 0.0:
            cosine, sine = direction(0.5 * (before[3] + after[3]))
            off_heading = SIDEWAYS * max(1.0 - (x * cosine + y * sine) / level, 0.0)
        cost += share * (1.0 + weight * near + off_heading)
    return cost


@kernel
def poses_cost(grid: Grid, discs: Discs, weight: float, poses: Floats) -> float:
    """Cost of the way through poses, shape (n, 4) [m]; infinite if it is not free."""
    if not step_cost(grid, discs, pose_row(poses, 0), pose_row(poses, 0))[0]:
        return math.inf
    cost = 0.0
    for n in range(len(poses) - 1):
        cost += sweep_cost(grid, discs, weight, pose_row(poses, n), pose_row(poses, n + 1))
    return cost


@kernel
def prune_poses(grid: Grid, discs: Discs, weight: float, poses: Floats) -> Floats:
    """Leave out each pose without which the way costs no more."""
    kept = poses.copy()
    count = 1
    for n in range(1, len(poses) - 1):
        before, here, after = pose_row(kept, count - 1), pose_row(poses, n), pose_row(poses, n + 1)
        through = sweep_cost(grid, discs, weight, before, here)
        through += sweep_cost(grid, discs, weight, here, after)
        if sweep_cost(grid, discs, weight, before, after) > through + LEAST_GAIN:
            kept[count] = poses[n]
            count += 1
    kept[count] = poses[-1]
    return kept[: count + 1].copy()


@kernel
def put_pose(poses: Floats, n: int, point: Point, heading: float) -> None:
    """Write one pose of an array."""
    poses[n, 0], poses[n, 1], poses[n, 2], poses[n, 3] = point[0], point[1], point[2], heading


@kernel
def head_along(u: Pose, apex: Point, v: Pose, bent: bool, fresh: Floats) -> int:
    """From ``u`` straight ahead to ``v``, or first to an apex, turning at each; tells how many."""
    turn = u[:3]
    if bent:
        turn = apex
        there = heading_of(apex[0] - u[0], apex[1] - u[1])
        put_pose(fresh, 2, u[:3], there)
        put_pose(fresh, 3, apex, there)
    count = 4 if bent else 2
    on = heading_of(v[0] - turn[0], v[1] - turn[1])
    put_pose(fresh, 1, u[:3], u[3])
    put_pose(fresh, count, turn, on)
    put_pose(fresh, count + 1, v[:3], on)
    put_pose(fresh, count + 2, v[:3], v[3])
    return count + 3


@kernel
def cheaper(grid: Grid, discs: Discs, weight: float, poses: Floats, than: float) -> bool:
    """Whether the way through poses costs less, judged by its length, turns and corners first."""
    cost, corners = LEAST_GAIN, 0.0
    edges = len(poses) - 1
    for n in range(edges):
        a, b = pose_row(poses, n), pose_row(poses, n + 1)
        cost += least_sweep_cost(a, b)
        corners += corner_cost(a, b)
    # Every other edge is a turn on the spot, which takes long to check; the outer two are parts of
    # edges that are free already.
    for kind in range(3):
        for n in range(edges):
            outer = n == 0 or n == edges - 1
            if kind != (2 if outer else n % 2):
                continue
            if cost >= than or cost + corners > than + LEAST_GAIN:
                return False
            a, b = pose_row(poses, n), pose_row(poses, n + 1)
            cost += sweep_cost(grid, discs, weight, a, b) - least_sweep_cost(a, b)
            corners -= corner_cost(a, b)
    return cost < than


@kernel
def corner_cost(a: Pose, b: Pose) -> float:
    """What a turn on the spot costs beside its angle [m]."""
    if a[0] != b[0] or a[1] != b[1] or a[2] != b[2]:
        return 0.0
    return CORNER_PRICE if abs(wrap(b[3] - a[3])) > LEAST_CORNER else 0.0


@kernel
def least_sweep_cost(a: Pose, b: Pose) -> float:
    """What a sweep costs at least [m]."""
    return distance(a[:3], b[:3]) + TURN_PRICE * abs(wrap(b[3] - a[3]))


@kernel
def shortcut_poses(grid: Grid, discs: Discs, weight: float, poses: Floats, draws: Floats) -> Floats:
    """``shortcut`` for a body with a heading: it turns, goes straight ahead, and turns again.

    Args:
        grid: The distance field.
        discs: The body's.
        weight: Weight of the cell cost against length.
        poses: Shape (n, 4), n >= 2, free pose by pose.
        draws: Shape (m, 5): two places along the path in [0, 1) and the offset [m].

    Returns:
        Poses between the same ends, shape (k, 4).
    """
    points = poses.copy()
    costs, arcs = sweep_costs(grid, discs, weight, points), pose_arcs(points)
    fresh = np.empty((8, 4))
    for draw in draws:
        i, u = pose_at(points, arcs, min(draw[0], draw[1]) * arcs[-1])
        j, v = pose_at(points, arcs, max(draw[0], draw[1]) * arcs[-1])
        middle = between(u[:3], v[:3], 0.5)
        apex = (middle[0] + draw[2], middle[1] + draw[3], middle[2] + draw[4])
        old = np.sum(costs[i : j + 1])
        fresh[0] = points[i]
        for bent in (False, True):
            end = head_along(u, apex, v, bent, fresh)
            fresh[end] = points[j + 1]
            if cheaper(grid, discs, weight, fresh[: end + 1], old):
                points = np.concatenate((points[: i + 1], fresh[1:end], points[j + 1 :]))
                inside = sweep_costs(grid, discs, weight, fresh[: end + 1])
                costs = np.concatenate((costs[:i], inside, costs[j + 1 :]))
                arcs = pose_arcs(points)
                break
    return prune_poses(grid, discs, weight, points)


@kernel
def sweep_costs(grid: Grid, discs: Discs, weight: float, poses: Floats) -> Floats:
    """Cost of each edge between poses [m], shape (n - 1,)."""
    costs = np.empty(len(poses) - 1)
    for n in range(len(costs)):
        costs[n] = sweep_cost(grid, discs, weight, pose_row(poses, n), pose_row(poses, n + 1))
    return costs


@kernel
def pose_arcs(poses: Floats) -> Floats:
    """Arc length at each pose [m], shape (n,)."""
    arcs = np.zeros(len(poses))
    for n in range(len(poses) - 1):
        arcs[n + 1] = arcs[n] + distance(pose_row(poses, n)[:3], pose_row(poses, n + 1)[:3])
    return arcs


@kernel
def pose_at(poses: Floats, arcs: Floats, arc: float) -> tuple[int, Pose]:
    """Edge and pose at an arc length [m] of the reference point's path."""
    for n in range(len(poses) - 1):
        if arc <= arcs[n + 1] and arcs[n + 1] > arcs[n]:
            share = (arc - arcs[n]) / (arcs[n + 1] - arcs[n])
            return n, pose_between(pose_row(poses, n), pose_row(poses, n + 1), share)
    return len(poses) - 2, pose_row(poses, len(poses) - 1)


@kernel
def nearest_free(
    grid: Grid, threshold: int, point: Point, radius: float
) -> tuple[bool, int, int, int]:
    """Free cell whose centre is nearest to a point, at most ``radius`` cells away.

    Distances are compared in exact sub-cells; of equal ones the lowest index wins.
    """
    near, at = to_subcells(grid, point)
    best, best_i, best_j, best_k = -1, 0, 0, 0
    if not near:
        return False, best_i, best_j, best_k
    nx, ny, nz = grid.field.shape
    reach = math.ceil(min(radius, float(FARTHEST_CELL))) + 1
    farthest = (radius * SUBCELLS) * (radius * SUBCELLS)
    i, j, k = at[0] >> SUBCELL_BITS, at[1] >> SUBCELL_BITS, at[2] >> SUBCELL_BITS
    half = SUBCELLS // 2
    for ci in range(max(i - reach, 0), min(i + reach + 1, nx)):
        x = ci * SUBCELLS + half - at[0]
        for cj in range(max(j - reach, 0), min(j + reach + 1, ny)):
            y = cj * SUBCELLS + half - at[1]
            for ck in range(max(k - reach, 0), min(k + reach + 1, nz)):
                z = ck * SUBCELLS + half - at[2]
                squared = x * x + y * y + z * z
                if squared > farthest or (best >= 0 and squared >= best):
                    continue
                if squared_distance(grid, ci, cj, ck) > threshold:
                    best, best_i, best_j, best_k = squared, ci, cj, ck
    return best >= 0, best_i, best_j, best_k
