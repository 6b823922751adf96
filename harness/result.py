"""An episode's verdict and figures."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayproof.harness.geometry import polyline_length
from wayproof.harness.schema import wayproof_pb2 as pb

Outcome = Literal[
    "success", "collision", "fall", "timeout", "stuck", "out_of_bounds", "aborted", "error"
]

RECORDED = "recorded"
"""Outcome in the log of a recording, which is neither a success nor a failure."""

ADMITTED = "admitted"
"""Verdict of the referee on a command that stays in admitted space until the body rests."""

FIRST_REFUSED = "first_not_admitted"
"""Name of the figure with the first decision that was not admitted."""

RECOVERED = "recovered: "
"""Prefix of the reason of a recovered log, whose end is missing and whose outcome is `error`."""


@dataclass(frozen=True)
class Result:
    """An episode's verdict and figures.

    Attributes:
        outcome: Outcome by the simulator's truth.
        reason: Reason in words.
        goal_distance_m: True distance from the goal at the end.
        sim_time_s: Simulated time.
        wall_time_s: Wall time without compilation.
        decisions: Number of decisions.
        collisions: Number of times that the robot began to touch what it must not: also the
            floor, if it flies.
        struck: Number of times that a mover ran into the robot at rest.
        min_clearance_m: Least true distance to what it must not touch, at decision times.
        path_length_m: Distance travelled.
        route_length_m: Length of the shortest way by the truth; None if there is none.
        deadline_misses: Decisions past their deadline.
        commands: Commands of a stack on trial that the referee judged; 0 of the built-in stack.
        not_admitted: How many of these it did not admit.
        first_not_admitted: Number of the first such decision; -1 without one.
        chain: Hash over all decisions.
        log: The log's path.
        decision_ms: Median wall time of a decision, ms; of a stack on trial until it answered.
        log_mb_per_min: Size of the log per simulated minute, MB.
        cause: Cause of a failure, see `harness.attribution`; empty for a success.
        cause_evidence: Evidence for the cause, in words.
        cause_decision: Number of the last decision that could have prevented it; -1 if none.
        contact: Name of the obstacle touched and position, m; empty for none.
        traceback: Traceback of an `error` in code, the user's or ours; in the log as `error.txt`.
    """

    outcome: Outcome
    reason: str
    goal_distance_m: float
    sim_time_s: float
    wall_time_s: float
    decisions: int
    collisions: int
    struck: int
    min_clearance_m: float
    path_length_m: float
    route_length_m: float | None
    deadline_misses: int
    commands: int
    not_admitted: int
    first_not_admitted: int
    chain: str
    log: str
    decision_ms: float = 0.0
    log_mb_per_min: float = 0.0
    cause: str = ""
    cause_evidence: str = ""
    cause_decision: int = -1
    contact: str = ""
    traceback: str = ""

    def to_metadata(self) -> dict[str, str]:
        """Return the result for the log, without the fields of this run alone."""
        return {name: str(value) for name, value in asdict(self).items() if name in RESULT_FIELDS}


RESULT_FIELDS = {field.name for field in fields(Result)} - {
    *("log", "log_mb_per_min", "wall_time_s", "decision_ms", "traceback")
}
"""Fields of the result in the log of an episode."""

RECORDED_FIELDS = {"outcome", "reason"} | {
    *("decisions", "sim_time_s", "path_length_m", "deadline_misses", "chain")
}
"""Fields of the result in the log of a recording, see `recorded_figures`."""


def is_recovered(result: Mapping[str, str]) -> bool:
    """Return whether a log was recovered, so that its end is missing, by its result."""
    return result["outcome"] == "error" and result.get("reason", "").startswith(RECOVERED)


def ends_in_error(result: Mapping[str, str]) -> bool:
    """Return whether an episode ended early: its process was killed, or code failed."""
    return result["outcome"] == "error"


def figures_of(decisions: Sequence[pb.Decision], truths: Sequence[pb.Truth]) -> dict[str, float]:
    """Return the result's figures that follow from decisions and truths, by name.

    Args:
        decisions: All of them.
        truths: One for each.
    """
    return figures(
        [np.array(truth.position) for truth in truths],
        [truth.clearance_m for truth in truths],
        [fate_of(decision) for decision in decisions],
    )


def recorded_figures(
    decisions: Sequence[pb.Decision], motions: Sequence[pb.RecordedMotion]
) -> dict[str, float | str]:
    """Return a recording's figures that follow from its decisions and motion, by name.

    Args:
        decisions: All of them.
        motions: One for each.
    """
    return {
        "decisions": len(decisions),
        "sim_time_s": decisions[-1].timestamp.ToNanoseconds() * 1e-9,
        "path_length_m": sum(way_length(motion) for motion in motions),
        "deadline_misses": sum(decision.deadline_missed for decision in decisions),
        "chain": decisions[-1].chain,
    }


def way_of(motion: pb.RecordedMotion) -> NDArray[np.float64]:
    """Return poses (n, 4) since the decision before: x, y, z, m, and heading, rad.

    One alone is the end of a way that was not recorded, or the begin of the recording.
    """
    return np.array(motion.way).reshape(-1, 4)


def way_length(motion: pb.RecordedMotion) -> float:
    """Return the length of the recorded way since the decision before, m."""
    return polyline_length(way_of(motion)[:, :3])


class Fate(NamedTuple):
    """What became of a decision.

    Attributes:
        sequence: Its number.
        missed: Whether it was past its deadline.
        verdict: The referee's, of a stack on trial; empty if it judged none.
        took_ms: Wall time, ms; of a stack on trial until it answered.
    """

    sequence: int
    missed: bool
    verdict: str
    took_ms: float


def fate_of(decision: pb.Decision) -> Fate:
    """Return what became of a decision."""
    stages = decision.stages
    took = stages.answer_ms or stages.sense_ms + stages.map_ms + stages.costmap_ms + stages.plan_ms
    verdict = decision.verdict.verdict if decision.HasField("verdict") else ""
    return Fate(decision.sequence, decision.deadline_missed, verdict, took)


def figures(
    positions: Sequence[NDArray[np.float64]], clearances: Sequence[float], fates: Sequence[Fate]
) -> dict[str, float]:
    """Return the result's figures by name; without a decision the least clearance is NaN.

    Args:
        positions: True ones of the base at each decision, (3,) m.
        clearances: True ones there, m.
        fates: What became of each decision.
    """
    refused = [one.sequence for one in fates if one.verdict not in ("", ADMITTED)]
    return {
        "min_clearance_m": min(clearances, default=math.nan),
        "path_length_m": polyline_length(np.array(positions).reshape(-1, 3)),
        "deadline_misses": sum(one.missed for one in fates),
        "commands": sum(bool(one.verdict) for one in fates),
        "not_admitted": len(refused),
        "first_not_admitted": refused[0] if refused else -1,
    }


def referee_in_words(result: Mapping[str, object]) -> str:
    """Return how many commands the referee admitted, by a result; empty if it judged none."""
    commands, refused, first = (
        int(str(result.get(name) or 0)) for name in ("commands", "not_admitted", FIRST_REFUSED)
    )
    if not commands:
        return ""
    if not refused:
        return f"all {commands} commands admitted"
    return (
        f"{commands - refused} of {commands} commands admitted, {refused} not, first at "
        f"decision {first}"
    )


def slowness_in_words(took_ms: float, deadline_s: float, *, modelled: bool) -> str:
    """Return that decisions take longer than their deadline, which none missed; else empty.

    Args:
        took_ms: Median wall time of a decision, ms.
        deadline_s: Deadline of a decision, s.
        modelled: Whether delays are modelled, so that the wall time counts for nothing.
    """
    if not modelled or took_ms <= deadline_s * 1e3:
        return ""
    return (
        f"{took_ms:.0f} ms a decision, past the deadline of {deadline_s * 1e3:.0f} ms: delays are "
        "modelled, and latency.mode=measured counts them"
    )


@dataclass(frozen=True)
class Contact:
    """First contact of the robot with an obstacle.

    Attributes:
        name: Name of the mover or geom.
        position: (3,) m, world.
    """

    name: str
    position: tuple[float, float, float]

    @classmethod
    def from_text(cls, text: str) -> Contact | None:
        """Parse the text of `str`; None if empty."""
        name, _, place = text.rpartition(" at ")
        if not name:
            return None
        x, y, z = (float(value) for value in place.split(","))
        return cls(name, (x, y, z))

    def __str__(self) -> str:
        """Format the contact as a log's result holds it."""
        return f"{self.name} at " + ",".join(f"{value:.4f}" for value in self.position)
