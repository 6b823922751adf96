"""Boxes in which a body is free at any heading, most of them found by one distance."""

from __future__ import annotations

from wayproof.kernel_compiler import kernel
from wayproof.planners.kernels.grid import (
    SUBCELL_BITS,
    Discs,
    Floats,
    Grid,
    Point,
    inside_value,
    to_subcells,
)
from wayproof.planners.kernels.polyline import row


@kernel
def all_above(value: int, threshold: int, squared: int) -> bool:
    """Return whether all cells within a squared distance of one with this value exceed a threshold.

    A distance falls by no more than the cells are apart: the root of the value has to exceed the
    sum of the roots of the threshold and of the squared number.
    """
    spare = value - threshold - squared
    return spare > 0 and spare * spare > 4 * threshold * squared


@kernel
def box_free(grid: Grid, threshold: int, low: Point, high: Point, reach: float) -> bool:
    """Return whether all cells of a box, wider by a reach, m, and a cell to each side, are free.

    In height it is wider only if it has one.
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
    du, dv, dw = x - u, y - v, z - w  # the far corner: the others are no farther
    # The distance in the middle decides most boxes.
    middle = inside_value(grid.field, u, v, w)
    if all_above(middle, threshold, du * du + dv * dv + dw * dw):
        return True
    for u in range(i, x + 1):
        for v in range(j, y + 1):
            for w in range(k, z + 1):
                if inside_value(grid.field, u, v, w) <= threshold:
                    return False
    return True


@kernel
def body_box_free(grid: Grid, discs: Discs, low: Point, high: Point) -> bool:
    """Return whether a body is free at any heading wherever in a box its reference point is."""
    threshold, reach = 0, 0.0
    for n in range(len(discs.offsets)):
        threshold = max(threshold, discs.thresholds[n])
        reach = max(reach, abs(discs.offsets[n]))
    return box_free(grid, threshold, low, high, reach)


@kernel
def any_heading_free(grid: Grid, discs: Discs, path: Floats, first: int, last: int) -> bool:
    """Return whether a body is free at any heading about points `first` to `last` of a path."""
    x, y, z = row(path, first)
    low, high = (x, y, z), (x, y, z)
    for n in range(first + 1, last + 1):
        x, y, z = row(path, n)
        low = min(low[0], x), min(low[1], y), min(low[2], z)
        high = max(high[0], x), max(high[1], y), max(high[2], z)
    return body_box_free(grid, discs, low, high)
