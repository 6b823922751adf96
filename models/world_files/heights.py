"""Height fields: `.npy` arrays of heights in m, or `.png` images from black to white.

Rows of an array run along y, the first at the least y; columns along x. Rows of an image run down.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from wayproof.models.world_files.images import read_elevation
from wayproof.models.world_files.options import Found, ImportOptions
from wayproof.models.world_files.parts import Part
from wayproof.models.world_files.reading import MAX_HEIGHTS, WorldFileError, check_file

GROUND_DEPTH = 0.5
"""Depth of the ground below the lowest height, m."""

FLAT = 1e-9


def read_heights(path: Path, options: ImportOptions) -> Found:
    """Read a height field, its low corner at the origin and its heights above the floor.

    Raises:
        WorldFileError: No array or image of heights.
    """
    if path.suffix.lower() == ".npy":
        heights = _array(path)
    else:
        heights = read_elevation(path)[0][::-1] * options.height
    if min(heights.shape) < 2:
        raise WorldFileError(path, f"{heights.shape} heights, expected at least 2 x 2")
    x, y = ((n - 1) * options.resolution for n in heights.shape[::-1])
    return Found(parts=[height_part(path, heights, (x, y), (x / 2.0, y / 2.0, 0.0))])


def height_part(
    path: Path, heights: NDArray[np.float64], size: tuple[float, float], centre: Sequence[float]
) -> Part:
    """Return a field of heights as ground of kind `floor`; a level one as a box.

    Args:
        path: Its file.
        heights: (ny, nx) m above the centre, rows along y.
        size: Extent in x and y, m.
        centre: Middle of the field at height 0, m.

    Raises:
        WorldFileError: Too many heights, or one that is not finite.
        ValueError: A size that is not positive.
    """
    if heights.size > MAX_HEIGHTS or min(heights.shape) < 2:
        ny, nx = heights.shape
        raise WorldFileError(path, f"{nx} x {ny} heights, expected 2 x 2 to {MAX_HEIGHTS} in all")
    if not np.isfinite(heights).all():
        raise WorldFileError(path, "a height that is not finite")
    low, rise = float(heights.min()), float(np.ptp(heights))
    x, y, z = centre
    half = size[0] / 2.0, size[1] / 2.0
    if rise < FLAT:
        middle = (x, y, z + low - GROUND_DEPTH / 2.0)
        return Part("box", (*half, GROUND_DEPTH / 2.0), middle, kind="floor")
    return Part(
        "heights", (*half, rise, GROUND_DEPTH), (x, y, z + low), kind="floor",
        heights=(heights - low) / rise,
    )  # fmt: skip


def _array(path: Path) -> NDArray[np.float64]:  # (ny, nx)
    check_file(path)
    try:
        array = np.load(path, mmap_mode="r", allow_pickle=False)  # a forged size takes no memory
    except Exception as error:  # numpy parses the header as source text: any error of that
        raise WorldFileError(path, f"no array ({' '.join(str(error).split())[:100]})") from None
    if not isinstance(array, np.ndarray):
        raise WorldFileError(path, "an archive, expected one array")
    if array.ndim != 2 or array.dtype.kind not in "fiu" or array.size > MAX_HEIGHTS:
        raise WorldFileError(
            path, f"{array.dtype} {array.shape}, expected (ny, nx) numbers, at most {MAX_HEIGHTS}"
        )
    if not np.isfinite(array).all():
        raise WorldFileError(path, "a height that is not finite")
    return np.asarray(array, np.float64)
