"""OctoMap behind the interface of the voxel map, by its Python binding: a peer to compare with."""

from __future__ import annotations

import hashlib
import importlib
import struct
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wayproof.kernel_compiler import allocating
from wayproof.maps.cell_sets import CellMask
from wayproof.maps.columns import WORD_BITS, pack
from wayproof.maps.config import MapConfig
from wayproof.maps.elementary import exponentials
from wayproof.maps.grid import FLOOR_HEIGHT_IN_CELL, cells_at, centres
from wayproof.maps.representation import Representation, refuse_unsupported
from wayproof.maps.states import FREE, OCCUPIED, STATE_NAMES
from wayproof.maps.sweep import Ranges, Spared, SweepStatistics, check_time, prepare_sweep
from wayproof.maps.voxel.endpoints import BeamRanges
from wayproof.maps.voxel.log_odds import states_of

UNITS = 1000
"""Units to one of log-odds; OctoMap holds them as single precision floats."""

TREE_DEPTH = 16
HALF_TREE = 1 << (TREE_DEPTH - 1)
"""An octree's cells along each axis to either side of 0."""

NODE_BYTES = 5  # of a written tree: log-odds as a float, and one bit for each child
BLOCK = 16  # cells along the edge of a block, which carries the time of its last observation
NEIGHBOURS = 4  # cells along the edge of a cube in which one beam's end stands for all
DISCRETIZE = (
    True  # of `insertPointCloud`. Beams that end in the same cell are one, as VoxelMap has it.
)


