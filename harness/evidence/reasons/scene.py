"""What a reason is held against: the map of its decision, cell by cell, and the body in it."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from harness.config import Config
from harness.mission import Mission
from harness.schema import wayproof_pb2 as pb
from harness.stack.decision import path_of
from maps import FREE, OCCUPIED, UNKNOWN, Representation, states_in

Array = NDArray[np.float64]
Point = tuple[float, float, float]

SLIVER = 1e-7
"""Of rounding: a face that lies on a bound is on neither side of it, m."""

OUTSIDE = 3
"""State of a cell that lies outside of the operating area."""

NAMES = {FREE: "free", UNKNOWN: "unknown", OCCUPIED: "occupied", OUTSIDE: "outside"}


@dataclass(frozen=True)
class Cells:
    """Squares of columns for a body that walks, cubes for one that flies.

    Attributes:
        states: (nx, ny) or (nx, ny, nz).
        corner: (2,) or (3,) least corner of the first one, m.
        size: Edge of one, m.
    """

    states: NDArray[np.uint8]
    corner: Array
    size: float

    def of(self, points: Array) -> NDArray[np.int64]:
        """The cells (n, axes) that points (n, 3), m, lie in."""
        axes = self.states.ndim
        return np.floor((points[:, :axes] - self.corner) / self.size).astype(np.int64)

    def wrong(self, unknown_blocks: bool) -> NDArray[np.bool_]:
        """Which the body may not overlap."""
        wrong: NDArray[np.bool_] = self.states != FREE
        return wrong if unknown_blocks else wrong & (self.states != UNKNOWN)

    def clearances(self, unknown_blocks: bool) -> Array:
        """From each centre to the nearest one that the body may not overlap, cells."""
        from scipy import ndimage

        wrong = np.pad(self.wrong(unknown_blocks), 1, constant_values=True)
        inner = (slice(1, -1),) * self.states.ndim
        distances: Array = ndimage.distance_transform_edt(~wrong)[inner]
        return distances


@dataclass(frozen=True)
class Scene:
    """One decision and the map that it was made on.

    Attributes:
        decision: The one whose reason is checked.
        map: As the log's sweeps give it.
        config: Of the decision.
        mission: Likewise.
    """

    decision: pb.Decision
    map: Representation
    config: Config
    mission: Mission

    @property
    def axes(self) -> int:
        """2 for a body that walks, 3 for one that flies."""
        return 2 if self.mission.motion == "ground" else 3

    @property
    def size(self) -> float:
        """Edge of a cell, m."""
        return self.map.resolution

    @property
    def comparable(self) -> bool:
        """Whether the cells that count are the map's: slopes and margins by class add some."""
        config = self.config.map
        return not config.class_margins and config.max_slope == 0.0

    @property
    def unknown_blocks(self) -> bool:
        """Whether the policy keeps the body out of unknown space."""
        return self.config.map.unknown_policy == "forbid"

    @property
    def offsets(self) -> list[float]:
        """Of the discs of the body along its axis, m; 0 alone for the disc about all of it."""
        return [0.0] if self.wide else [offset for offset, _ in self.mission.discs]

    @property
    def radii(self) -> list[float]:
        """Of the discs that the decision was made for, m."""
        if not self.mission.discs:
            return [self.mission.radius]
        if self.wide:
            return [max(abs(offset) + radius for offset, radius in self.mission.discs)]
        return [radius for _, radius in self.mission.discs]

    @cached_property
    def wide(self) -> bool:
        """Whether the decision was made for the disc about all of the body."""
        if not self.mission.discs:
            return True
        about = max(abs(offset) + radius for offset, radius in self.mission.discs)
        slim = min(radius for _, radius in self.mission.discs)
        named = self.decision.inflation_radius_m - self.decision.localization_margin_m
        half = 0.5 * math.sqrt(self.axes) * self.size
        return abs(named - half - about) < abs(named - half - slim)

    def reach(self, radius: float) -> float:
        """How near to a disc's cell a cell is overlapped, between centres, cells."""
        margin = self.decision.localization_margin_m
        return (radius + margin) / self.size + 0.5 * math.sqrt(self.axes)

    @cached_property
    def path(self) -> Array:
        """That it commits to, (n, 3) m."""
        return path_of(self.decision.trajectory.path)

    @cached_property
    def guide(self) -> Array:
        """The way that it names, (n, 3) m; of no points if it names none."""
        return path_of(self.decision.guide)

    @property
    def goal(self) -> Array:
        """The mission's, (3,) m."""
        return np.array(self.mission.goal)

    def apart(self, a: Array, b: Array) -> float:
        """Distance between places (3,), m, in the plane for a body that walks."""
        return float(np.linalg.norm((a - b)[: self.axes]))

    def cells_about(self, points: Array, reach: float) -> Cells:
        """The cells within a reach, m, of points (n, 3), m."""
        size = self.size
        low, high = points.min(axis=0) - reach - 2 * size, points.max(axis=0) + reach + 2 * size
        if self.axes == 2:
            low[2], high[2] = self.mission.low[2] - size, self.mission.height + 2 * size
        shift = np.array([0.0, 0.0, 0.75])
        first, end = np.floor(low / size + shift), np.ceil(high / size + shift)
        corner = (first - shift) * size
        states = states_in(self.map, corner + 0.25 * size, (end - shift) * size - 0.25 * size)
        if self.axes == 2:
            states = self._columns(states, float(corner[2]))
        self._fence(states, corner)
        return Cells(states, corner[: self.axes], size)

    @cached_property
    def everywhere(self) -> Cells:
        """All cells of the operating area."""
        bounds = np.array([self.mission.low, self.mission.high])
        return self.cells_about(bounds, 0.0)

    def state_at(self, place: Point) -> str:
        """Name of the state of the cell about a place."""
        point = np.array([place])
        cells = self.cells_about(point, 0.0)
        return NAMES[int(cells.states[tuple(cells.of(point)[0])])]

    def _columns(self, states: NDArray[np.uint8], bottom: float) -> NDArray[np.uint8]:
        """What a body that walks meets in each column, (nx, ny)."""
        size, mission = self.size, self.mission
        lower = bottom + np.arange(states.shape[2]) * size
        upper = lower + size
        below = (upper > mission.low[2] + SLIVER) & (upper <= SLIVER)
        footing = (upper > SLIVER) & (upper <= mission.step_height + SLIVER)
        band = (upper > mission.step_height + SLIVER) & (lower < mission.height - SLIVER)
        seen = np.where((states == OCCUPIED)[:, :, footing].any(axis=2), FREE, UNKNOWN)
        columns = np.where((states == FREE)[:, :, band].all(axis=2), seen, UNKNOWN)
        hit = (states == OCCUPIED)[:, :, band].any(axis=2)
        hit |= (states == FREE)[:, :, below].any(axis=2)  # a beam went through the floor
        return np.where(hit, OCCUPIED, columns).astype(np.uint8)

    def _fence(self, states: NDArray[np.uint8], corner: Array) -> None:
        for axis in range(self.axes):
            edges = corner[axis] + np.arange(states.shape[axis]) * self.size
            low, high = self.mission.low[axis], self.mission.high[axis]
            outside = (edges + self.size <= low + SLIVER) | (edges >= high - SLIVER)
            if axis == 2:
                motion = self.config.motion
                outside |= edges < motion.altitude_low - SLIVER
                outside |= edges + self.size > motion.altitude_high + SLIVER
            states[(slice(None),) * axis + (outside,)] = OUTSIDE


def densely(path: Array, spacing: float) -> Array:
    """Points of a path, (m, 3), at most so far apart, its own among them."""
    pieces = [path[:1]]
    for a, b in itertools.pairwise(path):
        count = max(math.ceil(float(np.linalg.norm(b - a)) / spacing), 1)
        pieces.append(a + np.linspace(0.0, 1.0, count + 1)[1:, None] * (b - a))
    return np.concatenate(pieces)


def arcs_of(path: Array) -> Array:
    """Arc length at each point of a path, (n,) m."""
    steps = np.linalg.norm(np.diff(path, axis=0), axis=1)
    return np.concatenate([[0.0], np.cumsum(steps)])
