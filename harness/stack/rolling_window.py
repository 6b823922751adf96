"""The rolling window: the part of a large operating area that has a costmap and distances."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from wayproof.harness.config import Config
from wayproof.harness.mission import Mission

Array = NDArray[np.float64]
Cell = tuple[int, int]

WHOLE = 1.5
"""Longest area that is held whole, in edges of the window."""

SLACK = 0.125
"""Distance from its centre at which the robot takes the window with it, in edges."""

INSET = 2.0
"""Distance of a goal from a border of the window within the area, m."""


def edge_of(config: Config, mission: Mission) -> float:
    """Return the edge of the window that a mission's costmap is kept for, m; infinite: all of it.

    It holds a part only where all evidence was measured and floors are level: a layer of other
    evidence, and ground that is followed from column to column, need the whole area. So does a
    recording, where nothing follows what the stack decides.
    """
    edge, costs = config.costmap.window, config.costmap
    if edge == 0.0 or costs.max_slope > 0.0 or config.has_layers or config.recording is not None:
        return math.inf
    return edge if _extent(mission).max() > WHOLE * edge else math.inf


class RollingWindow:
    """A square window of an operating area; along an axis where that is no wider, all of it.

    A window of the whole area is one that never moves.

    Attributes:
        centre: Cell (x, y) of the map that it is centred on.
    """

    def __init__(self, config: Config, mission: Mission) -> None:
        """Centre it on the mission's start."""
        edge = edge_of(config, mission)
        self._resolution = config.map.resolution
        self._low, self._high = np.array(mission.low), np.array(mission.high)
        self._half = 0.5 * edge  # m
        self._slack = SLACK * edge / self._resolution  # cells
        self._ends = [self.centred_on(corner) for corner in (self._low, self._high)]
        self.centre = self.centred_on(np.array(mission.start))

    def move(self, centre: Cell) -> None:
        """Centre it on a cell, or as near to that as the area's ends allow."""
        x, y = (
            min(max(cell, low), high) for cell, low, high in zip(centre, *self._ends, strict=True)
        )
        self.centre = x, y

    def leaves_behind(self, centre: Cell) -> bool:
        """Return whether a centre is so far from its own that the window should move there.

        Or at the end of the area: what lies there is then in the window.
        """
        for new, own, ends in zip(centre, self.centre, zip(*self._ends, strict=True), strict=True):
            if abs(new - own) > self._slack or (new != own and new in ends):
                return True
        return False

    @property
    def corners(self) -> tuple[Array, Array]:
        """Least and greatest corner (3,), m; at an end of the area that is the area's own."""
        return self._corners(inset=0.0)

    @property
    def inner(self) -> tuple[Array, Array]:
        """Corners (2,) of the part in which a goal may lie, m."""
        low, high = self._corners(INSET)
        return low[:2], high[:2]

    def centred_on(self, position: Array) -> Cell:
        """Return the centre nearest to a position (3,), m, with the window within the area."""
        middle = 0.5 * (self._low[:2] + self._high[:2])
        least = np.minimum(self._low[:2] + self._half, middle)
        greatest = np.maximum(self._high[:2] - self._half, middle)
        place = np.minimum(np.maximum(position[:2], least), greatest)
        x, y = np.rint(place / self._resolution).astype(np.int64).tolist()
        return int(x), int(y)

    def _corners(self, inset: float) -> tuple[Array, Array]:
        middle, within = np.array(self.centre) * self._resolution, self._half - inset
        at_low, at_high = (np.equal(self.centre, end) for end in self._ends)
        low, high = self._low.copy(), self._high.copy()
        low[:2] = np.where(at_low, low[:2], middle - within)
        high[:2] = np.where(at_high, high[:2], middle + within)
        return low, high


def _extent(mission: Mission) -> Array:
    extent: Array = np.subtract(mission.high, mission.low)[:2]
    return extent
