"""Compiled kernels of the costmap: projection to the ground, and distances."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from maps._jit import kernel
from maps.states import FREE, OCCUPIED, UNKNOWN


@kernel
def project_columns(
    log_odds: NDArray[np.int16],  # (nx, ny, nz)
    floor_layer: int,
    band_first: int,
    band_end: int,
    states: NDArray[np.uint8],  # (nx, ny, 1) out
) -> None:
    """The state of each column of cells for a body that walks on the floor.

    Layers below `floor_layer` are under the floor, those from it up to `band_first` can be stepped
    on, those from `band_first` to `band_end` are where the body passes.
    """
    nx, ny, _ = log_odds.shape
    for x in range(nx):
        for y in range(ny):
            column = log_odds[x, y]
            blocked = False
            for z in range(floor_layer):  # a beam went through where the floor should be
                blocked |= column[z] < 0
            supported = False
            for z in range(floor_layer, band_first):
                supported |= column[z] > 0
            clear = True
            for z in range(band_first, band_end):
                blocked |= column[z] > 0
                clear &= column[z] < 0
            states[x, y, 0] = UNKNOWN
            if blocked:
                states[x, y, 0] = OCCUPIED
            elif clear and supported:
                states[x, y, 0] = FREE


@kernel
def lower(target: NDArray[np.uint16], source: NDArray[np.uint16], added: int) -> None:
    """Lower each element to the source's plus `added`, where that is less."""
    for k in range(target.shape[0]):
        through = np.uint16(source[k] + np.uint16(added))
        target[k] = min(target[k], through)


@kernel
def squared_distances(
    blocked: NDArray[np.bool_],  # (nx, ny, nz)
    reach: int,
    scratch: NDArray[np.uint16],  # (nx, ny, nz)
    squared: NDArray[np.uint16],  # (nx, ny, nz) out
) -> None:
    """Squared distance in cells from each cell to the nearest blocked one, at most reach^2.

    One exact min-plus pass per axis, since the squared distance is a sum over the axes
    (Felzenszwalb & Huttenlocher 2012, "Distance transforms of sampled functions"); truncated, each
    pass looks only `reach` cells around and works on whole rows at once. What lies outside the
    array is blocked, except along an axis of one cell, which is no axis.
    """
    nx, ny, nz = blocked.shape
    most = reach * reach

    # Along z: one scan each way counts the cells since the last blocked one.
    for x in range(nx):
        for y in range(ny):
            mask = blocked[x, y]
            row = squared[x, y]
            count = 0 if nz > 1 else reach
            for z in range(nz):
                count = 0 if mask[z] else min(count + 1, reach)
                row[z] = count
            count = 0 if nz > 1 else reach
            for z in range(nz - 1, -1, -1):
                count = 0 if mask[z] else min(count + 1, reach)
                nearest: int = min(count, int(row[z]))
                row[z] = nearest * nearest

    # Along y: a shift by j rows is a shift by j * nz in the flat plane.
    size = ny * nz
    for x in range(nx):
        source = squared[x].reshape(size)
        target = scratch[x].reshape(size)
        for y in range(ny):
            border = min(y + 1, ny - y, reach) if ny > 1 else reach
            for k in range(y * nz, (y + 1) * nz):
                target[k] = min(source[k], np.uint16(border * border))
        for j in range(1, min(reach, ny)):
            lower(target[j * nz :], source[: size - j * nz], j * j)
            lower(target[: size - j * nz], source[j * nz :], j * j)

    # Along x: a shift is another plane.
    for x in range(nx):
        target = squared[x].reshape(size)
        border = min(x + 1, nx - x, reach) if nx > 1 else reach
        nearest_border = np.uint16(min(border * border, most))
        source = scratch[x].reshape(size)
        for k in range(size):
            target[k] = min(source[k], nearest_border)
        for j in range(1, reach):
            if x >= j:
                lower(target, scratch[x - j].reshape(size), j * j)
            if x + j < nx:
                lower(target, scratch[x + j].reshape(size), j * j)
