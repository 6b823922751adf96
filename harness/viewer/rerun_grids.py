"""Grids on the floor, in Rerun: the layer of the robot, a stack's own costmap, evidence."""

from __future__ import annotations

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from wayproof.harness.explain.stack_costmap import MOST
from wayproof.harness.interface.types import Grid
from wayproof.harness.viewer.layer import FRONTIER, INFLATED
from wayproof.harness.viewer.snapshots import Layer
from wayproof.maps import FREE, OCCUPIED, UNKNOWN

RVIZ_MAP = {UNKNOWN: 255, FREE: 0, OCCUPIED: 100, INFLATED: 200, FRONTIER: 110}
"""Values that RViz's map colours show as grey, white, black, orange and green."""

_CODES = np.zeros(256, np.uint8)
_CODES[list(RVIZ_MAP)] = list(RVIZ_MAP.values())

_COSTS = np.full(256, RVIZ_MAP[UNKNOWN], np.uint8)
_COSTS[1 : MOST + 1] = np.linspace(254, 128, MOST).round()
_COSTS[0], _COSTS[MOST + 1] = RVIZ_MAP[FREE], RVIZ_MAP[OCCUPIED]
"""Values for a stack's costs, 0 to 100, that RViz's map colours show as white, yellow to red, and
black; whatever is no cost is unknown."""


def layer_image(layer: Layer) -> bytes:
    """Return the kinds of the cells in RViz's map colours, from the greatest y down."""
    return _CODES[layer.kinds].T[::-1].tobytes()


def costmap_grid(grid: Grid) -> rr.GridMap:
    """Return a stack's own costmap."""
    height, width = grid.cells.shape
    image = _COSTS[np.ascontiguousarray(grid.cells[::-1]).view(np.uint8)]
    return grid_map(
        width, height, side=grid.resolution, corner=grid.origin.tolist(), data=image.tobytes()
    )


def grid_map(
    width: int, height: int, side: float, corner: list[float], data: bytes | None = None
) -> rr.GridMap:
    """Return a grid on the floor in RViz's map colours.

    Args:
        width: Number of cells along x.
        height: Number of cells along y.
        side: Edge of a cell, m.
        corner: [x, y] of the lower corner of its first cell, m, world.
        data: A byte for each cell, from the greatest y down; None: sent apart.
    """
    return rr.GridMap.from_fields(
        data=data,
        format=rr.components.ImageFormat(
            width=width, height=height, color_model="L", channel_datatype="U8"
        ),
        cell_size=side,
        translation=[*corner, 0.0],
        colormap=rr.components.Colormap.RvizMap,
        opacity=0.9,
    )


def coloured_grid(image: NDArray[np.uint8], layer: Layer) -> rr.GridMap:
    """Return a grid on the floor in the colours of an image (ny, nx, 3), greatest y first."""
    height, width, _ = image.shape
    return rr.GridMap(
        data=image.tobytes(),
        format=rr.components.ImageFormat(
            width=width, height=height, color_model="RGB", channel_datatype="U8"
        ),
        cell_size=layer.resolution,
        translation=[*layer.corner.tolist(), 0.0],
    )
