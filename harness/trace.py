"""The data of an episode from which its metrics follow, read from its log alone."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from wayproof.harness.errors import InputError
from wayproof.harness.goals import distance_left, goals_before_last, goals_reached
from wayproof.harness.input_messages import covariance_of
from wayproof.harness.log.codec.messages import read_messages
from wayproof.harness.log.reader import Log, as_truth
from wayproof.harness.result import RECORDED
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.harness.trajectory_error import Track

Array = NDArray[np.float64]

NEAR = 1.0
"""Distance from the last goal, m, at which a trial of the BARN Challenge ends."""


@dataclass(frozen=True)
class Beliefs:
    """Stated and true errors of an estimator; one entry for each of n decisions.

    Attributes:
        errors: (n, 3) estimated less true position, world, m.
        covariances: (n, 3, 3) stated, m^2.
    """

    errors: Array
    covariances: Array


@dataclass(frozen=True)
class Trace:
    """Data of an episode for its metrics; one entry for each of n decisions.

    Attributes:
        outcome: Outcome in the log's result.
        duration: Simulated time to the end, s.
        collisions: Times that the robot began to touch an obstacle.
        goal_distance: True distance from the goal at the end, m; of several goals to the next and
            on through the others.
        route_length: Length of the shortest path for this body through all goals, m; none if
            unknown.
        times: (n,) s.
        positions: (n, 3) true, of the base, m.
        velocities: (n, 3) true, m/s.
        clearances: (n,) least true distance to what the body must not touch, m.
        actions: (n,) names.
        latencies: (n,) wall time of a decision's stages together, ms.
        predicting: (k,) wall time until each prediction from outside came, ms; none without any.
        missed: (n,) whether it was past its deadline.
        arrival: Time from which the body is within 1 m of the last goal in the plane until the end,
            s; none if it is not there at the end.
        start_distance: Distance of the start from the goal, measured as `goal_distance` is, m.
        goals: Number of goals of the mission.
        goals_reached: Number of them that were reached, by the truth.
        verdicts: The referee's on each command of a stack on trial that came in time; none of the
            built-in one.
        cuts: (n,) whether the guard braked in the stack's place; none likewise.
        tracks: Estimated and true poses of the decisions that have a truth; none if not known.
        beliefs: Errors of the poses with the covariances that the estimator states; none if it
            states none, or if not known.
        admitted_share: Share of a recorded way that was admitted when it was entered; none of a
            simulated episode, or if it was not judged.
        committed_evidence: (n, 4) lengths of committed paths that rest on measurements, the prior
            map, predictions and nothing, m; none without a prior map.
        global_evidence: (n, 4) the same of global paths.
        evidence_ages: (n,) time since what came was measured in truth, of the stream that is behind
            most, s; none where all comes in time.
    """

    outcome: str
    duration: float
    collisions: int
    goal_distance: float
    route_length: float | None
    times: Array
    positions: Array
    velocities: Array
    clearances: Array
    actions: tuple[str, ...]
    latencies: Array
    missed: NDArray[np.bool_]
    start_distance: float
    arrival: float | None = None
    goals: int = 1
    goals_reached: int = 0
    verdicts: tuple[str, ...] | None = None
    cuts: NDArray[np.bool_] | None = None
    tracks: tuple[Track, Track] | None = None
    beliefs: Beliefs | None = None
    admitted_share: float | None = None
    predicting: Array | None = None
    committed_evidence: Array | None = None
    global_evidence: Array | None = None
    evidence_ages: Array | None = None

    @property
    def success(self) -> bool:
        """Whether the goal was reached, by the simulator's truth."""
        return self.outcome == "success"

    @property
    def recorded(self) -> bool:
        """Whether it is of a recording, whose truth is unknown."""
        return self.outcome == RECORDED

    @property
    def path_length(self) -> float:
        """Distance travelled, m."""
        return float(np.linalg.norm(np.diff(self.positions, axis=0), axis=1).sum())


def read_trace(log: Log) -> Trace:
    """Read a trace from a log.

    Raises:
        InputError: The log breaks off or is damaged.
    """
    return trace_of(log, *_read(log.path))


def trace_of(
    log: Log,
    decisions: Sequence[pb.Decision],
    truths: Sequence[pb.Truth],
    motions: Sequence[pb.RecordedMotion] = (),
    poses: Sequence[pb.Pose] = (),
    perturbations: Sequence[pb.Perturbation] = (),
) -> Trace:
    """Return the trace of a log whose messages were read already."""
    recorded = log.config.recording is not None
    known = [as_truth(motion) for motion in motions] if recorded else truths
    if not known:
        raise InputError(f"log '{log.path}': no decisions in it")
    result = {**_without_result(log, decisions, known[-1], recorded), **log.result}
    route, outcome = result.get("route_length_m"), result["outcome"]
    verdicts = [one.verdict for one in decisions if one.HasField("verdict")]
    start = distance_left(log.mission, 0, np.array(log.mission.start))
    return Trace(
        outcome=outcome,
        duration=float(result["sim_time_s"]),
        collisions=int(result["collisions"]),
        goal_distance=float(result["goal_distance_m"]),
        route_length=float(route) if route not in (None, "", "None") else None,
        times=np.array([truth.timestamp.ToNanoseconds() * 1e-9 for truth in known]),
        positions=np.array([truth.position for truth in known]).reshape(-1, 3),
        velocities=np.array([truth.velocity for truth in known]).reshape(-1, 3),
        clearances=np.array([truth.clearance_m for truth in known]),
        actions=tuple(one.action for one in decisions),
        latencies=_latencies(decisions),
        predicting=_predicting(decisions),
        missed=np.array([decision.deadline_missed for decision in decisions], bool),
        arrival=None if recorded else _arrival(log, decisions, truths, outcome),
        start_distance=math.nan if recorded else start,
        goals=1 if recorded else len(log.mission.goals),
        goals_reached=0 if recorded else goals_reached(decisions, outcome),
        verdicts=tuple(one.verdict for one in verdicts) if verdicts else None,
        cuts=np.array([one.cut for one in verdicts], bool) if verdicts else None,
        tracks=_tracks(decisions, truths),
        beliefs=_beliefs(poses, truths),
        committed_evidence=_evidence(decisions, "committed_evidence"),
        global_evidence=_evidence(decisions, "global_evidence"),
        evidence_ages=_ages(known, perturbations),
    )


