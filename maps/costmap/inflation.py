"""Inflation: every cell within a ball's radius of a blocked one, exactly, 64 cells at a time."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from wayproof.maps.kernels import inflation as kernels
from wayproof.maps.parallel import ThreadTeam

MAX_SQUARED_RADIUS = 181 * 181  # cells^2, as far as the distance field tells


def inflate(
    blocked: NDArray[np.uint64], squared_radius: int, team: ThreadTeam | None = None
) -> NDArray[np.uint64]:
    """The cells whose squared distance to a blocked one is at most `squared_radius`.

    The ball is a disc of vertical lines: each plane is grown along z by every half-height that the
    ball has, and the words of the grown planes are united over the disc.

    Args:
        blocked: (nx, ny, words) bits: bit k of word w is cell 64 w + k along z. What lies outside
            holds nothing.
        squared_radius: cells^2.
        team: Threads that share the work; None for the caller's alone. The result does not depend
            on them.

    Returns:
        (nx, ny, words) bits.

    Raises:
        ValueError: The squared radius is not within 0 to 32761.
    """
    if not 0 <= squared_radius <= MAX_SQUARED_RADIUS:
        raise ValueError(
            f"squared_radius: got {squared_radius}, expected 0 to {MAX_SQUARED_RADIUS} cells^2"
        )
    heights = _half_heights(squared_radius)
    blocked = np.ascontiguousarray(blocked)  # another layout would be compiled anew
    inflated = np.empty_like(blocked)

    def work(_: int, planes: tuple[int, int]) -> None:
        kernels.inflate_planes(blocked, heights, *planes, inflated)

    (team or ThreadTeam(1)).parallel_for(work, len(blocked))
    return inflated


def _half_heights(squared_radius: int) -> NDArray[np.int64]:
    """Cells above the middle that the ball holds over (dx, dy), (r + 1, r + 1); -1 for none."""
    reach = math.isqrt(squared_radius)
    heights = np.full((reach + 1, reach + 1), -1, np.int64)
    for dx in range(reach + 1):
        for dy in range(math.isqrt(squared_radius - dx * dx) + 1):
            heights[dx, dy] = math.isqrt(squared_radius - dx * dx - dy * dy)
    return heights
