"""Solids and worlds with solids in other places, for maps of another day."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wayproof.models.worlds.solids import Solid

MOVABLE = ("shelf", "crate", "furniture", "barrier", "structure", "vehicle")
"""Kinds of solids that people move."""

INNER_WALL = "partition"
"""Kind of the walls that are taken where nothing in a world can be moved, as in a maze."""

TOUCHING = 0.01
"""Distance of the bounds of two solids up to which they are parts of one thing, m."""


def shifted(solid: Solid, x: float, y: float) -> Solid:
    """Return a solid moved in the plane, m."""
    offset = np.array([x, y, 0.0])
    changed: dict[str, Any] = {}
    for name in ("centre", "tail", "head", "corner"):
        if hasattr(solid, name):
            changed[name] = tuple((np.array(getattr(solid, name)) + offset).tolist())
    if hasattr(solid, "vertices"):
        moved = np.array(solid.vertices) + offset
        changed["vertices"] = tuple((a, b, c) for a, b, c in moved.tolist())
    moved_solid: Solid = replace(solid, **changed)  # type: ignore[type-var]
    return moved_solid


def movable_groups(solids: Sequence[Solid]) -> list[list[int]]:
    """Return the things that can be moved, as indices of their solids.

    Solids whose bounds touch are one thing, such as the boards of a rack. Where nothing can be
    moved, each inner wall is a thing.
    """
    movable = [k for k, solid in enumerate(solids) if solid.kind in MOVABLE]
    if not movable:
        return [[k] for k, solid in enumerate(solids) if solid.kind == INNER_WALL]
    low = np.array([solids[k].low for k in movable]) - TOUCHING
    high = np.array([solids[k].high for k in movable])
    groups = [-1] * len(movable)
    count = 0
    for begin in range(len(movable)):
        if groups[begin] >= 0:
            continue
        waiting, groups[begin] = [begin], count
        while waiting:
            for other in _touching(low, high, waiting.pop()):
                if groups[other] < 0:
                    groups[other] = count
                    waiting.append(other)
        count += 1
    return [[movable[k] for k, group in enumerate(groups) if group == n] for n in range(count)]


def _touching(low: NDArray[np.float64], high: NDArray[np.float64], one: int) -> list[int]:
    apart = (low > high[one]) | (low[one] > high)
    return [int(other) for other in np.flatnonzero(~apart.any(axis=1))]
