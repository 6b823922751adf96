"""Conversion of a recording, or of a log with its maps, to a bag of ROS.

Of a log the bag has, beside what the robot measured (see `recordings.bags.writing`):

- `/map`, an OccupancyGrid of the states: 0 free, 100 occupied, -1 unknown;
- `/costmap_raw`, a nav2_msgs/Costmap by the scale of `nav2_costmap_2d`, and `/costmap`, the same as
  an OccupancyGrid, translated as Nav2's publisher does;
- `/plan` and `/trajectory`, a Path each: the planned path and the committed trajectory.
"""

from __future__ import annotations

import heapq
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wayproof.harness.decision import path_of
from wayproof.harness.log.reader import Log
from wayproof.harness.recordings.bags.building import Builder
from wayproof.harness.recordings.bags.writing import (
    WORLD,
    BagKind,
    Stamped,
    encoding_of,
    recording_messages,
    write_bag,
)
from wayproof.harness.recordings.recording import Recording
from wayproof.harness.viewer.layer import layer_at
from wayproof.harness.viewer.moments import Moment, moments
from wayproof.maps import FREE, OCCUPIED, Costmap
from wayproof.maps.costmap.nav2_costs import INSCRIBED, LETHAL, NO_INFORMATION, costs_of

GRID_PERIOD_NS = 1_000_000_000
"""Time between two grids of the bag, ns; the last decision has one too."""

GRID, COSTS, PATH = "nav_msgs/msg/OccupancyGrid", "nav2_msgs/msg/Costmap", "nav_msgs/msg/Path"


def convert(recording: Recording, log: Log | None, out: Path, kind: BagKind) -> int:
    """Write a bag; return the number of its messages.

    Args:
        recording: Sensors and poses that are written.
        log: The log that the recording was opened from, whose maps and plans are written too.
        out: File of ROS 1, or folder of ROS 2.
        kind: Kind of the bag.

    Raises:
        InputError: It cannot be read or written.
    """
    messages = recording_messages(recording, kind)
    if log is not None:
        views = _views(log, Builder(encoding_of(kind)), kind)
        messages = heapq.merge(messages, views, key=lambda one: one.stamp_ns)
    return write_bag(messages, out, kind)


def occupancy_of_costs() -> NDArray[np.int8]:  # (256,)
    """Return the occupancy by cost: the table of Nav2's `Costmap2DPublisher`."""
    table = np.zeros(256, np.int8)
    table[1:INSCRIBED] = 1 + 97 * (np.arange(1, INSCRIBED) - 1) // 251
    table[INSCRIBED], table[LETHAL], table[NO_INFORMATION] = 99, 100, -1
    return table


def _views(log: Log, build: Builder, kind: BagKind) -> Iterator[Stamped]:
    """Yield grids and paths of a log's decisions, in order of time."""
    last = int(log.result.get("decisions", "0")) - 1
    written_ns = -GRID_PERIOD_NS
    for moment in moments(log):
        now = moment.time_ns
        yield Stamped(now, "/plan", PATH, _path(build, now, path_of(moment.decision.global_path)))
        committed = path_of(moment.decision.trajectory.path)
        yield Stamped(now, "/trajectory", PATH, _path(build, now, committed))
        if now - written_ns >= GRID_PERIOD_NS or moment.decision.sequence == last:
            written_ns = now
            yield from _grids(moment, build, kind)


def _grids(moment: Moment, build: Builder, kind: BagKind) -> Iterator[Stamped]:
    costmap, now = moment.costmap, moment.time_ns
    layer = layer_at(costmap, float(moment.record.inputs.pose.position[2]))
    states = costmap.state[:, :, layer]
    occupancy = np.full(states.shape, -1, np.int8)
    occupancy[states == FREE], occupancy[states == OCCUPIED] = 0, 100
    yield Stamped(now, "/map", GRID, _grid(build, now, costmap, occupancy))
    costs = costs_of(costmap, layer, moment.decision.collision_distance_sq)
    translated = occupancy_of_costs()[costs]
    yield Stamped(now, "/costmap", GRID, _grid(build, now, costmap, translated))
    if kind != "ros1":  # Nav2 is of ROS 2 alone
        yield Stamped(now, "/costmap_raw", COSTS, _costmap(build, now, costmap, costs))


def _grid(build: Builder, now: int, costmap: Costmap, cells: NDArray[np.int8]) -> Any:
    columns, rows = cells.shape
    return build.make(
        "nav_msgs/OccupancyGrid",
        header=build.header(now, WORLD),
        info={
            "map_load_time": build.time(now),
            "resolution": costmap.resolution,
            "width": columns,
            "height": rows,
            "origin": _corner(costmap),
        },
        data=np.ascontiguousarray(cells.T).reshape(-1),
    )


def _costmap(build: Builder, now: int, costmap: Costmap, costs: NDArray[np.uint8]) -> Any:
    columns, rows = costs.shape
    return build.make(
        "nav2_msgs/Costmap",
        header=build.header(now, WORLD),
        metadata={
            "map_load_time": build.time(now),
            "update_time": build.time(now),
            "layer": "master",
            "resolution": costmap.resolution,
            "size_x": columns,
            "size_y": rows,
            "origin": _corner(costmap),
        },
        data=np.ascontiguousarray(costs.T).reshape(-1),
    )


def _corner(costmap: Costmap) -> dict[str, dict[str, float]]:
    x, y = (float(value) for value in costmap.origin[:2])
    return {"position": {"x": x, "y": y}, "orientation": {"w": 1.0}}


def _path(build: Builder, now: int, points: NDArray[np.float64]) -> Any:
    header = build.header(now, WORLD)
    poses = []
    for x, y, z in points.tolist():
        pose = {"position": {"x": x, "y": y, "z": z}, "orientation": {"w": 1.0}}
        poses.append({"header": header, "pose": pose})
    return build.make("nav_msgs/Path", header=header, poses=poses)
