"""A sweep as a range image: lost echoes, false returns, and the noise of its ranges.

All are measured in the sweep itself, so they need no map and no data sheet.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from wayproof.maps.kernels import range_image as kernels
from wayproof.maps.sweep import Ranges

MISSED = 0.01
"""Probability that all of the beams looked at to one side have lost their echoes, too."""

MOST_REACH = 24
"""Greatest number of columns looked at to each side."""

LEAST_DEPTH = 0.05
"""Least distance by which a false return lies before the returns beside it, m."""

DEPTH_IN_DEVIATIONS = 4.3
"""The same in standard deviations of a range: three of the difference of two."""

SAME_THING = 0.2
"""Difference in range up to which returns above one another are of one thing, m."""

LEAST_FALSE = 0.002
"""Share of single returns above which they are false. In most sweeps of the built-in worlds, where
they are tips of things, it is below that."""

FEW_LOST = 0.1
"""Share of lost echoes up to which a beam without return is taken to see far."""

LEAST_BESIDE = 0.02
"""Least share of the beams that must have returns right beside them to say how many are lost: amid
falling snow before the open sky few have, and none is lost."""

LEAST_TRIPLES = 200
"""Fewest triples of neighbouring returns that hold a deviation."""

MOST_BEND = 4095
"""Greatest second difference that is counted by itself, mm; greater ones count as it."""

MEDIAN_TO_DEVIATION = 1.0 / (0.6744897501960817 * math.sqrt(6.0))
"""Standard deviation of one range to the median of |a - 2 b + c| of three: that of a normal
variable to its median absolute value, and 1 + 4 + 1 variances in a second difference."""


def lost_echoes(image: Ranges, closed: bool) -> NDArray[np.bool_]:
    """Find the beams without return between beams of their row that have one.

    A surface that lost them is the more likely reason than a gap as narrow, so they are no evidence
    that all is free up to the longest range. How far to each side a return counts follows from the
    share of the echoes that is lost. At the border of an open image one side suffices.

    Args:
        image: (r, c) ranges, mm, a row for each elevation.
        closed: Whether the last column lies beside the first.

    Returns:
        (r, c) whether each is one.
    """
    lost = np.empty(image.shape, np.bool_)
    kernels.find_lost(image, reach_for(lost_share(image, closed)), closed, lost)
    return lost


def lost_share(image: Ranges, closed: bool) -> float:
    """Estimate the share of the echoes that is lost one by one; 0 where nothing shows it.

    It is that of the beams right between two returns. Whole patches are lost unseen.

    Args:
        image: (r, c) ranges, mm, a row for each elevation.
        closed: Whether the last column lies beside the first.
    """
    beside, silent = kernels.count_silent(image, closed)
    return silent / beside if beside else 0.0


def reach_for(share: float) -> int:
    """Return within how many columns a beam returns but for `MISSED`, at a share of lost echoes."""
    reach, missed = 1, share
    while missed > MISSED and reach < MOST_REACH:
        reach, missed = reach + 1, missed * share
    return reach


def false_returns(
    image: Ranges, closed: bool, farthest_m: float, deviation_m: float
) -> NDArray[np.bool_] | None:
    """Find returns of what is in the air, as rain and snow: single ones before their neighbours.

    After Charron et al. 2018, "De-noising of Lidar Point Clouds Corrupted by Snowfall": snow has no
    neighbours within a radius that grows with the distance between beams. Here it must also lie
    before those of its row, so that no edge of a surface counts; and if the one above or below does
    so as well, at about its range, both are of a thing, as a pole.

    Args:
        image: (r, c) ranges, mm, a row for each elevation.
        closed: Whether the last column lies beside the first.
        farthest_m: Range up to which two beams meet whatever is large enough to matter, m.
        deviation_m: Standard deviation of the ranges, m.

    Returns:
        (r, c) whether each is one; None where there are too few to be any but tips of things, or
        the image is a single row.
    """
    if image.shape[0] < 2:
        return None
    depth = round(1e3 * max(LEAST_DEPTH, DEPTH_IN_DEVIATIONS * deviation_m))
    protruding, isolated = np.empty((2, *image.shape), np.bool_)
    farthest = round(1e3 * farthest_m)
    returns, found = kernels.find_protruding(
        image, farthest, depth, sky=True, closed=closed, protruding=protruding
    )
    if found <= LEAST_FALSE * returns:  # nor are there more without the sky, or of single ones
        return None
    beside, silent = kernels.count_silent(image, closed)
    if beside >= LEAST_BESIDE * image.size and silent >= FEW_LOST * beside:
        kernels.find_protruding(
            image, farthest, depth, sky=False, closed=closed, protruding=protruding
        )
    near = max(round(1e3 * SAME_THING), depth)
    found = kernels.find_isolated(image, protruding, near, closed, isolated)
    return isolated if found > LEAST_FALSE * returns else None


def range_deviation(image: Ranges) -> float | None:
    """Estimate the standard deviation of the ranges of an image, m; None of too few returns.

    By the median of the second differences along rows: a plane has none but for the little that a
    step of azimuth bends its ranges, and edges are less than half of all.

    Args:
        image: (r, c) ranges, mm, a row for each elevation.
    """
    counts = np.empty(MOST_BEND + 1, np.int64)
    total = kernels.count_bends(image, counts)
    if total < LEAST_TRIPLES:
        return None
    median = int(np.searchsorted(np.cumsum(counts), (total + 1) // 2))
    return median * 1e-3 * MEDIAN_TO_DEVIATION


def warm_up() -> None:
    """Compile the kernels, or load them from the cache."""
    image = np.full((2, 3), kernels.NO_RETURN_MM, np.uint16)
    lost_echoes(image, closed=True)
    image[0, 1] = 500  # a false return
    false_returns(image, closed=True, farthest_m=1.0, deviation_m=0.0)
    range_deviation(image)
