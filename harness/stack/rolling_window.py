"""The rolling window: the part of a large operating area that has a costmap and distances."""

from __future__ import annotations

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
"""Distance of a goal from a border of the window that lies within the area, m."""


def rolls(config: Config, mission: Mission) -> bool:
    """Return whether the costmap of a mission is kept for a window that rolls along with the robot.

    Only where all evidence was measured and floors are level: a layer of other evidence, and ground
    that is followed from column to column, need the whole area. So does a recording, where nothing
    follows what the stack decides.
    """
    edge, costs = config.costmap.window, config.costmap
    if edge == 0.0 or costs.max_slope > 0.0 or config.has_layers or config.recording is not None:
        return False
    return bool(_extent(mission).max() > WHOLE * edge)


class RollingWindow:
    """A square window of an operating area, within the area where that is wide enough.

    Attributes:
        centre: Cell (x, y) of the map that it is centred on.
    """

    def __init__(self, config: Config, mission: Mission) -> None:
        """Centre it on the mission's start."""
        self._resolution = config.map.resolution
        self._low, self._high = np.array(mission.low), np.array(mission.high)
        self._half = np.minimum(0.5 * config.costmap.window, 0.5 * _extent(mission))  # (2,) m
        self._slack = round(SLACK * config.costmap.window / self._resolution)  # cells
        self._ends = [self.centred_on(corner) for corner in (self._low, self._high)]
        self.centre = self.centred_on(np.array(mission.start))

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
        """Least and greatest corner (3,), m."""
        middle = np.array(self.centre) * self._resolution
        low, high = self._low.copy(), self._high.copy()
        low[:2] = np.maximum(low[:2], middle - self._half)
        high[:2] = np.minimum(high[:2], middle + self._half)
        return low, high

    @property
    def inner(self) -> tuple[Array, Array]:
        """Corners (2,) of the part in which a goal may lie, m.

        At an end of the area that is its border, though the last centre may leave half a cell.
        """
        low, high = self.corners
        at_low, at_high = (np.equal(self.centre, end) for end in self._ends)
        least = np.where(at_low, self._low[:2], low[:2] + INSET)
        greatest = np.where(at_high, self._high[:2], high[:2] - INSET)
        return least, greatest

    def centred_on(self, position: Array) -> Cell:
        """Return the centre nearest to a position (3,), m, with the window within the area."""
        least, greatest = self._low[:2] + self._half, self._high[:2] - self._half
        place = np.minimum(np.maximum(position[:2], least), greatest)
        x, y = np.rint(place / self._resolution).astype(np.int64).tolist()
        return int(x), int(y)


def _extent(mission: Mission) -> Array:
    extent: Array = np.subtract(mission.high, mission.low)[:2]
    return extent
