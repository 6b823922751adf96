"""Earlier decisions, as far as reasons refer to them."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from wayproof.harness.decision import path_of
from wayproof.harness.log.paths import Array, length
from wayproof.harness.replay.audit.committed import hold
from wayproof.harness.schema import wayproof_pb2 as pb

STILL = 0.02
"""Length up to which a trajectory counts as a hold, m."""


@dataclass(frozen=True)
class Step:
    """One earlier decision.

    Attributes:
        time_ns: Simulated time, ns.
        action: Action.
        predicate: Its whole reason.
        moves: Whether its trajectory is no hold.
        position: (3,) estimated position, m.
    """

    time_ns: int
    action: str
    predicate: pb.Reason
    moves: bool
    position: Array

    @property
    def late(self) -> bool:
        """Whether the decision was discarded, and the trajectory before it stood."""
        return self.predicate.kind == "late"


@dataclass
class Past:
    """All decisions before the current one.

    Attributes:
        steps: Decisions by number.
        trajectories: The last trajectories, the newest last.
        way: (n, 3) last global path, m.
    """

    steps: dict[int, Step] = field(default_factory=dict)
    trajectories: list[pb.Trajectory] = field(default_factory=list)
    way: Array = field(default_factory=lambda: np.empty((0, 3)))

    def take(self, decision: pb.Decision) -> None:
        """Add the next decision."""
        self.steps[decision.sequence] = Step(
            time_ns=decision.timestamp.ToNanoseconds(),
            action=decision.action,
            predicate=decision.predicate,
            moves=length(path_of(decision.trajectory.path)) >= STILL,
            position=np.array(decision.position),
        )
        self.trajectories = [*self.trajectories[-9:], decision.trajectory]
        if len(decision.global_path) > 1:
            self.way = path_of(decision.global_path)

    def stand(self, decision: pb.Decision) -> None:
        """Void all trajectories: a recorded robot stands where the next decision is made."""
        self.trajectories = [hold(decision.position, 0.0, decision.timestamp.ToNanoseconds())]

    def followed(self, time_ns: int) -> pb.Trajectory | None:
        """Return the trajectory that the robot follows at a time; None before the first."""
        begun = [one for one in self.trajectories if one.start.ToNanoseconds() <= time_ns]
        return begun[-1] if begun else None

    def at(self, time_ns: int) -> int | None:
        """Return the number of the decision at a time, ns; figures are logged to a microsecond."""
        numbers = [k for k, one in self.steps.items() if abs(one.time_ns - time_ns) < 10_000]
        return numbers[0] if numbers else None

    def since(self, first: int, last: int) -> list[Step]:
        """Return the decisions from `first` to `last`, the latter excluded."""
        return [self.steps[k] for k in range(first, last) if k in self.steps]


def point_of(point: pb.Point) -> Array:
    """Return a logged point as an array (3,), m."""
    return np.array([point.x, point.y, point.z])
