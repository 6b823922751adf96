"""Horizontal field of view of a robot's sensors."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from wayproof.harness.inputs import Beams

LEVEL = 0.25
"""Sine of the elevation up to which a beam counts as level: 14 degrees."""

OCTANTS = 8
"""Number of parts of the horizon, 45 degrees each."""


def is_omnidirectional(sensors: Iterable[Beams]) -> bool:
    """Return whether each octant of the horizon of a level body holds a beam of some sensor.

    Sweeps that list their own beams say nothing of a field of view, and count as none.
    """
    seen: set[int] = set()
    for beams in sensors:
        x, y, z = beams.directions_in_base().T
        level = np.abs(z) <= LEVEL
        x, y = x[level], y[level]
        seen.update((4 * (x >= 0.0) + 2 * (y >= 0.0) + (np.abs(x) >= np.abs(y))).tolist())
    return len(seen) == OCTANTS
