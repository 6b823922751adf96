"""Depth images as beams: one through each pixel, z ahead, x to the right, y down."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wayproof.harness.recordings.beams import FARTHEST, Beams, Limits, Silent, point_beams
from wayproof.harness.recordings.options import Faults, Intrinsics

NO_DEPTH = 65535
"""Value of a pixel of 16 bits without a measurement, beside 0 (7-Scenes, OAK cameras)."""


def depth_beams(
    depths: NDArray[np.float64],
    intrinsics: Intrinsics,
    stride: int,
    limits: Limits,
    faults: Faults,
) -> Beams:
    """Return the beams of a depth image (rows, columns), m along the axis, by the pinhole model.

    A depth of 0 or NaN says nothing (REP 118): the surface may be too near, too far, or not echo.
    A depth of inf says that nothing came back, which counts as no return.
    """
    rows, columns = depths.shape
    slopes = pixel_slopes(rows, columns, intrinsics, stride)
    chosen = depths[stride // 2 :: stride, stride // 2 :: stride].reshape(-1)
    measured = chosen > 0.0  # false for NaN
    faults["pixel: no measurement"] += int((~measured).sum())
    silent = np.isinf(chosen)
    far = measured & ~silent & (chosen > FARTHEST)
    faults["range: beyond the maximum"] += int(far.sum())
    met = measured & ~silent & ~far
    points = np.empty((int(met.sum()), 3), np.float32)
    points[:, :2] = slopes[met] * chosen[met, None]
    points[:, 2] = chosen[met]
    return point_beams(
        points,
        times_ns=None,
        limits=limits,
        faults=faults,
        silent=Silent(_unit(slopes[measured & silent])),
    )


def depths_of(pixels: NDArray[Any], units_per_metre: float) -> NDArray[np.float64]:
    """Return the depths of pixels, m: 0 where an integer is a code for no measurement."""
    depths: NDArray[np.float64] = pixels.astype(np.float64) / units_per_metre
    return np.where(pixels == NO_DEPTH, 0.0, depths) if pixels.dtype.kind in "iu" else depths


@lru_cache(maxsize=8)
def pixel_slopes(
    rows: int, columns: int, intrinsics: Intrinsics, stride: int
) -> NDArray[np.float64]:  # (n, 2)
    """Return x / z and y / z of the beams through the pixels of a stride, row by row."""
    fx, fy, cx, cy = intrinsics
    across = (np.arange(stride // 2, columns, stride) - cx) / fx
    down = (np.arange(stride // 2, rows, stride) - cy) / fy
    slopes = np.empty((len(down), len(across), 2))
    slopes[..., 0], slopes[..., 1] = across[None, :], down[:, None]
    flat: NDArray[np.float64] = slopes.reshape(-1, 2)
    flat.setflags(write=False)
    return flat


def _unit(slopes: NDArray[np.float64]) -> NDArray[np.float32]:  # (n, 3)
    directions = np.column_stack([slopes, np.ones(len(slopes))])
    lengths = np.sqrt((directions * directions).sum(axis=1))
    unit: NDArray[np.float32] = (directions / lengths[:, None]).astype(np.float32)
    return unit
