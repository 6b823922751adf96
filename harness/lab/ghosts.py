"""Cells that something left: how many sweeps after the last hit they are free again."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wayproof.harness.inputs import WorldSweep
from wayproof.maps import FREE, OCCUPIED, Representation


class GhostWatch:
    """Watch of the cells of one map that a sweep has hit and that were occupied then.

    Attributes:
        cleared: Sweeps from the last hit to the sweep after which the cell was free, one entry each
            time that a cell became free.
    """

    def __init__(self, size: float) -> None:
        """Start before the first sweep.

        Args:
            size: Cells of the map, m.
        """
        self.cleared: list[int] = []
        self._size = size
        self._hit: dict[tuple[int, ...], int] = {}  # cell -> number of the sweep that last hit it
        self._points: dict[tuple[int, ...], NDArray[np.float64]] = {}
        self._sweep = 0

    def watch(self, sweep: WorldSweep, range_m: float, a_map: Representation) -> None:
        """Look at the watched cells after a sweep was integrated.

        Args:
            sweep: The sweep.
            range_m: Returns beyond do not count, m.
            a_map: The map that holds it.
        """
        self._sweep += 1
        self._leave(a_map)
        points = sweep.points_within(range_m)
        cells = np.floor(points / self._size).astype(np.int64)
        _, first = np.unique(cells, axis=0, return_index=True)
        if len(first) == 0:
            return
        occupied = a_map.state_at(points[first]) == OCCUPIED
        for index in first[occupied].tolist():
            cell = tuple(cells[index].tolist())
            self._hit[cell] = self._sweep
            self._points.setdefault(cell, points[index])

    def _leave(self, a_map: Representation) -> None:
        """Note the watched cells that are free now, and watch them no more."""
        if not self._points:
            return
        names = list(self._points)
        free = a_map.state_at(np.array([self._points[name] for name in names])) == FREE
        for place in np.flatnonzero(free).tolist():
            self.cleared.append(self._sweep - self._hit.pop(names[place]))
            del self._points[names[place]]
