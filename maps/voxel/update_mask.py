"""Rasterization of sweeps and shapes: masks of the cells to update, in a window of columns."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wayproof.maps.columns import pack
from wayproof.maps.grid import FLOOR_LAYER
from wayproof.maps.kernels import beam_targets, beams, bricks, carve, update
from wayproof.maps.kernels.beam_columns import MAX_STEPS
from wayproof.maps.kernels.early_stop import SLOPES
from wayproof.maps.sweep import Spared, Sweep
from wayproof.maps.voxel.sweep_endpoints import EndpointFinder, Frame, SweepEndpoints, cell_of

SPREAD = np.argsort(
    [0, 63, *(32 // n * (2 * k + 1) for n in (1, 2, 4, 8, 16, 32) for k in range(n))][:64],
    kind="stable",
)
"""The place of each sector of a wedge in the order in which they are carved."""


@dataclass(frozen=True)
class UpdateMask:
    """The cells that a sweep or a shape marks, in a dense window of whole bricks.

    Attributes:
        bricks: (k, 3) indices of the bricks that hold any.
        offsets: (k,) first word of each in the window.
        strides: Words from column to column along x and y.
        hits: (words,) a bit for each cell to be raised.
        misses: (words,) a bit for each cell to be lowered, where it is not to be raised.
    """

    bricks: NDArray[np.int32]
    offsets: NDArray[np.int64]
    strides: tuple[int, int]
    hits: NDArray[np.uint64]
    misses: NDArray[np.uint64]

    def take(self) -> tuple[NDArray[np.uint64], NDArray[np.uint64]]:
        """Return the bits of hits and misses, each (k, 256) words by brick, and clear them."""
        row = np.arange(bricks.EDGE)
        columns = row[:, None] * self.strides[0] + row * self.strides[1]  # (16, 16)
        words = self.offsets[:, None] + columns.reshape(-1)  # (k, 256)
        hits, misses = self.hits[words], self.misses[words]
        self.hits[words] = self.misses[words] = 0
        return hits, misses


class SweepRasterizer:
    """A dense window of columns that follows the sensor; its memory is used again."""

    def __init__(self, bounds: NDArray[np.int64] | None = None) -> None:
        """Make a rasterizer without extent.

        Args:
            bounds: (2, 3) least and greatest cell that may be marked; None for no bounds.
        """
        self._bounds = bounds
        self._hits, self._misses, self._aims, self._grazes = np.zeros((4, 0), np.uint64)
        self._flags = np.zeros(0, np.uint8)
        self._finder = EndpointFinder(bounds)
        self._targets = _new_targets(0)
        self._columns, self._order = np.empty((2, 0), np.int32)

    @property
    def nbytes(self) -> int:
        """Bytes that the masks hold."""
        masks = (self._hits, self._aims, self._grazes, self._flags, self._misses)
        return sum(mask.nbytes for mask in masks)

    def endpoints(self, sweep: Sweep) -> SweepEndpoints:
        """Find the endpoints of a sweep; nothing is marked.

        Raises:
            ValueError: A direction is not of unit length, or the beams span too much space.
        """
        return self._finder.find(sweep)

    def trace(self, sweep: Sweep, endpoints: SweepEndpoints, spared: Spared) -> UpdateMask:
        """Mark the cells that the beams hit and cross.

        Args:
            sweep: The beams.
            endpoints: Their endpoints.
            spared: Layer that beams from above which end in it do not clear.
        """
        frame = endpoints.frame
        nx, ny, words = frame.shape
        self._reserve(nx * ny, words)
        guarded = self._guarded_layer(spared, frame)
        window = beam_targets.Window(frame.shape, frame.box_within(endpoints.box), guarded)
        corner = [(2 * cell << beams.SUBCELL_BITS) - 1 for cell in frame.corner]
        sensors = 2 * sweep.sensors - np.array(corner)
        self._carve(self._mark_ends(endpoints, sensors, window), sensors, window)
        return self._collect(frame)

    def _guarded_layer(self, spared: Spared, frame: Frame) -> int:
        """Return the layer of a frame that is spared; makes room to note which beams graze."""
        nx, ny, words = frame.shape
        if spared == "own":
            if len(self._grazes) < nx * ny * words:
                self._grazes = np.zeros(nx * ny * words, np.uint64)
            return beam_targets.OWN_LAYER
        layer = FLOOR_LAYER - frame.corner[2]
        return layer if spared == "floor" and 0 <= layer < 64 * words else beam_targets.NO_LAYER

    def _mark_ends(
        self, endpoints: SweepEndpoints, sensors: NDArray[np.int64], window: beam_targets.Window
    ) -> NDArray[np.int64]:
        """Mark the cells that beams hit, and order the cells that they have to be traced to.

        Args:
            endpoints: Endpoints of the beams.
            sensors: (m, 3) positions of the sensor, 1/1024 of a cell from the corner of the window.
            window: Window that is marked.

        Returns:
            (w, 3) wedges about the sensor: first and one past the last of the ordered targets of
            each, and its sensor.
        """
        most = len(endpoints.ends)
        if len(self._order) < most:  # new memory would be cleared again by the system
            self._targets = _new_targets(most)
            self._columns, self._order = np.empty((2, most), np.int32)
        groups = np.empty(len(sensors) + 1, np.int64)
        beam_targets.list_targets(
            endpoints.ends,
            sensors,
            window,
            SPREAD,
            beam_targets.EndMasks(self._hits, self._aims, self._grazes, self._flags, self._columns),
            self._targets,
            groups,
        )
        count = min(int(groups[-1]), beam_targets.WEDGES * len(sensors))
        wedges = np.empty((count, 3), np.int64)
        starts = np.empty(beam_targets.SECTORS + 1, np.int64)
        used = beam_targets.order_targets(self._targets.ranks, groups, starts, self._order, wedges)
        return wedges[:used]

    def _carve(
        self, wedges: NDArray[np.int64], sensors: NDArray[np.int64], window: beam_targets.Window
    ) -> None:
        """Mark the cells that the beams cross on their way, wedge by wedge."""
        # An array made in a kernel takes longer to compile than the kernel's own arithmetic.
        steps = MAX_STEPS + 1
        scratch = carve.CarveScratch(
            fractions=np.empty(steps, np.int64),
            columns=np.empty(steps, np.int64),
            lower=np.empty(steps, np.int64),
            upper=np.empty(steps, np.int64),
            marked=np.empty(SLOPES, np.int64),
            masks=np.empty(steps, np.uint64),
            runs=np.empty((carve.MAX_RUNS * window.shape[2], 3), np.int64),
        )
        carve.carve(self._targets, self._order, wedges, sensors, window, scratch, self._misses)

    def fill(self, first: NDArray[np.int64], cells: NDArray[np.bool_], raised: bool) -> UpdateMask:
        """Mark cells of an array (nx, ny, nz), whose least one is `first`, as hit or as free."""
        first, cells = self._within(first, cells)
        last = first + np.maximum(cells.shape, 1) - 1
        frame = Frame.around(cell_of(first.tolist()), cell_of(last.tolist()))
        nx, ny, words = frame.shape
        self._reserve(nx * ny, words)
        dense = np.zeros((nx, ny, 64 * words), np.bool_)
        inside = tuple(
            slice(int(a), int(a) + n)
            for a, n in zip(first - frame.corner, cells.shape, strict=True)
        )
        dense[inside] = cells
        masks = self._hits if raised else self._misses
        masks[: nx * ny * words] = pack(dense).reshape(-1)
        return self._collect(frame)

    def _within(
        self, first: NDArray[np.int64], cells: NDArray[np.bool_]
    ) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
        """Return the part of a box of cells that lies within the bounds."""
        if self._bounds is None:
            return first, cells
        low, high = np.clip(self._bounds + np.array([[0], [1]]) - first, 0, cells.shape)
        part = tuple(slice(int(a), int(b)) for a, b in zip(low, high, strict=True))
        return np.clip(first, *self._bounds), cells[part]

    def _reserve(self, columns: int, words: int) -> None:
        if len(self._hits) < columns * words:
            self._hits, self._misses, self._aims = (
                np.zeros(columns * words, np.uint64) for _ in range(3)
            )
        if len(self._flags) < columns:
            self._flags = np.zeros(columns, np.uint8)

    def _collect(self, frame: Frame) -> UpdateMask:
        """List the bricks that hold any marks."""
        nx, ny, words = shape = frame.shape
        touched = np.zeros((nx // bricks.EDGE, ny // bricks.EDGE, words), np.bool_)
        update.find_touched(self._hits, self._misses, shape, touched)
        keys, offsets = np.empty((touched.size, 3), np.int32), np.empty(touched.size, np.int64)
        count = update.list_touched(touched, frame.first, keys, offsets)
        return UpdateMask(
            bricks=keys[:count],
            offsets=offsets[:count],
            strides=(ny * words, words),
            hits=self._hits,
            misses=self._misses,
        )


def _new_targets(count: int) -> beam_targets.Targets:
    """Return memory for targets."""
    return beam_targets.Targets(
        np.empty((count, 5), np.int32), np.empty(count, np.uint64), np.empty(count, np.int32)
    )
