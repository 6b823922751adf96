"""One decision of a log with the data that it is checked against."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from wayproof.harness.config import BUILTIN, Config
from wayproof.harness.decision import SAMPLE_PERIOD, path_of
from wayproof.harness.judge.body import MOST_MORE, Body, believed_of
from wayproof.harness.log.paths import Array, length, refined
from wayproof.harness.log.reader import Record
from wayproof.harness.mission import Mission
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.maps import Representation
from wayproof.maps.columns import ColumnMap

SAME = 2.0**-20
"""Grain of logged samples, m and rad: values that differ by no more are equal."""

FALL = 1e-3
"""Fall of the arc length that counts as rounding, m."""

ROUNDING = 1e-9
"""Tolerance of a sample period, s."""

FARTHEST = 20.0
"""Greatest distance of an estimated position outside the operating area, m."""

LONGEST = 1000.0
"""Greatest length of a path, m."""

HEADING_ERROR = 0.05
"""Heading error that the margin of a body of discs covers at each disc, rad."""


@dataclass(frozen=True)
class Violation:
    """Violation of a rule by a decision.

    Attributes:
        sequence: Number of the decision.
        rule: `form`, `version`, `inputs`, `settings`, `margin`, `deadline`, `figure`, `limits`,
            `rest`, `joined`, `swept`, `stop`, `recover`, `reason` or `evidence`.
        text: Found and expected.
    """

    sequence: int
    rule: str
    text: str


@dataclass(frozen=True)
class Committed:
    """One decision with its inputs, settings and map.

    Attributes:
        record: Decision, inputs and delay.
        config: Settings of the decision.
        mission: Mission of the decision.
        map: Map that paths are checked against: the measured one, with the prior map where it is
            unknown if that admits.
        measured: Map of the decision, rebuilt from the sweeps of the log.
        version: Version of that map.
        body: Body for collision checks.
        before: The last two trajectories before it; at first a hold.
        returns: Map of the returns as they came, without the word of a filter; None if not kept.
    """

    record: Record
    config: Config
    mission: Mission
    map: ColumnMap
    measured: Representation
    version: str
    body: Body
    before: tuple[pb.Trajectory, ...]
    returns: Representation | None = None

    @property
    def decision(self) -> pb.Decision:
        """Decision that is checked."""
        return self.record.decision

    @property
    def reason(self) -> pb.Reason:
        """Its reason."""
        return self.decision.predicate

    @property
    def axes(self) -> int:
        """Number of axes of motion: 2 for a walking body, 3 for a flying one."""
        return self.mission.axes

    @property
    def on_trial(self) -> bool:
        """Whether the built-in stack did not decide."""
        return self.config.stack.name != BUILTIN

    @property
    def effect_ns(self) -> int:
        """Simulated time for which the decision is made, ns."""
        return self.decision.timestamp.ToNanoseconds() + self.config.latency.expected_ns

    @property
    def longest_offset(self) -> float:
        """Greatest distance of a disc's centre from the body's, m."""
        return max((abs(offset) for offset, _ in self.mission.discs), default=0.0)

    @cached_property
    def margin(self) -> float:
        """Localization margin, m, from settings, logged pose and body."""
        pose, mission = self.record.inputs.pose, self.mission
        believed, _ = believed_of(pose, self.config.map.resolution, flat=mission.planar)
        return (
            self.config.costmap.localization_margin + believed + self.longest_offset * HEADING_ERROR
        )

    @property
    def late(self) -> bool:
        """Whether the decision missed its deadline, from logged delay and settings."""
        return self.record.latency.delay_s > self.config.latency.deadline

    @cached_property
    def path(self) -> Array:
        """Committed path, (n, 3) m."""
        return path_of(self.decision.trajectory.path)

    @cached_property
    def length(self) -> float:
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

    @cached_property
    def poses(self) -> Array:
        """Poses of its trajectory: x, y, z, m, and heading, rad, (n, 4).

        Of one that continues, from where the decision takes effect: it is committed until then.
        """
        now_ns = self.decision.timestamp.ToNanoseconds()
        delay_ns = self.config.latency.expected_ns if self.keeps_trajectory else 0
        return self.body.poses(self.decision.trajectory, now_ns + delay_ns)

    @cached_property
    def keeps_trajectory(self) -> bool:
        """Whether its trajectory is the one before; a fork may shift its height."""
        trajectory, before, axes = self.decision.trajectory, self.before[-1], self.mission.axes
        if trajectory.sample_period_s != before.sample_period_s:
            return False
        pairs = [
            (np.array(trajectory.arc_length), np.array(before.arc_length)),
            (np.array(trajectory.heading), np.array(before.heading)),
            (self.path[:, :axes], path_of(before.path)[:, :axes]),
        ]
        return trajectory.start == before.start and all(
            one.shape == other.shape and bool(np.abs(one - other).max(initial=0.0) <= SAME)
            for one, other in pairs
        )

    @property
    def moves(self) -> bool:
        """Whether the body moves, or an elongated one turns in place."""
        return self.body.moves(self.decision.trajectory)

    @cached_property
    def malformed(self) -> str:
        """Why the trajectory is malformed, so that no other check applies; empty if it is not."""
        trajectory, mission = self.decision.trajectory, self.mission
        arcs, headings = np.array(trajectory.arc_length), np.array(trajectory.heading)
        if min(len(self.path), len(arcs)) == 0 or len(arcs) != len(headings):
            return (
                f"a path of {len(self.path)} points, {len(arcs)} samples of the way and "
                f"{len(headings)} of the heading; expected one or more, and as many of both"
            )
        period = trajectory.sample_period_s
        finite = np.isfinite(arcs).all() and np.isfinite(headings).all()
        if not (finite and abs(period - SAMPLE_PERIOD) <= ROUNDING):
            return (
                f"samples that are not finite, or {period:g} s apart, expected {SAMPLE_PERIOD:g} s"
            )
        if arcs[0] < -FALL or (np.maximum.accumulate(arcs) - arcs).max() > FALL:
            return "an arc length that does not rise from 0 on"
        widening = self.decision.widening
        if len(widening) not in (0, 2) or max(widening, default=0) > MOST_MORE:
            return f"a widening by {tuple(widening)} cells, expected two of at most {MOST_MORE}"
        away = np.maximum(np.array(mission.low) - self.path, self.path - np.array(mission.high))
        if not (away <= FARTHEST).all() or self.length > LONGEST:
            return (
                f"a path that leaves the operating area by more than {FARTHEST:g} m, or has no end"
            )
        return ""

    def apart(self, a: Array, b: Array) -> float:
        """Return the distance between two points (3,), m; in the plane for a body on the ground."""
        return float(np.sqrt(((a - b)[: self.axes] ** 2).sum()))

    def broken(self, rule: str, text: str) -> Violation:
        """Return a violation by this decision."""
        return Violation(self.decision.sequence, rule, text)


def hold(place: Sequence[float], heading: float, start_ns: int = 0) -> pb.Trajectory:
    """Return the trajectory of a body that stays at a place, m, from a time on, ns."""
    x, y, z = place
    trajectory = pb.Trajectory(
        path=[pb.Point(x=x, y=y, z=z)], arc_length=[0.0], heading=[heading], sample_period_s=0.1
    )
    trajectory.start.FromNanoseconds(start_ns)
    return trajectory