class OctoMap(Representation):
    """A map of log-odds in an octree (Hornung et al. 2013, "OctoMap", Autonomous Robots 34).

    Sweeps go through OctoMap's own `insertPointCloud`: as in VoxelMap, each cell is updated once a
    sweep and occupied wins over free. Differences: a beam that grazes a surface erases cells of
    it that others did not hit; a beam without a return leaves its last cell as it was; and of a
    rolling sweep the beams of each origin are a sweep of their own.

    Leaves are never merged: that is faster, and trees of equal content are then of equal form.

    Attributes:
        config: The settings.
        resolution: Edge of a cell, m.
    """

    decays = False

    def __init__(
        self,
        config: MapConfig,
        low: ArrayLike | None = None,
        high: ArrayLike | None = None,
    ) -> None:
        """Make an unknown map of all that beams reach: the corners are ignored.

        Raises:
            ValueError: pyoctomap is not installed, or the half-life is not 0: OctoMap has no decay.
        """
        refuse_unsupported(type(self), config)
        self.config = config
        self.resolution = config.resolution
        self._tree = _empty_tree(config)
        self._observed_ns: dict[int, int] = {}  # by the name of a block
        self._boxes: list[NDArray[np.int64]] = []  # of cells, one for each update so far
        self._read_at = -1  # number of updates when the leaves were last read
        self._leaves()  # compiles

    def integrate(
        self,
        origins: ArrayLike,
        directions: NDArray[np.float64],
        ranges_mm: Ranges,
        range_limit: float,
        time_ns: int,
        moments: NDArray[np.int32] | None = None,
        spared: Spared = "floor",
    ) -> SweepStatistics:
        """Take in one sweep, as `VoxelMap.integrate` does.

        Returns:
            Statistics of the sweep; `cells_updated` is 0, as OctoMap does not report it.

        Raises:
            ValueError: As there; or the beams leave the tree.
        """
        del spared  # its castRay spares none, as occupied wins within a sweep
        check_time(time_ns)
        sweep = prepare_sweep(
            origins,
            moments,
            directions,
            ranges_mm,
            range_limit,
            self.config.minimum_range,
            self.resolution,
        )
        ranges, sources = BeamRanges.of_sweep(sweep), sweep.sources
        starts, informative = sweep.origins[sources], ranges.informative
        self._check_reach(sweep.origins, range_limit)
        self.advance(time_ns)
        # OctoMap clears toward a point beyond its maximum range, up to that range.
        far = np.where(ranges.returned, ranges.metres, 2.0 * range_limit)
        points = starts + sweep.directions * far[:, None]
        for moment in np.unique(sources[informative]):
            own = self._in_tree(points[informative & (sources == moment)])
            start = self._in_tree(sweep.origins[moment])
            self._tree.insertPointCloud(own, start, range_limit, True, DISCRETIZE)
        ends = starts + sweep.directions * ranges.metres[:, None]
        self._note(starts[informative], ends[informative], time_ns)
        return SweepStatistics(*ranges.count, 0)

    def mark(self, cells: CellMask, state: int, time_ns: int) -> None:
        """Lower cells by one miss, or raise them by one hit, as `VoxelMap.mark` does."""
        self.advance(time_ns)
        points = centres(cells.cells(), self.resolution)
        points = points[self.state_at(points) != (OCCUPIED if state == FREE else FREE)]
        step = -self.config.log_odds_miss if state == FREE else self.config.log_odds_hit
        self._tree.updateNodes(self._in_tree(points).tolist(), step, True)
        self._note(points, points, time_ns)

    def advance(self, time_ns: int) -> None:
        """Do nothing: OctoMap has no decay."""
        check_time(time_ns)

    def columns(
        self, low_cell: tuple[int, int, int], shape: tuple[int, int, int]
    ) -> tuple[NDArray[np.uint64], NDArray[np.uint64]]:
        """Return the occupied and free cells of a box, each (nx, ny, words): z = 64 word + bit."""
        nx, ny, words = shape
        box = self._box(low_cell, (nx, ny, WORD_BITS * words))
        return pack(box > 0), pack(box < 0)

    def changed(self, since: int) -> tuple[NDArray[np.int64], int]:
        """Return boxes (k, 6) of cells that may have changed since a stamp, and a new stamp."""
        return np.array(self._boxes[since:], np.int64).reshape(-1, 6), len(self._boxes)

    def state_at(self, points: ArrayLike) -> NDArray[np.uint8]:
        """Return the state at points (n, 3), m, world: (n,)."""
        return states_of(self._values_at(points))

    def probability_at(self, points: ArrayLike) -> NDArray[np.float64]:
        """Return the probability of occupancy (n,) at points (n, 3), m, world; 0.5 if unknown."""
        odds: NDArray[np.float64] = exponentials(self._values_at(points) / UNITS)
        return odds / (1.0 + odds)

    def observed_ns_at(self, points: ArrayLike) -> NDArray[np.int64]:
        """Return when the blocks of points (n, 3), m, were last observed: (n,) ns; -1 never.

        OctoMap does not store it. It is noted here for each block of 16 x 16 x 16 cells that a beam
        was in at one of its steps of half a block.
        """
        blocks = _names(cells_at(points, self.resolution)[0] // BLOCK)
        return np.array([self._observed_ns.get(name, -1) for name in blocks.tolist()], np.int64)

    def version(self) -> str:
        """Hash geometry and log-odds to 32 hex digits: maps of equal content share them."""
        names, values = self._leaves()
        digest = hashlib.blake2b(struct.pack("<d", self.resolution), digest_size=16)
        digest.update(names[values != 0].astype("<i8").tobytes())
        digest.update(values[values != 0].astype("<i2").tobytes())
        return digest.hexdigest()

    def counts(self) -> dict[str, int]:
        """Return the number of free and of occupied cells by the name of their state."""
        states = states_of(self._leaves()[1])
        return {STATE_NAMES[state]: int((states == state).sum()) for state in (FREE, OCCUPIED)}

    def memory_bytes(self) -> int:
        """Return the bytes of the nodes by OctoMap's own count."""
        return int(self._tree.memoryUsage())

    def _check_reach(self, starts: NDArray[np.float64], range_limit: float) -> None:
        limit = (HALF_TREE - 1) * self.resolution - 2.0 * range_limit
        if not np.all(np.abs(self._in_tree(starts)) < limit):
            raise ValueError(f"origin: got one beyond {limit:g} m, where OctoMap's tree ends")

    def _note(self, starts: NDArray[np.float64], ends: NDArray[np.float64], time_ns: int) -> None:
        """Note where beams went, each (n, 3) m, world, and when."""
        if len(ends) == 0:
            return
        cells = cells_at(np.concatenate([starts, ends]), self.resolution)[0]
        self._boxes.append(np.concatenate([cells.min(axis=0), cells.max(axis=0) + 1]))
        # Beams that end side by side are followed once.
        _, kept = np.unique(_names(cells[len(starts) :] // NEIGHBOURS), return_index=True)
        starts, ends = starts[kept], ends[kept]
        longest = np.sqrt(np.square(ends - starts).sum(axis=1).max())
        steps = int(np.ceil(longest / (0.5 * BLOCK * self.resolution)))
        for share in np.arange(steps + 1) / max(steps, 1):
            cells, _ = cells_at(starts + share * (ends - starts), self.resolution)
            for name in np.unique(_names(cells // BLOCK)).tolist():
                self._observed_ns[name] = max(self._observed_ns.get(name, -1), time_ns)

    def _in_tree(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Move points (..., 3) to OctoMap's frame: its cells start at z = 0, ours below."""
        shifted: NDArray[np.float64] = points + np.array(
            [0.0, 0.0, FLOOR_HEIGHT_IN_CELL * self.resolution]
        )
        return shifted

    def _box(self, first: ArrayLike, shape: tuple[int, int, int]) -> NDArray[np.int16]:
        """Return log-odds of a box of cells from `first` (3,) on, thousandths, 0 where unknown."""
        names, values = self._leaves()
        cells = _cells(names) - np.asarray(first)
        inside = np.all((cells >= 0) & (cells < shape), axis=1)
        box = np.zeros(shape, np.int16)
        box[tuple(cells[inside].T)] = values[inside]
        return box

    def _values_at(self, points: ArrayLike) -> NDArray[np.int16]:
        """Return log-odds at points (n, 3), m, world: (n,) thousandths, 0 where unknown."""
        names, values = self._leaves()
        names_at = _names(cells_at(points, self.resolution)[0])
        if len(names) == 0:
            return np.zeros(len(names_at), np.int16)
        places = np.searchsorted(names, names_at).clip(max=len(names) - 1)
        return np.where(names[places] == names_at, values[places], np.int16(0))

    def _leaves(self) -> tuple[NDArray[np.int64], NDArray[np.int16]]:
        """Return names (k,) of the tree's cells in order, and their log-odds (k,) in thousandths.

        The binding has no faster way to more than one cell than the file that it would write.
        """
        if self._read_at != len(self._boxes):
            written = self._tree.write()
            nodes = np.frombuffer(written, np.uint8, offset=written.index(b"\ndata\n") + 6).copy()
            names = np.empty(len(nodes) // NODE_BYTES, np.int64)
            places = np.empty(len(names), np.int64)
            count = find_leaves(nodes, names, places)
            log_odds = nodes[places[:count, None] + np.arange(4)].view("<f4")[:, 0]
            order = np.argsort(names[:count], kind="stable")
            self._leaf_names = names[order]
            self._leaf_values = np.rint(UNITS * log_odds[order]).astype(np.int16)
            self._read_at = len(self._boxes)
        return self._leaf_names, self._leaf_values


@allocating
def find_leaves(
    nodes: NDArray[np.uint8],  # (5 n,) a written tree: depth first, a node before its children
    names: NDArray[np.int64],  # (n,) out: of the cell that a leaf is
    places: NDArray[np.int64],  # (n,) out: of its log-odds among the bytes
) -> int:
    """Find the leaves, all of them one cell large; return their number."""
    waiting = np.empty((8 * TREE_DEPTH, 2), np.int64)  # name and depth of nodes to come
    waiting[0] = 0
    top = 1 if nodes.shape[0] > 0 else 0
    place = 0
    count = 0
    while top > 0:
        top -= 1
        name, depth = waiting[top]
        if depth == TREE_DEPTH:
            names[count] = name
            places[count] = place
            count += 1
        children = np.int64(nodes[place + NODE_BYTES - 1])
        below = TREE_DEPTH - 1 - depth
        for child in range(7, -1, -1):  # the first child ends up on top
            if children >> child & 1:
                x, y, z = child & 1, child >> 1 & 1, child >> 2
                waiting[top, 0] = name | ((x << 32 | y << 16 | z) << below)
                waiting[top, 1] = depth + 1
                top += 1
        place += NODE_BYTES
    return count


def _empty_tree(config: MapConfig) -> Any:
    """Return an octree with the map's steps and clamps.

    Raises:
        ValueError: pyoctomap is not installed.
    """
    try:
        pyoctomap = importlib.import_module("pyoctomap")
    except ModuleNotFoundError:
        raise ValueError(
            "map.kind: got 'octomap', expected pyoctomap to be installed (the extra 'dev')"
        ) from None
    tree = pyoctomap.OcTree(config.resolution)
    at_hit, at_miss = 1.0 / (
        1.0 + exponentials(np.array([-config.log_odds_hit, config.log_odds_miss]))
    )
    tree.setProbHit(float(at_hit))
    tree.setProbMiss(float(at_miss))
    tree.setClampingThresMin(config.prob_min)
    tree.setClampingThresMax(config.prob_max)
    return tree


def _names(cells: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return a number (k,) for each cell (k, 3), 16 bits an axis; -1 outside a tree."""
    inside = np.all((cells >= -HALF_TREE) & (cells < HALF_TREE), axis=1)
    x, y, z = (cells + HALF_TREE).T
    return np.where(inside, x << 32 | y << 16 | z, -1)


def _cells(names: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the cells (k, 3) of names (k,)."""
    return np.stack([names >> 32, names >> 16 & 0xFFFF, names & 0xFFFF], axis=1) - HALF_TREE