def _arrival(
    log: Log, decisions: Sequence[pb.Decision], truths: Sequence[pb.Truth], outcome: str
) -> float | None:
    """Return the time from which the body stays near the last goal, s; None if it does not."""
    goals = log.mission.goals
    if goals_reached(decisions, outcome) < len(goals) - 1:
        return None
    x, y = goals[-1][:2]
    far = [math.dist(truth.position[:2], (x, y)) > NEAR for truth in truths]
    if far[-1]:
        return None
    first = len(far) - far[::-1].index(True) if any(far) else 0
    return truths[first].timestamp.ToNanoseconds() * 1e-9


def _ages(known: Sequence[pb.Truth], perturbations: Sequence[pb.Perturbation]) -> Array | None:
    """Return the age of what came, (n,) s, at each known position; None if all came in time."""
    ages = {one.sequence: one.evidence_age_s for one in perturbations}
    if not any(ages.values()):
        return None
    return np.array([ages.get(one.sequence, 0.0) for one in known])


def _evidence(decisions: Sequence[pb.Decision], name: str) -> Array | None:
    """Return the lengths by provenance, (k, 4) m, of decisions that state them; None if none do."""
    stated = [getattr(one, name) for one in decisions if one.HasField(name)]
    if not stated:
        return None
    return np.array(
        [(one.measured_m, one.prior_m, one.predicted_m, one.unproven_m) for one in stated]
    )


def _beliefs(poses: Sequence[pb.Pose], truths: Sequence[pb.Truth]) -> Beliefs | None:
    """Return errors and covariances of the poses that have a truth; None if none states one.

    Raises:
        InputError: A covariance is none.
    """
    by_number = {one.sequence: one for one in truths}
    stated = [
        (one, by_number[one.sequence], covariance)
        for one in poses
        if one.sequence in by_number and (covariance := covariance_of(one)) is not None
    ]
    if not stated:
        return None
    return Beliefs(
        np.array([np.subtract(pose.position, truth.position) for pose, truth, _ in stated]),
        np.array([covariance[:3, :3] for _, _, covariance in stated]),
    )


def _tracks(
    decisions: Sequence[pb.Decision], truths: Sequence[pb.Truth]
) -> tuple[Track, Track] | None:
    """Return the estimated and the true poses of the decisions that have a truth."""
    by_number = {one.sequence: one for one in truths}
    pairs = [(one, by_number[one.sequence]) for one in decisions if one.sequence in by_number]
    if not pairs:
        return None
    estimates, true = zip(*pairs, strict=True)
    return _track(estimates), _track(true)


def _track(messages: Sequence[pb.Decision | pb.Truth]) -> Track:
    positions = np.array([one.position for one in messages]).reshape(-1, 3)
    return Track(positions, np.array([one.quaternion for one in messages]).reshape(-1, 4))


def _latencies(decisions: Sequence[pb.Decision]) -> Array:
    stages = [decision.stages for decision in decisions]
    return np.array([s.sense_ms + s.map_ms + s.costmap_ms + s.plan_ms for s in stages])


def _predicting(decisions: Sequence[pb.Decision]) -> Array | None:
    took = [one.stages.predict_ms for one in decisions if one.stages.predict_ms]
    return np.array(took) if took else None


def _without_result(
    log: Log, decisions: Sequence[pb.Decision], last: pb.Truth, recorded: bool
) -> dict[str, str]:
    """Return figures of the end as the last truth has them; a recording has no goal to reach."""
    reached, place = goals_before_last(decisions), np.array(last.position)
    left = math.nan if recorded else distance_left(log.mission, reached, place)
    return {
        "sim_time_s": str(last.timestamp.ToNanoseconds() * 1e-9),
        "collisions": str(last.collisions),
        "goal_distance_m": str(left),
    }


def _read(
    path: Path,
) -> tuple[
    list[pb.Decision],
    list[pb.Truth],
    list[pb.RecordedMotion],
    list[pb.Pose],
    list[pb.Perturbation],
]:
    decisions, truths, motions, poses, perturbations = [], [], [], [], []
    for message in read_messages(path):
        if isinstance(message, pb.Decision):
            decisions.append(message)
        elif isinstance(message, pb.Truth):
            truths.append(message)
        elif isinstance(message, pb.RecordedMotion):
            motions.append(message)
        elif isinstance(message, pb.Pose):
            poses.append(message)
        elif isinstance(message, pb.Perturbation):
            perturbations.append(message)
    return decisions, truths, motions, poses, perturbations
