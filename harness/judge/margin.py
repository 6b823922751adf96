"""The part of the margin that a pose asks for by the error that its estimator states."""

from __future__ import annotations

import math

import numpy as np

from wayproof.harness.inputs import Pose

SIGMAS = 2.0
"""Standard deviations of the estimated position that the margin covers."""

DIFFERS = 0.02
"""Difference of the margins of two axes from which they differ, m."""

MOST_CELLS, MOST_MORE = 100, 400
"""Greatest margin for a stated covariance, and what may lack along one axis, cells."""


def believed_of(pose: Pose, size: float, flat: bool) -> tuple[float, tuple[int, ...]]:
    """Return the margin for the stated error of a pose, m, and the cells more along x and y.

    Of an estimator that states a covariance and is less sure along x or y: the standard deviations
    of the other axes, and what lacks along that one in whole cells.

    Args:
        pose: Pose that the decision was made on.
        size: Edge of a cell, m.
        flat: Whether the body moves in the plane.
    """
    if pose.covariance is None:
        return SIGMAS * pose.position_sigma, ()
    along = SIGMAS * np.sqrt(np.diagonal(pose.covariance))
    worse = 0 if along[0] > along[1] else 1
    others = [float(along[1 - worse])] if flat else [float(along[1 - worse]), float(along[2])]
    more = float(along[worse]) - max(others)
    if more <= DIFFERS:
        return min(SIGMAS * pose.position_sigma, MOST_CELLS * size), ()
    cells = [0, 0]
    cells[worse] = min(math.ceil(more / size), MOST_MORE)
    return min(max(others), MOST_CELLS * size), tuple(cells)
