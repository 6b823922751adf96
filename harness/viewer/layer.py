"""Image of one layer of the costmap: states, inflation and frontier."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wayproof.maps import FREE, OCCUPIED, UNKNOWN, Costmap

INFLATED, FRONTIER = 3, 4
"""Kinds of cells besides the states: free but inside the inflation; free, outside it, and next to
unknown cells."""

COLOURS = {
    UNKNOWN: (150, 150, 160),
    FREE: (250, 250, 250),
    OCCUPIED: (30, 30, 35),
    INFLATED: (255, 190, 120),
    FRONTIER: (60, 190, 90),
}
"""Colours by kind: red, green and blue, 0 to 255."""


def layer_at(costmap: Costmap, height: float) -> int:
    """Return the layer at a height above the ground, m, or the nearest one."""
    index = int(np.floor((height - costmap.origin[2]) / costmap.resolution))
    return min(max(index, 0), costmap.shape[2] - 1)


def kinds(costmap: Costmap, layer: int, collision_distance_sq: int) -> NDArray[np.uint8]:
    """Return the kind of each cell of a layer, (nx, ny).

    Args:
        costmap: The costmap.
        layer: Index along z.
        collision_distance_sq: Collision distance of the decision, cells^2: of the discs, or of the
            circumscribed disc.
    """
    states = costmap.state[:, :, layer]  # (nx, ny)
    forbidden = costmap.obstacle_clearance[:, :, layer] <= collision_distance_sq
    free = states == FREE
    found = states.copy()
    found[free & _beside(states == UNKNOWN)] = FRONTIER
    found[free & forbidden] = INFLATED
    return found


def pixels(kinds: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return kinds (nx, ny) as an image (ny, nx, 3): x to the right, y up."""
    palette = np.zeros((max(COLOURS) + 1, 3), np.uint8)
    for kind, colour in COLOURS.items():
        palette[kind] = colour
    return np.ascontiguousarray(palette[kinds].transpose(1, 0, 2)[::-1])


def _beside(cells: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return the cells (nx, ny) that share an edge with one of these."""
    beside = np.zeros_like(cells)
    beside[1:] |= cells[:-1]
    beside[:-1] |= cells[1:]
    beside[:, 1:] |= cells[:, :-1]
    beside[:, :-1] |= cells[:, 1:]
    return beside
