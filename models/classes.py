"""Semantic classes of geoms."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:  # a replay reads classes, and knows no simulator
    import mujoco

CLASSES = (
    "unknown",
    "floor",
    "wall",
    "shelf",
    "crate",
    "furniture",
    "person",
    "vehicle",
    "vegetation",
    "structure",
    "door",
    "robot",
)
"""Names of the classes; the number of a class is its index."""

UNKNOWN_CLASS = CLASSES.index("unknown")


def class_of_geoms(model: mujoco.MjModel) -> NDArray[np.uint8]:  # (ngeom,)
    """Return each geom's class, the first number of its `user` data in MJCF; unknown without one.

    Raises:
        ValueError: A number is not that of a class.
    """
    if model.nuser_geom == 0:
        return np.full(model.ngeom, UNKNOWN_CLASS, np.uint8)
    values = model.geom_user[:, 0]
    strange = np.flatnonzero((values != np.floor(values)) | (values < 0) | (values >= len(CLASSES)))
    if len(strange):
        first = int(strange[0])
        raise ValueError(
            f"geom '{model.geom(first).name}': got class {values[first]:g} in its user data, "
            f"expected a whole number from 0 to {len(CLASSES) - 1}"
        )
    classes: NDArray[np.uint8] = values.astype(np.uint8)
    return classes
