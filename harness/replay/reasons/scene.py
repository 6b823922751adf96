"""Map and body of one decision, against which its reason is checked."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from wayproof.harness.config import BUILTIN, Config
from wayproof.harness.decision import path_of
from wayproof.harness.log.paths import Array, length, refined
from wayproof.harness.mission import Mission
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.maps.columns import ColumnMap


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
    def reason(self) -> pb.Reason:
        """The reason that is checked."""
        return self.decision.predicate

    @property
    def axes(self) -> int:
        """Number of axes: 2 for a walking body, 3 for a flying one."""
        return self.mission.axes

    @property
    def size(self) -> float:
        """Edge of a cell, m."""
        return self.map.resolution

    @property
    def half_diagonal(self) -> float:
        """Greatest distance between a point and the centre of its cell, m."""
        return 0.5 * math.sqrt(self.axes) * self.size

    @property
    def effect_ns(self) -> int:
        """Simulated time for which the decision is made, ns."""
        return self.decision.timestamp.ToNanoseconds() + self.config.latency.expected_ns

    @property
    def on_trial(self) -> bool:
        """Whether the built-in stack did not decide."""
        return self.config.stack.name != BUILTIN

    @property
    def unknown_blocks(self) -> bool:
        """Whether the unknown policy forbids unknown space."""
        return self.config.costmap.unknown_policy == "forbid"

    @property
    def longest_offset(self) -> float:
        """Greatest distance of a disc's centre from the body's, m."""
        return max((abs(offset) for offset, _ in self.mission.discs), default=0.0)

    @property
    def reach(self) -> float:
        """Distance between the centres of two cells up to which the body overlaps a cell, m.

        That of the disc or ball about the body, or of the greatest of its discs: with the margin,
        and half a cell's diagonal.
        """
        radius = max(
            (abs(offset) + radius for offset, radius in self.mission.discs),
            default=self.mission.radius,
        )
        return radius + self.decision.localization_margin_m + self.half_diagonal

    @cached_property
    def path(self) -> Array:
        """Committed path, (n, 3) m."""
        return path_of(self.decision.trajectory.path)

    @property
    def committed(self) -> float:
        """Length of the committed path, m."""
        return length(self.path)

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


def point_of(point: pb.Point) -> Array:
    """Return a logged point as an array (3,), m."""
    return np.array([point.x, point.y, point.z])
