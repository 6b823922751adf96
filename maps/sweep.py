"""A sweep of beams: what the map demands of one, and what became of it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from maps._voxel_kernels import MAX_BEAM_CELLS


@dataclass(frozen=True)
class SweepStatistics:
    """What became of a sweep.

    Attributes:
        hits: Beams that met a surface.
        clears: Beams without a return within the range limit; they only clear.
        dropped: Beams without information.
        too_near: Beams below the minimum range; ignored.
        cells_updated: Cells whose evidence this sweep touched.
    """

    hits: int
    clears: int
    dropped: int
    too_near: int
    cells_updated: int


def check_beams(
    directions: NDArray[np.float64],
    ranges_mm: NDArray[np.uint16],
    range_limit: float,
    resolution: float,
) -> None:
    """Refuse beams that the kernels must not see.

    Args:
        directions: (n, 3) world.
        ranges_mm: (n,) mm.
        range_limit: m.
        resolution: Edge of a cell, m.

    Raises:
        ValueError: Wrong shapes or types, directions that are not of unit length, or a range limit
            that is not within 0 to 2047 cells.
    """
    if ranges_mm.dtype != np.uint16 or directions.shape != (*ranges_mm.shape, 3):
        raise ValueError(
            f"beams: got directions {directions.shape} and ranges {ranges_mm.dtype} "
            f"{ranges_mm.shape}, expected (n, 3) and uint16 (n,)"
        )
    squared = np.einsum("ij,ij->i", directions, directions)
    if not np.all(np.abs(squared - 1.0) < 1e-6):  # also refuses NaN
        raise ValueError("directions: got a vector that is not of unit length")
    longest = MAX_BEAM_CELLS * resolution
    if not 0.0 < range_limit <= longest:
        raise ValueError(f"range_limit: got {range_limit:g}, expected up to {longest:g} m")
