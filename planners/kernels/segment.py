"""Exact traversal of the cells along a segment, and costs integrated over them.

A segment is walked in integers: its end points are rounded down to 1/65536 of a cell, which never
moves a point to another cell, and crossing times are compared by cross-multiplication. Cells are
half-open; where a segment passes exactly through an edge or corner shared by several cells it
touches them all (a supercover). Traversal after Amanatides and Woo, "A Fast Voxel Traversal
Algorithm for Ray Tracing", Eurographics 1987.
"""

from __future__ import annotations

import math

from wayproof.kernel_compiler import kernel
from wayproof.planners.kernels.grid import (
    FARTHEST_CELL,
    OUTSIDE,
    SUBCELL_BITS,
    SUBCELLS,
    Cell,
    Floats,
    Grid,
    Point,
    SubcellPoint,
    cost_of,
    inside_value,
    squared_distance,
    to_subcells,
)
from wayproof.planners.kernels.polyline import distance, row

Walked = tuple[float, int, float, Cell]
"""Share of a segment or length of a path that was walked, the least squared distance met, the cost
integrated over it, and the cell where it ended."""


@kernel
def walk(grid: Grid, threshold: int, start: SubcellPoint, end: SubcellPoint) -> Walked:
    """Walk the cells that a segment touches up to the first whose squared distance is <= threshold.

    The common case, inside the grid and through one face at a time; `walk_anywhere` does the rest
    in twice the time.

    Returns:
        Share of the segment walked (two sub-cells short of the face that ended it; 1 if none did),
        the least squared distance met, the cost integrated over that share, and the last cell.
    """
    i, j, k = start[0] >> SUBCELL_BITS, start[1] >> SUBCELL_BITS, start[2] >> SUBCELL_BITS
    u, v, w = end[0] >> SUBCELL_BITS, end[1] >> SUBCELL_BITS, end[2] >> SUBCELL_BITS
    value = squared_distance(grid, i, j, k)
    # Between two cells inside the grid all cells are inside it.
    if value == OUTSIDE or squared_distance(grid, u, v, w) == OUTSIDE:
        return walk_anywhere(grid, threshold, start, end)
    faces_x, step_x, next_x, span_x = axis_steps(start[0], end[0])
    faces_y, step_y, next_y, span_y = axis_steps(start[1], end[1])
    faces_z, step_z, next_z, span_z = axis_steps(start[2], end[2])
    # An axis crosses its next face at time next / span. Of a pair of axes the first crosses
    # earlier where the difference of the cross products is below 0.
    x_y, x_z = next_x * span_y - next_y * span_x, next_x * span_z - next_z * span_x
    y_z = next_y * span_z - next_z * span_y
    field = grid.field
    least, walked, cost = value, 0.0, 0.0
    if least <= threshold:
        return walked, least, cost, (i, j, k)
    while faces_x + faces_y + faces_z > 0:
        rate = cost_of(grid, value, i, j, k)
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
        value = inside_value(field, i, j, k)
        least = min(least, value)
        share = first / span
        if least <= threshold:
            # Before the last face too, if that is as near: rounding must not reach either.
            share = max((first - 2) / span, 0.0)
            return share, least, cost + (share - walked) * rate, (i, j, k)
        cost += (share - walked) * rate
        walked = share
    return 1.0, least, cost + (1.0 - walked) * cost_of(grid, value, i, j, k), (i, j, k)


@kernel
def walk_anywhere(grid: Grid, threshold: int, start: SubcellPoint, end: SubcellPoint) -> Walked:
    """Go as `walk`, beyond the grid, too, and where a step crosses several faces at once."""
    i, j, k = start[0] >> SUBCELL_BITS, start[1] >> SUBCELL_BITS, start[2] >> SUBCELL_BITS
    # An axis crosses its next face at time next / span.
    faces_x, step_x, next_x, span_x = axis_steps(start[0], end[0])
    faces_y, step_y, next_y, span_y = axis_steps(start[1], end[1])
    faces_z, step_z, next_z, span_z = axis_steps(start[2], end[2])
    value = squared_distance(grid, i, j, k)
    least, walked, cost = value, 0.0, 0.0
    if least <= threshold:
        return walked, least, cost, (i, j, k)
    while faces_x + faces_y + faces_z > 0:
        # The earliest crossing of all axes, at first / span: infinitely late so far.
        first, span = 1, 0
        if faces_x > 0:
            first, span = next_x, span_x
        if faces_y > 0 and next_y * span < first * span_y:
            first, span = next_y, span_y
        if faces_z > 0 and next_z * span < first * span_z:
            first, span = next_z, span_z
        # All axes that cross a face then step together: through an edge or a corner.
        cross_x = faces_x > 0 and next_x * span == first * span_x
        cross_y = faces_y > 0 and next_y * span == first * span_y
        cross_z = faces_z > 0 and next_z * span == first * span_z
        di, dj, dk = cross_x * step_x, cross_y * step_y, cross_z * step_z
        rate = cost_of(grid, value, i, j, k)
        value, cell = squared_distance(grid, i + di, j + dj, k + dk), (i + di, j + dj, k + dk)
        least = min(least, value)
        if cross_x + cross_y + cross_z > 1:
            beside, corner = least_at_corners(grid, threshold, (i, j, k), (di, dj, dk))
            least, cell = min(least, beside), corner if value > threshold else cell
        share = first / span
        if least <= threshold:
            share = max((first - 2) / span, 0.0)
            return share, least, cost + (share - walked) * rate, cell
        cost += (share - walked) * rate
        walked = share
        i, j, k = i + di, j + dj, k + dk
        faces_x, next_x = faces_x - cross_x, next_x + cross_x * SUBCELLS
        faces_y, next_y = faces_y - cross_y, next_y + cross_y * SUBCELLS
        faces_z, next_z = faces_z - cross_z, next_z + cross_z * SUBCELLS
    return 1.0, least, cost + (1.0 - walked) * cost_of(grid, value, i, j, k), (i, j, k)


