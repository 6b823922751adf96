"""Cells of a map by their state."""

import numpy as np

from wayproof.maps import OCCUPIED, states_in
from wayproof.maps.grid import cell_box, centres


def occupied_centres(a_map, low, high):
    """Centres (n, 3) of the occupied cells of a box, m, world, in lexical order."""
    first, _ = cell_box(low, high, a_map.resolution)
    return centres(np.argwhere(states_in(a_map, low, high) == OCCUPIED) + first, a_map.resolution)
