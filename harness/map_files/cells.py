"""The cells of a log's map at a decision."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wayproof.harness.errors import InputError
from wayproof.harness.log.reader import Log
from wayproof.harness.viewer.layer import layer_at
from wayproof.harness.viewer.moments import Moment, moments
from wayproof.maps import FREE, OCCUPIED, Representation
from wayproof.maps.columns import WORD_BITS, Window, unpack


@dataclass(frozen=True)
class Cells:
    """States of the cells in the operating area.

    Attributes:
        states: (nx, ny, nz) unknown, free or occupied.
        first: (3,) indices of the first cell on the map's lattice.
        origin: (3,) corner of the first cell, m, world.
        resolution: Edge of a cell, m.
    """

    states: NDArray[np.uint8]
    first: tuple[int, int, int]
    origin: NDArray[np.float64]
    resolution: float

    def centres(self, state: int) -> NDArray[np.float64]:
        """Return the centres (n, 3) of the cells of a state, m, world."""
        places = np.argwhere(self.states == state)
        centres: NDArray[np.float64] = self.origin + (places + 0.5) * self.resolution
        return centres


@dataclass(frozen=True)
class FlatMap:
    """States of the cells of a plane, as a robot on the ground plans in.

    Attributes:
        states: (nx, ny) unknown, free or occupied.
        origin: (2,) corner of the first cell, m, world.
        resolution: Edge of a cell, m.
    """

    states: NDArray[np.uint8]
    origin: NDArray[np.float64]
    resolution: float


def moment_at(log: Log, decision: int | None) -> Moment:
    """Return a decision with its map rebuilt; the last one without a number.

    Raises:
        InputError: There is no such decision.
    """
    last = None
    for moment in moments(log):
        last = moment
        if decision is not None and moment.decision.sequence == decision:
            return moment
    if last is None:
        raise InputError(f"log '{log.path}': without a decision, so without a map")
    if decision is not None:
        most = last.decision.sequence
        raise InputError(f"--at {decision}: no such decision, expected 0 to {most}")
    return last


def cells_of(log: Log, a_map: Representation) -> Cells:
    """Return the cells of a map within the operating area of its log."""
    return cells_within(a_map, log.mission.low, log.mission.high)


def cells_within(a_map: Representation, low: ArrayLike, high: ArrayLike) -> Cells:
    """Return the cells of a map that cover a box.

    Args:
        a_map: Any map.
        low: (3,) least corner, m, world.
        high: (3,) greatest corner, m, world.
    """
    window = Window.covering(low, high, a_map.resolution)
    nx, ny, nz = window.shape
    occupied, free = a_map.columns(window.first, (nx, ny, -(-nz // WORD_BITS)))
    states = unpack(free, nz) * np.uint8(FREE) + unpack(occupied, nz) * np.uint8(OCCUPIED)
    return Cells(states, window.first, window.origin, a_map.resolution)


def flat_map_of(moment: Moment) -> FlatMap:
    """Return the plane of a moment's costmap: projected on the ground, or at the robot's height."""
    costmap = moment.costmap
    layer = layer_at(costmap, float(moment.record.inputs.pose.position[2]))
    return FlatMap(costmap.state[:, :, layer], costmap.origin[:2], costmap.resolution)
