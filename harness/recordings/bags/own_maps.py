"""The robot's own maps in a bag: its costmaps, put together from grids and their updates."""

from __future__ import annotations

import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from wayproof.harness.geometry import yaw_of_quaternion
from wayproof.harness.recordings.bags.frames import FrameTree
from wayproof.harness.recordings.bags.parts import Grid, Patch
from wayproof.harness.recordings.bags.vendors.nav2 import RAW, UPDATES
from wayproof.harness.recordings.options import Broken, Faults
from wayproof.harness.recordings.transform import compose
from wayproof.harness.recordings.types import OwnMap

PERIOD_NS = 1_000_000_000
"""Time between two maps of a topic that are kept, ns."""

UNPLACED = "costmap: no transform to the frame of the poses"


class Kept(NamedTuple):
    """A grid without states, these packed by zlib, their shape, and its place in the file."""

    grid: Grid
    packed: bytes
    shape: tuple[int, int]
    place: int


@dataclass
class Grids:
    """Grids of one topic; one is kept for each `PERIOD_NS`, and the last with updates."""

    kept: list[Kept]
    last: Grid | None = None

    def between(self, first: int, last: int) -> Grids:
        """Return those of messages at places in the file from the first up to, not with, a last."""
        return Grids([one for one in self.kept if first <= one.place < last])

    def take(self, one: Grid | Patch, place: int) -> None:
        """Take a grid, or an update of the last one, of a message at a place in the file.

        Raises:
            Broken: It does not lie in the last one.
        """
        if isinstance(one, Patch):
            if self.last is None:
                raise Broken("an update of a costmap before the costmap")
            (rows, columns), states = one.states.shape, self.last.states.copy()
            piece = states[max(one.y, 0) : one.y + rows, max(one.x, 0) : one.x + columns]
            if min(one.x, one.y) < 0 or piece.shape != one.states.shape:
                raise Broken("an update that is not within its costmap")
            piece[:] = one.states
            one = self.last._replace(stamp_ns=one.stamp_ns, states=states)
        self.last = one
        if not self.kept or abs(one.stamp_ns - self.kept[-1].grid.stamp_ns) >= PERIOD_NS:
            packed, (rows, columns) = zlib.compress(one.states.tobytes(), 1), one.states.shape
            bare = one._replace(states=np.empty((0, 0), np.uint8))
            self.kept.append(Kept(bare, packed, (rows, columns), place))


def own_maps(
    grids: Mapping[str, Grids], tree: FrameTree, world: str, start_ns: int, faults: Faults
) -> tuple[OwnMap, ...]:
    """Return the robot's own maps in the frame of the poses, in order of time.

    Of a costmap and its translation the costs are taken.

    Args:
        grids: Grids by topic.
        tree: Frames.
        world: Frame of the poses.
        start_ns: Stamp of the first pose, ns.
        faults: Counted up.
    """
    found = []
    listed = [(topic, one) for topic in grids for one in grids[topic].kept]
    for topic, (grid, packed, shape, _) in listed:
        if topic + RAW in grids:
            continue
        between = tree.between(world, grid.frame)
        T_world_grid = None if between is None else between.at_one(grid.stamp_ns)
        if T_world_grid is None:
            faults[UNPLACED] += 1
            continue
        (x, y, _), turn = compose(T_world_grid, grid.T_frame_corner)
        corner = float(x), float(y), yaw_of_quaternion(turn)
        time_ns = grid.stamp_ns - start_ns
        found.append(OwnMap(time_ns, topic, grid.resolution, corner, shape, packed))
    return tuple(sorted(found, key=lambda one: (one.time_ns, one.topic)))


def base_of(topic: str) -> str:
    """Return the topic of the costmap that a topic, maybe of its updates, belongs to."""
    return topic.removesuffix(UPDATES)
