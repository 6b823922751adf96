"""The inflation radius: how far the centre of a disc or ball stays from the centre of a cell."""

from __future__ import annotations

import math

ROUNDING = 1e-6
"""Part of a squared cell by which rounding may miss a whole number."""


def inflation_radius_cells(radius: float, resolution: float, flat: bool) -> float:
    """Return the distance at or below which a disc or ball may touch a cell's content, cells.

    Distances are between cell centres, but a surface may lie anywhere in its cell: half of a cell's
    diagonal more. The place of the disc in its own cell is covered by the margin.

    Args:
        radius: Radius of the disc or ball, with the localization margin, m.
        resolution: Edge of a cell, m.
        flat: Whether the cells are those of a plane.
    """
    return radius / resolution + 0.5 * math.sqrt(2.0 if flat else 3.0)


def collision_distance_sq(radius: float, resolution: float, flat: bool) -> int:
    """Return the greatest squared distance that is forbidden to the disc or ball, cells^2."""
    cells = inflation_radius_cells(radius, resolution, flat)
    return math.floor(cells * cells + ROUNDING)