@kernel
def axis_steps(start: int, end: int) -> tuple[int, int, int, int]:
    """Return faces to cross along an axis, direction, sub-cells to the first face, and in all."""
    faces = abs((end >> SUBCELL_BITS) - (start >> SUBCELL_BITS))
    into_cell = start & (SUBCELLS - 1)
    if end > start:
        return faces, 1, SUBCELLS - into_cell, end - start
    return faces, -1, into_cell, start - end


@kernel
def least_at_corners(grid: Grid, threshold: int, cell: Cell, step: Cell) -> tuple[int, Cell]:
    """Return the least squared distance of the cells that meet where a step crosses an edge.

    The cells beside the step, and the last of them at or below the threshold, if any is; for a step
    along two axes its ends are among them.
    """
    (i, j, k), (di, dj, dk) = cell, step
    least, found = squared_distance(grid, i + di, j, k), (i + di, j, k)
    for corner in range(2, 7):
        along_i, along_j, along_k = corner & 1, (corner >> 1) & 1, corner >> 2
        beside = i + along_i * di, j + along_j * dj, k + along_k * dk
        value = squared_distance(grid, beside[0], beside[1], beside[2])
        least, found = min(least, value), beside if value <= threshold else found
    return least, found


@kernel
def walk_between(grid: Grid, threshold: int, a: Point, b: Point) -> Walked:
    """Go as `walk` between two points, m; an end too far from the grid blocks the whole segment."""
    near_a, start = to_subcells(grid, a)
    near_b, end = to_subcells(grid, b)
    if not (near_a and near_b):
        x, y, z = start
        return 0.0, OUTSIDE, 0.0, (x >> SUBCELL_BITS, y >> SUBCELL_BITS, z >> SUBCELL_BITS)
    return walk(grid, threshold, start, end)


@kernel
def edge_free(grid: Grid, threshold: int, a: Point, b: Point) -> bool:
    """Return whether all cells that a segment touches are farther than the squared threshold."""
    return bool(walk_between(grid, threshold, a, b)[1] > threshold)


@kernel
def edge_cost(grid: Grid, threshold: int, weight: float, a: Point, b: Point) -> float:
    """Integrate 1 + weight * cost along an edge, m; infinite if the edge is not free."""
    _, least, inside, _ = walk_between(grid, threshold, a, b)
    if least <= threshold:
        return math.inf
    return distance(a, b) * (1.0 + weight * inside)


@kernel
def walk_path(grid: Grid, threshold: int, weight: float, path: Floats) -> Walked:
    """Walk a polyline (n, 3), m, up to its first cell whose squared distance is <= threshold.

    Returns:
        Length walked, m, the least squared distance met, the integral of 1 + weight * cost over
        that length, m, and the last cell.
    """
    _, least, _, cell = walk_between(grid, threshold, row(path, 0), row(path, 0))
    length, cost = 0.0, 0.0
    for n in range(len(path) - 1):
        if least <= threshold:
            break
        a, b = row(path, n), row(path, n + 1)
        share, value, inside, cell = walk_between(grid, threshold, a, b)
        length += share * distance(a, b)
        cost += (share + weight * inside) * distance(a, b)
        least = min(least, value)
    return length, least, cost, cell


@kernel
def nearest_free(
    grid: Grid, threshold: int, point: Point, radius: float
) -> tuple[bool, int, int, int]:
    """Find the free cell whose centre is nearest to a point, at most `radius` cells away.

    Distances are compared in exact sub-cells; among equal ones the lowest index wins.

    Returns:
        Whether there is one, and its indices.
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
