"""One decision of a log, and all that it is held against."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from wayproof.harness.config import Config
from wayproof.harness.log.paths import Array
from wayproof.harness.log.reader import Record
from wayproof.harness.mission import Mission
from wayproof.harness.replay.audit.body import Body
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.harness.stack.decision import path_of
from wayproof.maps import Representation

SIGMAS = 2.0
"""Standard deviations of the believed position that the margin covers."""

HEADING_ERROR = 0.05
"""How far a body of discs may be off its heading, rad; the margin covers it at each disc."""


@dataclass(frozen=True)
class Violation:
    """One rule that one decision broke.

    Attributes:
        sequence: Of the decision.
        rule: `form`, `version`, `inputs`, `settings`, `margin`, `deadline`, `figure`, `limits`,
            `rest`, `joined`, `swept`, `stop`, `recover`, `reason` or `volume`.
        text: What was found, and what was expected.
    """

    sequence: int
    rule: str
    text: str


@dataclass(frozen=True)
class Moment:
    """One decision with what its log says beside it.

    Attributes:
        record: The decision, its inputs and its delay.
        config: The settings that it was made with.
        mission: Likewise.
        map: All that was sensed up to it, rebuilt from the log's sweeps.
        version: Of that map.
        body: Where a body may be.
        before: What it was to follow until now, the last two trajectories; at first a hold.
    """

    record: Record
    config: Config
    mission: Mission
    map: Representation
    version: str
    body: Body
    before: tuple[pb.Trajectory, ...]

    @property
    def decision(self) -> pb.Decision:
        """The one that is judged."""
        return self.record.decision

    @cached_property
    def margin(self) -> float:
        """The localization margin, m, by the settings, the logged pose and the body alone."""
        lever = max((abs(offset) for offset, _ in self.mission.discs), default=0.0)
        believed = SIGMAS * self.record.inputs.pose.position_sigma
        return self.config.costmap.localization_margin + believed + lever * HEADING_ERROR

    @property
    def late(self) -> bool:
        """Whether it came past the deadline, by the logged delay and the settings alone."""
        return self.record.latency.delay_s > self.config.latency.deadline

    @cached_property
    def path(self) -> Array:
        """That it commits to, (n, 3) m."""
        return path_of(self.decision.trajectory.path)

    @cached_property
    def poses(self) -> Array:
        """Where its trajectory leads: x, y, z, m, and heading, rad, (n, 4)."""
        return self.body.poses(self.decision)

    @property
    def moves(self) -> bool:
        """Whether the body leaves its place, or one that is checked at its heading turns there."""
        return self.body.moves(self.decision.trajectory)

    def broken(self, rule: str, text: str) -> Violation:
        """A rule that this decision breaks."""
        return Violation(self.decision.sequence, rule, text)


def standing_at_start(mission: Mission) -> pb.Trajectory:
    """What the body follows before the first decision: a hold at the mission's start."""
    x, y, z = mission.start
    return pb.Trajectory(
        path=[pb.Point(x=x, y=y, z=z)],
        arc_length=[0.0],
        heading=[mission.start_heading],
        sample_period_s=0.1,
    )


def apart(moment: Moment, a: Array, b: Array) -> float:
    """Distance between two places (3,), m, in the plane for a body on the ground."""
    axes = moment.mission.axes
    return float(np.sqrt(((a - b)[:axes] ** 2).sum()))
