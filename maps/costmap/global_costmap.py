"""The global costmap: coarse cells over a whole extent, for ways that leave a costmap's window."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wayproof.maps.columns import WORD_BITS, ColumnMap, Window, layer_bits, pack, unpack
from wayproof.maps.costmap.distance_field import DistanceField
from wayproof.maps.costmap.projection import Projection

BLOCKED, UNSEEN, PASSABLE = 0, 1, 2
"""States of a coarse cell: no place in it for the body; none known to be free; one known to be."""

TILE = 128
"""About, side of the tiles that are computed together, cells of the map."""


class GlobalCostmap:
    """States of coarse cells for one body: whether its centre has a place somewhere in each.

    A coarse cell is as wide as the inflation radius or a little less. So of a wall, which is
    inflated to both sides, it holds a whole blocked cell, and a way through it is not invented;
    while a passage that lets the body through by a single cell of the map is never lost. What is
    unknown counts as passable, as for a global path.

    In the air a column is blocked where no stretch of its altitudes, as high as the body, is free
    of what is occupied; what blocks is then inflated in the plane. That may let a way pass which a
    path does not find, where an obstacle below stands beside one above.

    The states follow from the map alone, whatever was asked for before. An update works out only
    tiles in which the map has changed.

    Attributes:
        size: Edge of a coarse cell, m.
        origin: (2,) least corner of the first, m, world.
        states: (nx, ny) uint8.
    """

    def __init__(
        self,
        voxel_map: ColumnMap,
        low: ArrayLike,
        high: ArrayLike,
        project: Callable[[Window], Projection],
        collision_distance_sq: int,
        height: float,
    ) -> None:
        """Start with all cells unseen; `update` reads the map.

        Args:
            voxel_map: The map.
            low: (3,) least corner of the extent, m, world.
            high: (3,) greatest corner, m, world.
            project: Makes the projection of a window of the map's cells for the body.
            collision_distance_sq: Greatest forbidden squared distance in the plane, cells^2.
            height: Height of the body, m; in the air only.
        """
        self._map, self._project = voxel_map, project
        self._extent = Window.covering(low, high, voxel_map.resolution, most_cells=1 << 40)
        self._threshold = collision_distance_sq
        self._reach = math.isqrt(collision_distance_sq) + 1  # cells
        self._layers = max(math.ceil(height / voxel_map.resolution), 1)
        self._cells = cells = max(math.isqrt(collision_distance_sq), 1)  # of a coarse one
        self._tile = max(TILE // cells, 1)  # coarse cells
        nx, ny, _ = self._extent.shape
        self.size = cells * voxel_map.resolution
        self.origin: NDArray[np.float64] = self._extent.origin[:2]
        self.states = np.full((-(-nx // cells), -(-ny // cells)), UNSEEN, np.uint8)
        self._stamp = 0

    def update(self) -> None:
        """Bring the states up to date with the map."""
        first = self._stamp == 0
        boxes, self._stamp = self._map.changed(self._stamp)
        tiles = self._touched(boxes)
        if first:  # what lies beside the extent blocks cells that the map knows nothing of
            tiles[[0, -1]] = True
            tiles[:, [0, -1]] = True
        for i, j in np.argwhere(tiles).tolist():
            low = np.array([i, j]) * self._tile
            high = np.minimum(low + self._tile, self.states.shape)
            (x0, y0), (x1, y1) = low.tolist(), high.tolist()
            self.states[x0:x1, y0:y1] = self._states_of(low, high)

    def _touched(self, boxes: NDArray[np.int64]) -> NDArray[np.bool_]:
        """Return the tiles (kx, ky) that boxes (k, 6) of the map's cells may change."""
        shape = tuple(-(-n // self._tile) for n in self.states.shape)
        tiles = np.zeros(shape, np.bool_)
        begin, edge = np.array(self._extent.first[:2]), self._tile * self._cells
        low = (boxes[:, :2] - begin - self._reach) // edge
        high = (boxes[:, 3:5] - begin + self._reach - 1) // edge + 1
        ranges = np.concatenate([low.clip(0, shape), high.clip(0, shape)], axis=1)
        for i0, j0, i1, j1 in np.unique(ranges, axis=0).tolist():
            tiles[i0:i1, j0:j1] = True
        return tiles

    def _states_of(self, low: NDArray[np.int64], high: NDArray[np.int64]) -> NDArray[np.uint8]:
        """Compute the states of a box of coarse cells from the map."""
        reach, cells = self._reach, self._cells
        count = (high - low) * cells
        begin = low * cells - reach
        nx, ny = (count + 2 * reach).tolist()
        x, y, z = self._extent.first
        corner = x + int(begin[0]), y + int(begin[1]), z
        window = Window(self._extent.resolution, corner, (nx, ny, self._extent.shape[2]))
        blocked, free = self._columns_of(self._project(window))
        for axis, extent in enumerate(self._extent.shape[:2]):
            along = begin[axis] + np.arange(blocked.shape[axis])
            outside = (along < 0) | (along >= extent)
            blocked |= outside[:, None] if axis == 0 else outside[None, :]
        field = DistanceField((nx, 1, ny), reach)
        missing = -ny % WORD_BITS
        field.update(pack(np.pad(blocked, ((0, 0), (0, missing)))[:, None]))
        inner = slice(reach, -reach), slice(reach, -reach)
        passable = field.squared[:, 0][inner] > self._threshold
        blocks = (*(n for pair in ((n // cells, cells) for n in count.tolist()) for n in pair),)
        any_passable = passable.reshape(blocks).any(axis=(1, 3))
        any_free = (passable & free[inner]).reshape(blocks).any(axis=(1, 3))
        return np.add(any_passable, any_free, dtype=np.uint8)

    def _columns_of(self, projection: Projection) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        """Return the blocked and the free columns (nx, ny) of a window."""
        projection.read_whole(self._map)
        cells, occupied, free = projection.rows[2], projection.occupied, projection.free
        if projection.shape[2] == 1:  # a row of bits runs along y
            blocked, cleared = (unpack(one, cells)[:, 0] > 0 for one in (occupied, free))
            return blocked, cleared
        open_cells = ~occupied & layer_bits(0, cells, cells)
        length = min(self._layers, cells)
        return ~holds_run(open_cells, length), holds_run(free, length)


def holds_run(words: NDArray[np.uint64], length: int) -> NDArray[np.bool_]:
    """Return whether columns (nx, ny, words) hold a run of set bits of a length, at least one.

    By doubling: n shifts find runs of 2^n bits.
    """
    begins, covered = words, 1  # bits at which a run of so many begins
    while covered < length:
        step = min(covered, length - covered, WORD_BITS - 1)
        later = begins >> np.uint64(step)
        later[:, :, :-1] |= begins[:, :, 1:] << np.uint64(WORD_BITS - step)
        begins = begins & later
        covered += step
    return np.asarray(begins.any(axis=2))
