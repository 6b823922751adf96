"""What a voxel map answers: states, probabilities, columns of bits, changes, rays and counts."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wayproof.maps.config import MapConfig
from wayproof.maps.elementary import norm
from wayproof.maps.grid import cell_box, cells_at, centres, finite_vector
from wayproof.maps.kernels import beams, decay
from wayproof.maps.kernels import bricks as kernels
from wayproof.maps.parallel import ThreadTeam
from wayproof.maps.states import FREE, OCCUPIED, STATE_NAMES, UNKNOWN
from wayproof.maps.voxel.bricks import Bricks
from wayproof.maps.voxel.log_odds import LogOddsModel
from wayproof.maps.voxel.update_mask import brick_cells, unpack_bits

BLOCK_US = 4.0  # about, to write the columns of a brick


@dataclass(frozen=True)
class RayEnd:
    """Where a ray through the map ends.

    Attributes:
        state: Of the cell that stopped it: occupied or unknown.
        distance: To where it enters that cell, m.
        point: (3,) that place, m, world.
    """

    state: int
    distance: float
    point: NDArray[np.float64]


class VoxelQueries:
    """The questions that a `VoxelMap` answers; none of them changes it.

    Attributes:
        config: The settings.
        resolution: Edge of a cell, m.
        evidence: Steps and clamps in units.
    """

    config: MapConfig
    resolution: float
    evidence: LogOddsModel
    _team: ThreadTeam
    _bricks: Bricks
    _losses: NDArray[np.uint64]
    _ticks: int
    _stamp: int

    def state_at(self, points: ArrayLike) -> NDArray[np.uint8]:
        """The state at points (n, 3), m, world: (n,)."""
        return _states(self._values_at(points)[0])

    def probability_at(self, points: ArrayLike) -> NDArray[np.float64]:
        """The probability of occupancy at points (n, 3), m, world: (n,); 0.5 where unknown."""
        values, slots = self._values_at(points)
        ticks = np.where(slots >= 0, self._bricks.ticks[slots], self._ticks)
        decay.fade_values(values, ticks, self._ticks, self._losses)
        return self.evidence.probability(values)

    def observed_ns_at(self, points: ArrayLike) -> NDArray[np.int64]:
        """When the bricks of points (n, 3), m, world, were last observed: (n,) ns; -1 never."""
        _, slots = self._values_at(points)
        return np.where(slots >= 0, self._bricks.observed_ns[slots], -1)

    def columns(
        self, low_cell: ArrayLike, shape: tuple[int, int, int]
    ) -> tuple[NDArray[np.uint64], NDArray[np.uint64]]:
        """The states of a window of cells, a bit each.

        Args:
            low_cell: (3,) least cell of the window.
            shape: (nx, ny, words) columns and words of 64 cells along z.

        Returns:
            Occupied and free cells, (nx, ny, words) each: bit k of word w is the cell
            low_z + 64 w + k. One that is neither is unknown.
        """
        occupied, free = np.empty(shape, np.uint64), np.empty(shape, np.uint64)
        x, y, z = (int(cell) for cell in np.ravel(low_cell))
        if occupied.size:
            whole = np.array([[x, y, z, x + shape[0], y + shape[1], z + 64 * shape[2]]])
            # Not a subclass's, which may lay something over them.
            VoxelQueries.rewrite_columns(self, (x, y, z), whole, occupied, free)
        return occupied, free

    def rewrite_columns(
        self,
        low_cell: tuple[int, int, int],
        boxes: NDArray[np.int64],
        occupied: NDArray[np.uint64],
        free: NDArray[np.uint64],
    ) -> None:
        """Write the states of a window of cells anew where they changed.

        Args:
            low_cell: Least cell of the window.
            boxes: (k, 6) where, as `changed` tells; columns of bricks above and below are included.
            occupied: (nx, ny, words) what `columns` told before; brought up to date.
            free: (nx, ny, words) likewise.
        """
        (x, y, _), (nx, ny, _) = low_cell, occupied.shape
        size = [
            ((at + n - 1) >> kernels.EDGE_BITS) - (at >> kernels.EDGE_BITS) + 1
            for at, n in ((x, nx), (y, ny))
        ]
        touched, blocks = np.zeros(size, np.bool_), np.empty((math.prod(size), 2), np.int64)
        count = kernels.list_blocks(boxes, low_cell, (nx, ny), touched, blocks)
        bricks = self._bricks

        def write(_: int, part: tuple[int, int]) -> None:
            kernels.rewrite_columns(
                *bricks.directory,
                bricks.eights,
                bricks.settled,
                blocks,
                part,
                low_cell,
                occupied,
                free,
            )

        self._team.parallel_for(write, count, 3, BLOCK_US)

    def changed(self, since: int) -> tuple[NDArray[np.int64], int]:
        """Where states changed since an earlier call.

        Args:
            since: What that call returned as `now`; 0 for everything that is held.

        Returns:
            Boxes of cells (k, 6) as [x0, y0, z0, x1, y1, z1), one for each brick, and `now`. A box
            may also hold a state that changed and changed back. One box of all space is told if
            since then more bricks were given up than are remembered (65536).
        """
        return self._bricks.changed(since), self._stamp

    def states_in(self, low: ArrayLike, high: ArrayLike) -> NDArray[np.uint8]:
        """States (nx, ny, nz) of the cells whose centres lie in a box, corners (3,) m, world."""
        first, end = cell_box(low, high, self.resolution)
        nx, ny, nz = (int(n) for n in end - first)
        occupied, free = self.columns(first, (nx, ny, -(-nz // 64)))
        states = unpack_bits(free) * np.uint8(FREE) + unpack_bits(occupied) * np.uint8(OCCUPIED)
        return np.ascontiguousarray(states[:, :, :nz])

    def cast_ray(
        self,
        origin: ArrayLike,
        direction: ArrayLike,
        max_range: float,
        stop_at_unknown: bool = False,
    ) -> RayEnd | None:
        """Follow a ray to the first occupied cell, or the first that is unknown as well.

        Args:
            origin: (3,) m, world.
            direction: (3,) of any length but 0, world.
            max_range: m.
            stop_at_unknown: Whether an unknown cell stops it.

        Returns:
            Where it ends; None if nothing stops it within the range.

        Raises:
            ValueError: The ray is not finite, or the range is not more than 0 and at most 1e6 m.
        """
        start, toward = finite_vector("origin", origin), finite_vector("direction", direction)
        length = norm(toward)
        if length == 0.0 or not 0.0 < max_range <= 1e6:
            raise ValueError(f"ray: got length {length:g} and range {max_range:g}, expected more")
        toward /= length
        scaled = start / self.resolution + [0.0, 0.0, beams.FLOOR_SUBCELLS / beams.SUBCELLS]
        bricks = self._bricks
        reach = max_range / self.resolution
        distance, state = kernels.walk(
            *bricks.directory, bricks.cells, scaled, toward, reach, stop_at_unknown
        )
        if state == FREE:
            return None
        return RayEnd(
            state, distance * self.resolution, start + distance * self.resolution * toward
        )

    def is_free_along(self, start: ArrayLike, end: ArrayLike) -> bool:
        """Whether every cell on the line between two points (3,), m, world, is free."""
        way = finite_vector("end", end) - finite_vector("start", start)
        length = norm(way)
        if length == 0.0:
            return bool(self.state_at(np.reshape(start, (1, 3)))[0] == FREE)
        return self.cast_ray(start, way, length, stop_at_unknown=True) is None

    def occupied_centres(self) -> NDArray[np.float64]:
        """Centres of all occupied cells, (n, 3) m, world, by brick and then by cell."""
        bricks = self._bricks
        live = bricks.live()
        live = live[np.lexsort(bricks.keys[live].T[::-1])]
        parts = [np.empty((0, 3), np.int64)]
        for slot in live:
            column, z = np.nonzero(bricks.cells[slot] > 0)
            cells = np.stack([column >> kernels.EDGE_BITS, column & (kernels.EDGE - 1), z], axis=1)
            parts.append(cells + brick_cells(bricks.keys[slot]))
        return centres(np.concatenate(parts), self.resolution)

    def counts(self) -> dict[str, int]:
        """Number of free and of occupied cells by the name of their state."""
        live = self._bricks.live()
        cells = self._bricks.cells
        free = sum(int(np.count_nonzero(cells[slot] < 0)) for slot in live)
        occupied = sum(int(np.count_nonzero(cells[slot] > 0)) for slot in live)
        return {STATE_NAMES[FREE]: free, STATE_NAMES[OCCUPIED]: occupied}

    def rounding(self) -> dict[str, tuple[float, float]]:
        """What whole units make of the settings: by name the value asked and the one in effect."""
        return self.evidence.rounding(self.config)

    def _values_at(self, points: ArrayLike) -> tuple[NDArray[np.int8], NDArray[np.int64]]:
        """Log-odds at points (n, 3) as their bricks hold them, and the slots of these."""
        cells, inside = cells_at(points, self.resolution)
        values, slots = np.empty(len(cells), np.int8), np.empty(len(cells), np.int64)
        kernels.look_up(*self._bricks.directory, self._bricks.cells, cells, slots, values)
        values[~inside], slots[~inside] = 0, -1
        return values, slots


def _states(values: NDArray[np.int8]) -> NDArray[np.uint8]:
    """The sign of the log-odds is the state: 0 unknown, 1 free, 2 occupied."""
    states: NDArray[np.uint8] = np.where(values < 0, FREE, np.where(values > 0, OCCUPIED, UNKNOWN))
    return states.astype(np.uint8)
