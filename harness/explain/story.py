"""Story of an episode: phases of one action each, with times and places."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from wayproof.harness.clearance import true_in_metres
from wayproof.harness.schema import wayproof_pb2 as pb

BRIEF = 3
"""Minimum number of decisions of a phase between two phases of the same action."""

VERBS = {
    "follow": "followed its path",
    "slow": "went slowly",
    "stop_and_wait": "stopped and waited",
    "explore": "explored",
    "recover": "recovered",
    "goal": "claimed the goal",
    "abort": "gave up",
}
"""Verbs of actions in a story."""


@dataclass(frozen=True)
class Phase:
    """Consecutive decisions of one action.

    Attributes:
        action: Action of most of them.
        first: Number of the first decision.
        last: Number of the last decision.
        start_s: Simulated time of the first, s.
        end_s: Simulated time of the decision after the last, or of the last, s.
        start: True position at the start, m.
        end: True position at the end, m.
        distance_m: Distance travelled, m.
        label: Most frequent label but `none`; `none` without another.
        reason: Reason of the last decision.
        least_clearance_m: Least true clearance at a decision, m.
    """

    action: str
    first: int
    last: int
    start_s: float
    end_s: float
    start: tuple[float, ...]
    end: tuple[float, ...]
    distance_m: float
    label: str
    reason: str
    least_clearance_m: float

    def __str__(self) -> str:
        """Return the phase in one line."""
        span = f"{self.start_s:6.1f} to {self.end_s:5.1f} s"
        label = "" if self.label == "none" else f" [{self.label}]"
        clearance = ""
        if not math.isnan(self.least_clearance_m):  # of a recording there is no truth
            clearance = f", least clearance {true_in_metres(self.least_clearance_m)}"
        return (
            f"{span}  {VERBS.get(self.action, self.action)}{label}: {self.distance_m:.2f} m, "
            f"{_place(self.start)} to {_place(self.end)}{clearance}; {self.reason}"
        )


def phases(decisions: Sequence[pb.Decision], truths: Sequence[pb.Truth]) -> list[Phase]:
    """Return the phases of an episode.

    Args:
        decisions: All decisions.
        truths: Ground truth of each.
    """
    actions = _smoothed([decision.action for decision in decisions])
    found = []
    for action, run in itertools.groupby(range(len(actions)), key=actions.__getitem__):
        numbers = list(run)
        found.append(_phase(action, numbers, decisions, truths))
    return found


def _smoothed(actions: list[str]) -> list[str]:
    """Return the actions with brief runs replaced by the action on both sides."""
    runs = [(action, len(list(run))) for action, run in itertools.groupby(actions)]
    for k in range(1, len(runs) - 1):
        if runs[k][0] == "goal":
            continue  # of a mission with several goals it takes one decision
        if runs[k][1] < BRIEF and runs[k - 1][0] == runs[k + 1][0]:
            runs[k] = runs[k - 1][0], runs[k][1]
    return [action for action, count in runs for _ in range(count)]


def _phase(
    action: str, numbers: list[int], decisions: Sequence[pb.Decision], truths: Sequence[pb.Truth]
) -> Phase:
    after = min(numbers[-1] + 1, len(decisions) - 1)
    places = np.array([truths[k].position for k in range(numbers[0], after + 1)])
    labels = [decisions[k].label for k in numbers if decisions[k].label != "none"]
    return Phase(
        action=action,
        first=decisions[numbers[0]].sequence,
        last=decisions[numbers[-1]].sequence,
        start_s=decisions[numbers[0]].timestamp.ToNanoseconds() * 1e-9,
        end_s=decisions[after].timestamp.ToNanoseconds() * 1e-9,
        start=tuple(places[0].tolist()),
        end=tuple(places[-1].tolist()),
        distance_m=float(np.linalg.norm(np.diff(places, axis=0), axis=1).sum()),
        label=max(sorted(set(labels)), key=labels.count) if labels else "none",
        reason=decisions[numbers[-1]].reason,
        least_clearance_m=min(truths[k].clearance_m for k in numbers),
    )


def _place(point: tuple[float, ...]) -> str:
    return "(" + ", ".join(f"{value:.1f}" for value in point) + ")"
