"""Ending of an episode at a decision, from decisions and true positions alone.

Shared by the simulation and the check of a log; needs no MuJoCo.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import get_args

import numpy as np
from numpy.typing import NDArray

from wayproof.harness.config import EpisodeConfig
from wayproof.harness.goals import distance, goal_name
from wayproof.harness.mission import Mission
from wayproof.harness.result import Outcome
from wayproof.harness.schema import wayproof_pb2 as pb

Array = NDArray[np.float64]

Verdict = tuple[Outcome, str]
"""An outcome and why."""

AT_A_DECISION: tuple[Outcome, ...] = ("success", "timeout", "stuck", "aborted")
"""Outcomes that follow from a decision and the truth at its time."""

BETWEEN_DECISIONS = tuple(one for one in get_args(Outcome) if one not in AT_A_DECISION)
"""Outcomes of the physics after a decision, or of a failure of the program."""

STUCK_RADIUS = 0.3
"""Extent of the positions within `episode.stuck_after` below which the robot is stuck, m."""


@dataclass(frozen=True)
class Limits:
    """Limits of an episode.

    Attributes:
        episode: Times and tolerances.
        mission: Mission with all goals.
        period_s: Time from one decision to the next, s.
    """

    episode: EpisodeConfig
    mission: Mission
    period_s: float

    def ending_at(
        self, decision: pb.Decision, positions: Sequence[Array], reached: int = 0
    ) -> Verdict | None:
        """Return the verdict of a decision; a claim of a goal is checked against the truth.

        Args:
            decision: The newest.
            positions: True positions (3,) of the base at every decision so far, m.
            reached: Number of goals reached before it.
        """
        config, mission = self.episode, self.mission
        if decision.action == "abort":
            return "aborted", decision.reason
        away = goal_distance(mission, positions[-1], reached)
        if decision.action == "goal":
            if away > config.goal_tolerance:
                name = goal_name(mission, reached)
                return "aborted", f"claimed {name} from {away:.2f} m away"
            if reached + 1 >= len(mission.goals):
                return "success", f"at rest {away:.2f} m from {goal_name(mission, reached)}"
            reached += 1
            away = goal_distance(mission, positions[-1], reached)
        if decision.timestamp.ToNanoseconds() * 1e-9 >= config.time_limit:
            name = goal_name(mission, reached)
            return "timeout", f"{away:.2f} m from {name} after {config.time_limit:g} s"
        window = round(config.stuck_after / self.period_s)
        recent = positions[-window:]
        if len(recent) == window and _spread(recent) < STUCK_RADIUS:
            return "stuck", f"less than {STUCK_RADIUS} m of movement in {config.stuck_after:g} s"
        return None


def goal_distance(mission: Mission, position: Array, reached: int = 0) -> float:
    """Return the distance of a true position (3,) to the next goal, m; on the ground in x, y."""
    axes, goals = mission.axes, mission.goals
    goal = goals[min(reached, len(goals) - 1)]
    return distance(position[:axes], np.array(goal[:axes]))


def _spread(positions: Sequence[Array]) -> float:
    points = np.array(positions)
    return distance(points.max(axis=0), points.min(axis=0))
