"""Type names of arrays and vectors."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
"""Array of doubles; its shape stands where it is used."""

Vector3 = tuple[float, float, float]
"""Three numbers: a point in m, a direction or three sizes."""
