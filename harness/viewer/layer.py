"""One layer of the costmap as a picture: the three states, what inflation forbids, the frontier."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wayproof.maps import FREE, OCCUPIED, UNKNOWN, Costmap

INFLATED, FRONTIER = 3, 4
"""Kinds of cells beside the states: free but forbidden to the body's centre; free, admitted, and
beside the unknown."""

COLOURS = {
    UNKNOWN: (150, 150, 160),
    FREE: (250, 250, 250),
    OCCUPIED: (30, 30, 35),
    INFLATED: (255, 190, 120),
    FRONTIER: (60, 190, 90),
}
"""Red, green and blue of each kind, 0 to 255."""


def layer_at(costmap: Costmap, height: float) -> int:
    """The layer that holds a height above the ground, m; the nearest if none does."""
    index = int(np.floor((height - costmap.origin[2]) / costmap.resolution))
    return min(max(index, 0), costmap.shape[2] - 1)


def kinds(costmap: Costmap, layer: int, collision_distance_sq: int) -> NDArray[np.uint8]:
    """The kind of each cell of a layer, (nx, ny).

    Args:
        costmap: The body's.
        layer: Index along z.
        collision_distance_sq: The squared distance that decided, cells^2: a long body's own, or
            that of the disc about it.
    """
    states = costmap.state[:, :, layer]  # (nx, ny)
    forbidden = costmap.obstacle_clearance[:, :, layer] <= collision_distance_sq
    free = states == FREE
    told = states.copy()
    told[free & _beside(states == UNKNOWN)] = FRONTIER
    told[free & forbidden] = INFLATED
    return told


def pixels(told: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Kinds (nx, ny) as an image (ny, nx, 3): x to the right, y up."""
    palette = np.zeros((max(COLOURS) + 1, 3), np.uint8)
    for kind, colour in COLOURS.items():
        palette[kind] = colour
    return np.ascontiguousarray(palette[told].transpose(1, 0, 2)[::-1])


def _beside(cells: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Cells that share an edge with one of these, (nx, ny)."""
    beside = np.zeros_like(cells)
    beside[1:] |= cells[:-1]
    beside[:-1] |= cells[1:]
    beside[:, 1:] |= cells[:, :-1]
    beside[:, :-1] |= cells[:, 1:]
    return beside
