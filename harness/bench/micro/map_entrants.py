"""Maps compared by `bench map`: ours in a mode, and OctoMap in each of its own."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wayproof.harness.bench.micro.map_workload import SWEEP_NS, Sweep
from wayproof.maps import MapConfig, VoxelMap

SETTLING = 1  # sweeps before the timed ones
REQUESTS = 64  # of memory, until the allocator has sorted what OctoMap freed: 10,000 pieces at each


@dataclass
class Ours:
    """Our map in one mode."""

    name: str
    threads: int
    config: MapConfig
    range_limit: float
    library: str = "wayproof"
    clock: Callable[[], float] = time.perf_counter
    _ms: list[float] = field(default_factory=list)

    def __post_init__(self) -> None:
        self._map = VoxelMap(self.config, self.threads)

    def take(self, sweep: Sweep, number: int) -> None:
        """Integrate a sweep and note the time."""
        started = self.clock()
        integrate(self._map, sweep, number, self.range_limit)
        self._ms.append((self.clock() - started) * 1e3)

    def timed(self, after: int = SETTLING) -> list[float]:
        """Time of each sweep after the first ones, ms."""
        return self._ms[after:]

    def memory_bytes(self) -> int:
        """Return the memory of the map, MiB."""
        return int(self._map.memory_bytes())


def _as_they_are(points: NDArray[np.float64], resolution: float) -> NDArray[np.float64]:
    return points


def _first_in_each_cell(points: NDArray[np.float64], resolution: float) -> NDArray[np.float64]:
    _, first = np.unique(packed(np.floor(points / resolution)), return_index=True)
    return points[first]


Thinning = Callable[[NDArray[np.float64], float], NDArray[np.float64]]

THINNING: dict[str, tuple[Thinning, bool]] = {
    "discretize": (_as_they_are, True),
    "deduplicate": (_first_in_each_cell, False),
}
"""Modes in which the peer gets one point for each cell: by a loop in its binding, or from numpy
beforehand. Both update inner nodes lazily, its fastest mode, before any query."""


@dataclass
class OctoMap:
    """The peer in one mode, called as its documentation says and not through our interface."""

    name: str
    resolution: float
    range_limit: float
    library: str = "pyoctomap"
    threads: int = 1
    clock: Callable[[], float] = time.perf_counter
    _ms: list[float] = field(default_factory=list)

    def __post_init__(self) -> None:
        pyoctomap = import_module("pyoctomap")

        self._thin, self._discretize = THINNING[self.name]
        self._tree = pyoctomap.OcTree(self.resolution)

    def take(self, sweep: Sweep, number: int) -> None:
        """Insert a sweep and note the time; points made from ranges beforehand are not timed."""
        clears = sweep.ranges_mm > round(1000 * self.range_limit)
        lengths = np.where(clears, 2.0 * self.range_limit, sweep.ranges_mm / 1000.0)
        points = sweep.origin + sweep.directions * lengths[:, None]
        started = self.clock()
        points = self._thin(points, self.resolution)
        self._tree.insertPointCloud(points, sweep.origin, self.range_limit, True, self._discretize)
        self._ms.append((self.clock() - started) * 1e3)
        # Some 100,000 freed pieces are left to sort, 15 ms in the sweep of the next map.
        _ = [np.empty(20_000) for _ in range(REQUESTS)]

    def timed(self, after: int = SETTLING) -> list[float]:
        """Time of each sweep after the first ones, ms."""
        return self._ms[after:]

    def memory_bytes(self) -> int:
        """Return the memory of the map, MiB."""
        return int(self._tree.memoryUsage())


def integrate(voxel_map: Any, sweep: Sweep, number: int, range_limit: float) -> int:
    """Integrate a sweep at its time; return how many cells it updated."""
    statistics = voxel_map.integrate(
        sweep.origin, sweep.directions, sweep.ranges_mm, range_limit, number * SWEEP_NS
    )
    return int(statistics.cells_updated)


def packed(cells: NDArray[np.float64]) -> NDArray[np.int64]:
    """Return one number for each cell (n, 3): (n,)."""
    x, y, z = cells.astype(np.int64).T
    packed: NDArray[np.int64] = (x << 40) + (y << 20) + z
    return packed
