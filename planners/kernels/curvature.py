"""Bends of a polyline: the speeds that they allow, and corners too sharp to take in motion."""

from __future__ import annotations

import math

import numpy as np

from wayproof.kernel_compiler import allocating, kernel
from wayproof.planners.kernels.grid import Floats
from wayproof.planners.kernels.polyline import edge_lengths


@allocating
def limit_speeds(
    lengths: Floats,  # (n - 1,)
    tangents: Floats,  # (n - 1, 3)
    headings: Floats,  # (n - 1,)
    lateral_acceleration: float,
    yaw_rate: float,
) -> Floats:
    """Return the largest speed (n,), m/s, that curvature allows; infinite at the ends."""
    last = len(lengths) - 1
    limits = np.full(len(lengths) + 1, np.inf)
    bends = edge_lengths(tangents)  # (n - 2,) change of the tangent
    for k in range(last):
        around = 0.5 * (lengths[k] + lengths[k + 1])
        # The first and last edge may be left over from a cut: their bend belongs to a longer one.
        if k == 0:
            around = max(around, lengths[1])
        if k == last - 1:
            around = max(around, lengths[k])
        bend, turn = bends[k], abs(headings[k + 1] - headings[k])
        if bend > 0.0:
            limits[k + 1] = math.sqrt(lateral_acceleration * around / bend)
        if turn > 0.0:
            limits[k + 1] = min(limits[k + 1], yaw_rate * around / turn)
    return limits


@kernel
def first_sharp_corner(
    arcs: Floats,  # (n,)
    tangents: Floats,  # (n - 1, 3)
    first: int,  # edge
    least_cosine: float,
    window: float,
) -> float:
    """Return the arc length, m, of the first corner that turns too far within a window.

    The arc length of the path's end if there is none.
    """
    for edge in range(first, len(tangents)):
        # The window opens where the edge ends; the path turns most where two edges differ most.
        sharp, corner, least = False, edge + 1, 1.0
        for ahead in range(edge + 1, len(tangents)):
            if arcs[ahead] > arcs[edge + 1] + window:
                break
            sharp = sharp or cosine_between(tangents, edge, ahead) < least_cosine
            turn = cosine_between(tangents, ahead - 1, ahead)
            if turn < least or ahead == edge + 1:
                corner, least = ahead, turn
        if sharp:
            return float(arcs[corner])
    return float(arcs[-1])


@kernel
def cosine_between(tangents: Floats, a: int, b: int) -> float:
    """Return the cosine of the angle between two edges."""
    return float(
        tangents[a, 0] * tangents[b, 0]
        + tangents[a, 1] * tangents[b, 1]
        + tangents[a, 2] * tangents[b, 2]
    )
