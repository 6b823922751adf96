"""Costmaps of Nav2: `nav2_msgs/Costmap`, its updates, and the same as `nav_msgs/OccupancyGrid`.

Costs are those of `nav2_costmap_2d/cost_values.hpp`; an OccupancyGrid has them translated by its
publisher.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from wayproof.harness.recordings.bags.parts import Grid, Patch, Vendor, frame_name, stamp_of
from wayproof.harness.recordings.options import Broken
from wayproof.harness.recordings.transform import Transform
from wayproof.harness.recordings.types import OWN_CLOSED, OWN_FREE, OWN_UNKNOWN

GRID, GRID_UPDATE = "nav_msgs/msg/OccupancyGrid", "map_msgs/msg/OccupancyGridUpdate"
COSTS, COSTS_UPDATE = "nav2_msgs/msg/Costmap", "nav2_msgs/msg/CostmapUpdate"

RAW, UPDATES = "_raw", "_updates"
"""Ends of the topics of costs beside those of their translation, and of updates."""

INSCRIBED, NO_INFORMATION = 253, 255
TRANSLATED_INSCRIBED = 99


def is_costmap(topic: str, kind: str) -> bool:
    """Return whether a grid is a costmap, in which obstacles are inflated; a map is none."""
    return kind in (COSTS, COSTS_UPDATE) or "costmap" in topic.rsplit("/", 1)[-1]


def _states(data: NDArray[Any], rows: int, columns: int) -> NDArray[np.uint8]:
    """Return the states (rows, columns) of costs, bytes without sign, or of their translation."""
    if len(data) != rows * columns:
        raise Broken(f"a grid of {columns} by {rows} cells with {len(data)} costs")
    is_raw = data.dtype == np.uint8
    closed = data >= (INSCRIBED if is_raw else TRANSLATED_INSCRIBED)
    unknown = data == NO_INFORMATION if is_raw else data < 0
    states = np.where(unknown, OWN_UNKNOWN, np.where(closed, OWN_CLOSED, OWN_FREE))
    return states.astype(np.uint8).reshape(rows, columns)


def _grid(message: Any) -> Grid:
    info = message.info if hasattr(message, "info") else message.metadata
    columns, rows = (
        (info.width, info.height) if hasattr(info, "width") else (info.size_x, info.size_y)
    )
    p, q = info.origin.position, info.origin.orientation
    return Grid(
        stamp_ns=stamp_of(message.header),
        frame=frame_name(message.header.frame_id),
        resolution=float(info.resolution),
        T_frame_corner=Transform(np.array([p.x, p.y, p.z]), np.array([q.w, q.x, q.y, q.z])),
        states=_states(message.data, int(rows), int(columns)),
    )


def _patch(message: Any) -> Patch:
    of_costs = hasattr(message, "size_x")
    columns = message.size_x if of_costs else message.width
    rows = message.size_y if of_costs else message.height
    states = _states(message.data, int(rows), int(columns))
    return Patch(stamp_of(message.header), int(message.x), int(message.y), states)


VENDOR = Vendor(
    definitions={
        "nav2_msgs/msg/CostmapMetaData": (
            "builtin_interfaces/Time map_load_time\nbuiltin_interfaces/Time update_time\n"
            "string layer\nfloat32 resolution\nuint32 size_x\nuint32 size_y\n"
            "geometry_msgs/Pose origin\n"
        ),
        COSTS: "std_msgs/Header header\nnav2_msgs/CostmapMetaData metadata\nuint8[] data\n",
        COSTS_UPDATE: (
            "std_msgs/Header header\nuint32 x\nuint32 y\nuint32 size_x\nuint32 size_y\n"
            "uint8[] data\n"
        ),
        GRID_UPDATE: (
            "std_msgs/Header header\nint32 x\nint32 y\nuint32 width\nuint32 height\nint8[] data\n"
        ),
    },
    grids={GRID: _grid, COSTS: _grid, GRID_UPDATE: _patch, COSTS_UPDATE: _patch},
)
