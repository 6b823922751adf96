"""One layer of the costmap: states, inflation and frontier, and their colours."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wayproof.harness.viewer.colours import Colour
from wayproof.maps import FREE, OCCUPIED, UNKNOWN, Costmap

INFLATED, FRONTIER = 3, 4
"""Kinds of cells besides the states: free but inside the inflation; free, outside it, and next to
unknown cells."""

COLOURS: dict[int, Colour] = {
    UNKNOWN: (150, 150, 160),
    FREE: (250, 250, 250),
    OCCUPIED: (30, 30, 35),
    INFLATED: (255, 190, 120),
    FRONTIER: (60, 190, 90),
}
"""Colours by kind."""

MOST = 99
"""Greatest cost but that of an occupied cell, 100, as in an OccupancyGrid of Nav2."""

CHEAP, DEAR = (255, 238, 150), (226, 74, 40)
"""Colours of the costs 1 and 99 of a stack; between them they change evenly."""


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


def palette() -> NDArray[np.uint8]:
    """Return the colours of the kinds, (kinds, 3)."""
    return np.array([COLOURS[kind] for kind in range(len(COLOURS))], np.uint8)


def shades(cells: NDArray[np.int8]) -> NDArray[np.uint8]:
    """Return costs of a stack, any shape, as colours, with an axis of 3 more.

    A cost of 0 is free and 100 occupied; whatever is no cost is unknown.
    """
    table = np.full((256, 3), COLOURS[UNKNOWN], np.uint8)
    share = np.linspace(0.0, 1.0, MOST)[:, None]
    table[1 : MOST + 1] = np.round((1.0 - share) * CHEAP + share * DEAR)
    table[0], table[MOST + 1] = COLOURS[FREE], COLOURS[OCCUPIED]
    return table[np.ascontiguousarray(cells).view(np.uint8)]


def _beside(cells: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return the cells (nx, ny) that share an edge with one of these."""
    beside = np.zeros_like(cells)
    beside[1:] |= cells[:-1]
    beside[:-1] |= cells[1:]
    beside[:, 1:] |= cells[:, :-1]
    beside[:, :-1] |= cells[:, 1:]
    return beside
