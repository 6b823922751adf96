"""Exact squared distances by scipy, as a distance field has them."""

import numpy as np
from scipy.ndimage import distance_transform_edt


def packed(cells):
    """Booleans (nx, ny, nz) as words (nx, ny, words), z = 64 word + bit; the rest is set."""
    nx, ny, nz = cells.shape
    words = -(-nz // 64)
    padded = np.ones((nx, ny, 64 * words), np.bool_)
    padded[:, :, :nz] = cells
    weights = np.uint64(1) << np.arange(64, dtype=np.uint64)
    return (padded.reshape(nx, ny, words, 64) * weights).sum(axis=3, dtype=np.uint64)


def framed(blocked):
    """With blocked cells around it, but not along an axis of one cell."""
    return np.pad(blocked, [(int(n > 1),) * 2 for n in blocked.shape], constant_values=True)


def inner(shape):
    return tuple(slice(1, -1) if n > 1 else slice(None) for n in shape)


def scipy_squared(blocked, reach):
    """Scipy's exact transform, squared and truncated."""
    whole = framed(blocked)
    if not whole.any():
        return np.full(blocked.shape, reach * reach)
    distances = distance_transform_edt(~whole)[inner(blocked.shape)]
    return np.minimum(np.rint(distances * distances), reach * reach)
