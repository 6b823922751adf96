"""The cells that a sweep or a shape marks, in a dense window of columns."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from maps import _beam_kernels as beams
from maps import _brick_kernels as bricks
from maps import _carve_kernels as carving
from maps import _update_kernels as update
from maps.grid import FLOOR_LAYER
from maps.sweep import Sweep
from maps.team import Team

MAX_WINDOW_WORDS = 1 << 26
BEAM_US, TARGET_US, WORD_US = 0.01, 0.3, 0.001  # about: to place, to carve, to gather
NO_GUARD = -1

SPREAD = np.argsort(
    [0, 63, *(32 // n * (2 * k + 1) for n in (1, 2, 4, 8, 16, 32) for k in range(n))][:64]
)
"""The place of each sector of a wedge in the order in which they are carved."""


@dataclass(frozen=True)
class Marks:
    """The cells that a sweep or a shape marks, in a dense window of whole bricks.

    Attributes:
        bricks: (k, 3) indices of the bricks that hold any.
        places: (k,) first word of each in the window.
        strides: Words from column to column along x and y.
        hits: (words,) a bit for each cell to be raised.
        free: (words,) a bit for each cell to be lowered, where it is not to be raised.
    """

    bricks: NDArray[np.int32]
    places: NDArray[np.int64]
    strides: tuple[int, int]
    hits: NDArray[np.uint64]
    free: NDArray[np.uint64]

    def take_free(self) -> NDArray[np.uint64]:
        """The cells to be lowered, (k, 256) words by brick and column; they are marked no more."""
        row = np.arange(bricks.EDGE)
        columns = row[:, None] * self.strides[0] + row * self.strides[1]  # (16, 16)
        words = self.places[:, None] + columns.reshape(-1)  # (k, 256)
        bits = self.free[words]
        self.free[words] = 0
        return bits


@dataclass(frozen=True)
class Placed:
    """Where the beams of a sweep end.

    Attributes:
        ends: (n, 5) cell, fate and origin of those that tell anything; used again for each sweep.
        parts: (p, 2) first and one past the last of those that are listed.
        counts: (4,) beams by fate.
        box: (2, 3) least and greatest cell of all beams within the bounds.
    """

    ends: NDArray[np.int32]
    parts: NDArray[np.int64]
    counts: NDArray[np.int64]
    box: NDArray[np.int64]


class SweepWindow:
    """A dense window of columns that follows the sensor; its memory is used again.

    Each thread carves its own share of the beams into its own mask. These are merged by OR, which
    does not depend on the order: the marks are the same for any number of threads.
    """

    def __init__(self, team: Team, bounds: NDArray[np.int64] | None = None) -> None:
        """Make one without extent.

        Args:
            team: Threads that share the work.
            bounds: (2, 3) least and greatest cell that may be marked; None for no bounds.
        """
        self._team = team
        self._bounds = bounds
        self._hits = np.zeros(0, np.uint64)
        self._aims = np.zeros(0, np.uint64)
        self._flags = np.zeros(0, np.uint8)
        self._ends = np.empty((0, 5), np.int32)
        self._free = np.zeros((team.size, 0), np.uint64)
        self._targets, self._bits = np.empty((0, 5), np.int32), np.empty(0, np.uint64)
        self._columns, self._order = np.empty(0, np.int32), np.empty(0, np.int32)

    @property
    def nbytes(self) -> int:
        """Bytes that the masks hold."""
        masks = (self._hits, self._aims, self._flags, self._free)
        return sum(mask.nbytes for mask in masks)

    def place(self, sweep: Sweep) -> Placed:
        """Find where the beams end; nothing is marked.

        Raises:
            ValueError: A direction is not of unit length, or the beams span too much space.
        """
        count, size = len(sweep.ranges_mm), self._team.size
        if len(self._ends) < count:
            self._ends = np.empty((count, 5), np.int32)
        ends, groups = self._ends, sweep.groups
        cells = sweep.sensors >> beams.SUBCELL_BITS
        boxes, counts = np.empty((size, 2, 3), np.int64), np.zeros((size, 4), np.int64)
        boxes[:, 0], boxes[:, 1] = cells.min(axis=0), cells.max(axis=0)
        parts = np.array([[count * k // size, count * (k + 1) // size] for k in range(size)])

        def place(_: int, some: tuple[int, int]) -> None:
            for k in range(*some):
                first, end = (int(beam) for beam in parts[k])
                listed = beams.place_ends(
                    sweep.origins,
                    groups,
                    sweep.directions,
                    sweep.ranges_mm,
                    sweep.limits_mm,
                    sweep.resolution,
                    (first, end),
                    ends[first:end],
                    boxes[k],
                    counts[k],
                    np.empty((3, beams.CHUNK), np.int64),
                    np.empty(beams.CHUNK, np.int64),
                )
                parts[k, 1] = first + listed

        self._team.share(place, size, 1, BEAM_US * count / size)
        if np.any(parts[:, 1] < parts[:, 0]):
            squared = (sweep.directions**2).sum(axis=1)
            strange = ~(np.abs(squared - 1.0) < beams.UNIT_TOLERANCE)  # also NaN
            raise ValueError(
                f"directions: got {sweep.directions[strange][0]}, expected unit length"
            )
        box = self._clip(np.stack([boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)]))
        _, shape = _window(box)
        if np.prod(shape) > MAX_WINDOW_WORDS:
            raise ValueError(
                f"beams: got {64 * np.prod(shape)} cells around them, "
                f"expected at most {64 * MAX_WINDOW_WORDS}: a shorter range or coarser cells"
            )
        return Placed(ends, parts, counts.sum(axis=0), box)

    def carve(self, sweep: Sweep, placed: Placed, guard: bool) -> Marks:
        """Mark the cells that the beams hit and cross.

        Args:
            sweep: The beams.
            placed: Where they end.
            guard: Whether a beam that ends in the floor's layer spares that layer.
        """
        box = placed.box
        corner, shape = _window(box)
        nx, ny, words = shape
        self._reserve(nx * ny, words)
        layer = FLOOR_LAYER - int(corner[2])
        guarded = layer if guard and 0 <= layer < 64 * words else NO_GUARD
        sensors = 2 * (sweep.sensors - (corner << beams.SUBCELL_BITS)) + 1
        x, y, z = (int(cell) for cell in corner)
        x0, y0, z0, x1, y1, z1 = (int(cell) for cell in (box - corner).reshape(-1))
        within, most = (
            (x0, y0, z0, x1, y1, z1),
            int((placed.parts[:, 1] - placed.parts[:, 0]).sum()),
        )
        if len(self._bits) < most:  # new memory would be cleared anew by the system
            self._targets, self._bits = np.empty((most, 5), np.int32), np.empty(most, np.uint64)
            self._columns, self._order = np.empty(most, np.int32), np.empty(most, np.int32)
        targets, bits, columns, order = self._targets, self._bits, self._columns, self._order
        groups = np.empty(len(sensors) + 1, np.int64)
        count = beams.list_targets(
            placed.ends,
            placed.parts,
            sensors,
            (x, y, z),
            within,
            guarded,
            shape,
            self._hits,
            self._aims,
            self._flags,
            columns,
            targets,
            bits,
            groups,
        )
        wedges = np.empty((min(count, beams.WEDGES * len(sensors)), 3), np.int64)
        starts = np.empty(beams.SECTORS + 1, np.int64)
        used = beams.order_targets(targets, groups, sensors, SPREAD, starts, columns, order, wedges)

        def carve(member: int, part: tuple[int, int]) -> None:
            # An array made in a kernel takes longer to compile than the kernel's own arithmetic.
            steps = carving.MAX_STEPS + 1
            carving.carve(
                targets,
                bits,
                order,
                wedges,
                part,
                sensors,
                within,
                guarded,
                shape,
                tuple(np.empty(steps, np.int64) for _ in range(5)),
                np.empty(steps, np.uint64),
                np.empty((carving.MAX_RUNS * words, 3), np.int64),
                self._free[member],
            )

        self._team.share(carve, used, item_us=TARGET_US * count / max(used, 1))
        return self._collect(corner, shape)

    def fill(self, first: NDArray[np.int64], cells: NDArray[np.bool_], raised: bool) -> Marks:
        """Mark cells of an array (nx, ny, nz), whose least one is `first`, as hit or as free."""
        first, cells = self._within(first, cells)
        corner, shape = _window(np.stack([first, first + np.maximum(cells.shape, 1) - 1]))
        nx, ny, words = shape
        self._reserve(nx * ny, words)
        dense = np.zeros((nx, ny, 64 * words), np.bool_)
        inside = tuple(
            slice(int(a), int(a) + n) for a, n in zip(first - corner, cells.shape, strict=True)
        )
        dense[inside] = cells
        masks = self._hits if raised else self._free[0]
        masks[: nx * ny * words] = pack_bits(dense).reshape(-1)
        return self._collect(corner, shape)

    def _clip(self, box: NDArray[np.int64]) -> NDArray[np.int64]:
        return box if self._bounds is None else np.clip(box, self._bounds[0], self._bounds[1])

    def _within(
        self, first: NDArray[np.int64], cells: NDArray[np.bool_]
    ) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
        """The part of a box of cells that lies within the bounds."""
        if self._bounds is None:
            return first, cells
        low, high = np.clip(self._bounds + np.array([[0], [1]]) - first, 0, cells.shape)
        part = tuple(slice(int(a), int(b)) for a, b in zip(low, high, strict=True))
        return np.clip(first, *self._bounds), cells[part]

    def _reserve(self, columns: int, words: int) -> None:
        if len(self._hits) < columns * words:
            self._hits, self._aims = (np.zeros(columns * words, np.uint64) for _ in range(2))
            self._free = np.zeros((self._team.size, columns * words), np.uint64)
        if len(self._flags) < columns:
            self._flags = np.zeros(columns, np.uint8)

    def _collect(self, corner: NDArray[np.int64], shape: tuple[int, int, int]) -> Marks:
        """Merge what the threads marked, and list the bricks that hold any."""
        nx, ny, words = shape
        touched = np.zeros((nx // bricks.EDGE, ny // bricks.EDGE, words), np.bool_)

        def gather(_: int, rows: tuple[int, int]) -> None:
            update.gather(self._hits, self._free, shape, rows, touched)

        self._team.share(gather, len(touched), 1, WORD_US * words * ny * bricks.EDGE)
        blocks = np.argwhere(touched)  # (k, 3)
        rows = blocks * np.array([bricks.EDGE, bricks.EDGE, 1])
        places = ((rows[:, 0] * ny + rows[:, 1]) * words + rows[:, 2]).astype(np.int64)
        keys = (blocks + brick_of(corner)).astype(np.int32, order="C")
        return Marks(keys, places, (ny * words, words), self._hits, self._free[0])


def brick_of(cells: NDArray[np.int64]) -> NDArray[np.int64]:
    """Indices of the bricks that cells (..., 3) lie in."""
    x, y, z = cells[..., 0], cells[..., 1], cells[..., 2] + bricks.BELOW_FLOOR
    return np.stack([x >> bricks.EDGE_BITS, y >> bricks.EDGE_BITS, z >> 6], axis=-1)


def brick_cells(keys: NDArray[np.integer]) -> NDArray[np.int64]:
    """Least cells (..., 3) of bricks."""
    size = np.array([bricks.EDGE, bricks.EDGE, bricks.HEIGHT])
    low: NDArray[np.int64] = keys.astype(np.int64) * size - [0, 0, bricks.BELOW_FLOOR]
    return low


def pack_bits(cells: NDArray[np.bool_]) -> NDArray[np.uint64]:
    """Cells (nx, ny, 64 words) as words (nx, ny, words); bit k of word w is cell 64 w + k."""
    return np.packbits(cells, axis=2, bitorder="little").view(np.uint64)


def unpack_bits(words: NDArray[np.uint64]) -> NDArray[np.bool_]:
    """The reverse: cells (nx, ny, 64 words)."""
    bits = np.unpackbits(np.ascontiguousarray(words).view(np.uint8), axis=2, bitorder="little")
    return bits.view(np.bool_)


def _window(box: NDArray[np.int64]) -> tuple[NDArray[np.int64], tuple[int, int, int]]:
    """Least cell (3,) and size (nx, ny, words) of the whole bricks around a box of cells."""
    first, last = brick_of(box)
    nx, ny, words = (int(n) for n in last - first + 1)
    return brick_cells(first), (nx * bricks.EDGE, ny * bricks.EDGE, words)
