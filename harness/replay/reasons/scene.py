"""Map and body of one decision, against which its reason is checked."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from wayproof.harness.config import Config
from wayproof.harness.decision import path_of
from wayproof.harness.judge.cells import NAMES, Cells, cells_around
from wayproof.harness.log.paths import Array, refined
from wayproof.harness.mission import Mission
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.maps.columns import ColumnMap

Point = tuple[float, float, float]


@dataclass(frozen=True)
class Scene:
    """One decision and the map that it was made on.

    Attributes:
        decision: Decision whose reason is checked.
        map: Map, rebuilt from the sweeps.
        config: Settings of the decision.
        mission: Mission of the decision.
    """

    decision: pb.Decision
    map: ColumnMap
    config: Config
    mission: Mission

    @property
    def axes(self) -> int:
        """Number of axes: 2 for a walking body, 3 for a flying one."""
        return self.mission.axes

    @property
    def size(self) -> float:
        """Edge of a cell, m."""
        return self.map.resolution

    @property
    def effect_ns(self) -> int:
        """Simulated time for which the decision is made, ns."""
        return self.decision.timestamp.ToNanoseconds() + self.config.latency.expected_ns

    @property
    def comparable(self) -> bool:
        """Whether only cells of the map block: slopes and class margins add others."""
        config = self.config.costmap
        return not config.class_margins and config.max_slope == 0.0

    @property
    def unknown_blocks(self) -> bool:
        """Whether the unknown policy forbids unknown space."""
        return self.config.costmap.unknown_policy == "forbid"

    @property
    def offsets(self) -> list[float]:
        """Offsets of the discs along the body, m; only 0 for the circumscribed disc."""
        return [0.0] if self.wide else [offset for offset, _ in self.mission.discs]

    @property
    def radii(self) -> list[float]:
        """Radii of the discs of the decision, m."""
        if not self.mission.discs:
            return [self.mission.radius]
        if self.wide:
            return [max(abs(offset) + radius for offset, radius in self.mission.discs)]
        return [radius for _, radius in self.mission.discs]

    @cached_property
    def wide(self) -> bool:
        """Whether the decision was made for the circumscribed disc."""
        if not self.mission.discs:
            return True
        about = max(abs(offset) + radius for offset, radius in self.mission.discs)
        slim = min(radius for _, radius in self.mission.discs)
        named = self.decision.inflation_radius_m - self.decision.localization_margin_m
        half = 0.5 * math.sqrt(self.axes) * self.size
        return abs(named - half - about) < abs(named - half - slim)

    def reach(self, radius: float) -> float:
        """Return the distance between centres up to which a disc overlaps a cell, cells."""
        margin = self.decision.localization_margin_m
        return (radius + margin) / self.size + 0.5 * math.sqrt(self.axes)

    @cached_property
    def path(self) -> Array:
        """Committed path, (n, 3) m."""
        return path_of(self.decision.trajectory.path)

    @cached_property
    def global_path(self) -> Array:
        """Global path, (n, 3) m; empty without one."""
        return path_of(self.decision.global_path)

    @cached_property
    def way_ahead(self) -> Array:
        """Global path, (n, 3) m, with all points of the committed path where that follows it."""
        return refined(self.global_path, self.path)

    @property
    def goal(self) -> Array:
        """Goal of the mission, (3,) m."""
        return np.array(self.mission.goal)

    def apart(self, a: Array, b: Array) -> float:
        """Return the distance between points (3,), m; in the plane for a walking body."""
        return float(np.linalg.norm((a - b)[: self.axes]))

    def cells_about(self, points: Array, reach: float) -> Cells:
        """Return the cells within a reach, m, of points (n, 3), m."""
        return cells_around(
            self.map,
            path=points,
            reach=reach,
            config=self.config,
            mission=self.mission,
            widening=self.decision.widening,
        )

    @cached_property
    def everywhere(self) -> Cells:
        """Return all cells of the operating area."""
        bounds = np.array([self.mission.low, self.mission.high])
        return self.cells_about(bounds, 0.0)

    def state_at(self, place: Point) -> str:
        """Return the name of the state of the cell at a point."""
        point = np.array([place])
        cells = self.cells_about(point, 0.0)
        return NAMES[int(cells.states[tuple(cells.of(point)[0])])]
