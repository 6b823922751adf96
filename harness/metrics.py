"""Metrics of an episode: pure functions of its log, each with unit, formula and source.

None of them runs the simulator or the stack: `wayproof explain --metrics` has the log alone.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from wayproof.harness import trajectory_error
from wayproof.harness.statistics.support import COUNT, MEASURE, RATE, SHARE, TIME, Support
from wayproof.harness.trace import Array, Trace

STANDING_SPEED = 0.05
"""Speed below which the robot counts as stopped, m/s; a trot in place sways by about 0.03."""

LEAST_SIGMA = 1e-6
"""Standard deviation added to a stated one, m: errors are logged in whole micrometres."""

STALE_AFTER = 0.3
"""Age beyond which evidence is stale, s: Nav2's `transform_tolerance` of a costmap."""

BARN_SPEED = 2.0
"""Speed by which BARN turns a reference length into an optimal time, m/s."""

BARN_CLIP = (2.0, 8.0)
"""Times the optimal time between which BARN's score counts the actual time (edition of 2024)."""


def success(trace: Trace) -> float:
    """1 if the goal was reached; a timeout, a crash and an error are failures alike."""
    return float(trace.success)


def progress(trace: Trace) -> float | None:
    """Share of the mission's goals that were reached (MultiON, Wani et al. 2020, NeurIPS)."""
    return trace.goals_reached / trace.goals


def spl(trace: Trace) -> float | None:
    """S l / max(p, l): success weighted by path length (Anderson et al. 2018, equation 1).

    Of several goals, l is the sum of the shortest ways from each to the next.
    """
    return None if trace.route_length is None else success(trace) * _efficiency(trace)


def soft_spl(trace: Trace) -> float | None:
    """(1 - d_end / d_start) l / max(p, l), progress clipped to [0, 1] (Habitat-Lab, nav.py).

    Of several goals, d leads to the next goal and on through the others.
    """
    if trace.route_length is None:
        return None
    started = trace.start_distance
    progress = 1.0 - trace.goal_distance / started if started > 0.0 else success(trace)
    return min(max(progress, 0.0), 1.0) * _efficiency(trace)


def _efficiency(trace: Trace) -> float:
    assert trace.route_length is not None
    return efficiency(trace.path_length, trace.route_length)


def efficiency(path_length: float, route_length: float) -> float:
    """L / max(p, l) of a way of length p, where the shortest way has length l; both in m."""
    longest = max(path_length, route_length)
    return route_length / longest if longest > 0.0 else 1.0


def barn_score(trace: Trace) -> float | None:
    """S OT / clip(AT, 2 OT, 8 OT), OT = l / (2 m/s) (the BARN challenge's run.py).

    A trial of BARN ends 1 m from the goal: S is whether it came there, AT when. Where the start is
    the goal, OT is 0, and a success has the score of the least time, 1/2.
    """
    if trace.route_length is None:
        return None
    if trace.arrival is None:
        return 0.0
    optimal = trace.route_length / BARN_SPEED
    if optimal == 0.0:
        return 1.0 / BARN_CLIP[0]
    shortest, longest = (factor * optimal for factor in BARN_CLIP)
    return optimal / min(max(trace.arrival, shortest), longest)


def collisions(trace: Trace) -> float:
    """Times that the robot began to touch something but the floor."""
    return float(trace.collisions)


def least_clearance(trace: Trace) -> float:
    """Least true distance from the body to what it must not touch, at decision times, m.

    Nothing is measured beyond 2 m: 2 means that or more.
    """
    return float(trace.clearances.min())


def path_length(trace: Trace) -> float:
    """Distance travelled, true, sampled at decisions, m."""
    return trace.path_length


def path_ratio(trace: Trace) -> float | None:
    """Distance travelled over the shortest route; for successes alone."""
    if trace.route_length is None or not trace.success or trace.route_length == 0.0:
        return None
    return trace.path_length / trace.route_length


def time_to_goal(trace: Trace) -> float | None:
    """Simulated time to the goal, s; for successes alone (average it restricted)."""
    return trace.duration if trace.success else None


def time_near_goal(trace: Trace) -> float | None:
    """Simulated time until the body is within 1 m of the last goal and stays there, s."""
    return trace.arrival


def time_stopped(trace: Trace) -> float:
    """Time slower than 0.05 m/s, s; a stop still under way at the end counts up to the end."""
    spans = np.diff(np.append(trace.times, max(trace.duration, trace.times[-1])))
    return float(spans[np.linalg.norm(trace.velocities, axis=1) < STANDING_SPEED].sum())


def explorations(trace: Trace) -> float:
    """Number of explorations: runs of `explore`, not decisions.

    Following a path whose far end is unknown is no exploration.
    """
    return _runs(trace, "explore")


def stops(trace: Trace) -> float:
    """Times that the stack stopped for something or waited: runs of `stop_and_wait`, not decisions.

    Braking to the goal is no stop.
    """
    return _runs(trace, "stop_and_wait")


def _runs(trace: Trace, action: str) -> float:
    """Number of times that an action begins."""
    chosen = [name == action for name in trace.actions]
    pairs = zip([False, *chosen[:-1]], chosen, strict=True)
    return float(sum(now and not before for before, now in pairs))


def jerk(trace: Trace) -> float | None:
    """Root mean square of the second difference of velocity over the square of its step, m/s^3.

    n samples have n - 1 steps and n - 2 second differences; each is divided by the true time
    between its samples, so that the figure does not scale with the rate of decisions.
    """
    if len(trace.times) < 3:
        return None
    steps = np.diff(trace.times)[:, None]
    acceleration = np.diff(trace.velocities, axis=0) / steps  # (n - 1, 3)
    between = (steps[1:] + steps[:-1]) / 2.0
    squares = np.square(np.diff(acceleration, axis=0) / between).sum(axis=1)
    return float(np.sqrt(squares.mean()))


def ate(trace: Trace) -> float | None:
    """Root mean square of the distance between estimated and true position, m.

    The absolute trajectory error (Sturm et al. 2012, IROS), not aligned: both are in one frame.
    """
    return None if trace.tracks is None else trajectory_error.ate(*trace.tracks)


def rpe(trace: Trace) -> float | None:
    """Root mean square of the error of the motion from a decision to the next, m.

    The relative pose error (Sturm et al. 2012, equation 2), its translation, over one decision.
    """
    return None if trace.tracks is None else trajectory_error.rpe(*trace.tracks)


def nees(trace: Trace) -> float | None:
    """Mean of e' P^-1 e / 3, e the error of the position and P its stated covariance: nominal 1.

    The normalized estimation error squared (Bar-Shalom, Li and Kirubarajan 2001, section 5.4), by
    its number of axes. Less than 1: it states more than it errs. For estimators that state a
    covariance.
    """
    if trace.beliefs is None:
        return None
    errors, covariances = trace.beliefs.errors, trace.beliefs.covariances
    floored = covariances + LEAST_SIGMA**2 * np.eye(3)
    solved = np.linalg.solve(floored, errors[:, :, None])[:, :, 0]
    return float((errors * solved).sum(axis=1).mean() / 3.0)


def coverage_x(trace: Trace) -> float | None:
    """Share of decisions with an error along x of at most two stated deviations: nominal 0.954."""
    return _coverage(trace, 0)


def coverage_y(trace: Trace) -> float | None:
    """Share of decisions with an error along y of at most two stated deviations: nominal 0.954."""
    return _coverage(trace, 1)


def coverage_z(trace: Trace) -> float | None:
    """Share of decisions with an error along z of at most two stated deviations: nominal 0.954."""
    return _coverage(trace, 2)


def _coverage(trace: Trace, axis: int) -> float | None:
    if trace.beliefs is None:
        return None
    sigmas = np.sqrt(trace.beliefs.covariances[:, axis, axis])
    return float((np.abs(trace.beliefs.errors[:, axis]) <= 2.0 * sigmas).mean())


def latency_p50(trace: Trace) -> float:
    """Median wall time from the sweep to the decision, ms."""
    return float(np.percentile(trace.latencies, 50))


def latency_p99(trace: Trace) -> float:
    """99th percentile of the wall time from the sweep to the decision, ms."""
    return float(np.percentile(trace.latencies, 99))


def latency_max(trace: Trace) -> float:
    """Longest wall time from the sweep to the decision, ms."""
    return float(trace.latencies.max())


def predict_p50(trace: Trace) -> float | None:
    """Median wall time until a predictor from outside had answered, ms; no part of the latency."""
    return None if trace.predicting is None else float(np.percentile(trace.predicting, 50))


def deadline_misses(trace: Trace) -> float:
    """Decisions that took effect too late and were discarded."""
    return float(trace.missed.sum())


def not_admitted(trace: Trace) -> float | None:
    """n_unproven / n: share of decisions whose command the referee found blocked or unknown.

    For stacks on trial alone: no referee judges the built-in one.
    """
    if not trace.verdicts:
        return None
    return sum(verdict != "admitted" for verdict in trace.verdicts) / len(trace.verdicts)


def guard_cuts(trace: Trace) -> float | None:
    """Decisions at which the guard braked in the stack's place; 0 without `stack.guard`."""
    return None if trace.cuts is None else float(trace.cuts.sum())


def admitted_share(trace: Trace) -> float | None:
    """Share of a recorded way that was known to be free when it was entered."""
    return trace.admitted_share


def unmeasured_share(trace: Trace) -> float | None:
    """Length of committed paths that rests on a prior map or a prediction over all of it.

    Summed over the decisions. With a prior map alone; 0 unless `prior.policy=admit`.
    """
    return _unmeasured(trace.committed_evidence)


def guided_share(trace: Trace) -> float | None:
    """Length of global paths that rests on a prior map or a prediction over all of it."""
    return _unmeasured(trace.global_evidence)


def _unmeasured(lengths: Array | None) -> float | None:
    if lengths is None or lengths.sum() == 0.0:
        return None
    return float(lengths[:, 1:3].sum() / lengths.sum())


@dataclass(frozen=True)
class Metric:
    """A figure of an episode.

    Attributes:
        function: Function from a trace; none where the episode has no such figure.
        unit: Empty for a share or a count.
        higher_is_better: Direction of improvement; None where neither is better.
        support: The values that it can take, from which intervals of its mean follow.
        matters: Least difference that a table marks, in its unit: a smaller one is shown in black.
    """

    function: Callable[[Trace], float | None]
    unit: str
    higher_is_better: bool | None
    support: Support
    matters: float = 0.01


BARN = Support("share", 0.0, 1.0 / BARN_CLIP[0])
"""Support of BARN's score: the time counts at least twice the optimal one."""


def stale_way(trace: Trace) -> float | None:
    """Distance travelled while the newest content of some stream was older than 0.3 s, true, m.

    Of episodes in which streams stop, freeze or come late.
    """
    if trace.evidence_ages is None:
        return None
    steps = np.linalg.norm(np.diff(trace.positions, axis=0), axis=1)
    return float(steps[trace.evidence_ages[:-1] > STALE_AFTER].sum())


METRICS: dict[str, Metric] = {
    "success": Metric(success, "", True, RATE),
    "progress": Metric(progress, "", True, SHARE),
    "spl": Metric(spl, "", True, SHARE, 0.02),
    "soft_spl": Metric(soft_spl, "", True, SHARE, 0.02),
    "barn_score": Metric(barn_score, "", True, BARN),
    "collisions": Metric(collisions, "", False, COUNT),
    "least_clearance": Metric(least_clearance, "m", True, MEASURE, 0.02),
    "path_length": Metric(path_length, "m", None, MEASURE),
    "path_ratio": Metric(path_ratio, "", False, MEASURE, 0.02),
    "time_to_goal": Metric(time_to_goal, "s", False, TIME, 0.3),
    "time_near_goal": Metric(time_near_goal, "s", False, TIME, 0.3),
    "time_stopped": Metric(time_stopped, "s", False, TIME, 0.3),
    "explorations": Metric(explorations, "", None, COUNT),
    "stops": Metric(stops, "", None, COUNT, 0.2),
    "jerk": Metric(jerk, "m/s^3", False, MEASURE, 0.5),
    "ate": Metric(ate, "m", False, MEASURE, 0.01),
    "rpe": Metric(rpe, "m", False, MEASURE, 0.01),
    "nees": Metric(nees, "", None, MEASURE),
    "coverage_x": Metric(coverage_x, "", True, SHARE),
    "coverage_y": Metric(coverage_y, "", True, SHARE),
    "coverage_z": Metric(coverage_z, "", True, SHARE),
    "latency_p50": Metric(latency_p50, "ms", False, MEASURE, 5.0),
    "latency_p99": Metric(latency_p99, "ms", False, MEASURE, 20.0),
    "latency_max": Metric(latency_max, "ms", False, MEASURE, 50.0),
    "predict_p50": Metric(predict_p50, "ms", False, MEASURE, 5.0),
    "deadline_misses": Metric(deadline_misses, "", False, COUNT, 0.5),
    "not_admitted": Metric(not_admitted, "", False, SHARE),
    "guard_cuts": Metric(guard_cuts, "", False, COUNT, 0.5),
    "admitted_share": Metric(admitted_share, "", True, SHARE),
    "unmeasured_share": Metric(unmeasured_share, "", False, SHARE),
    "guided_share": Metric(guided_share, "", None, SHARE),
    "stale_way": Metric(stale_way, "m", False, MEASURE, 0.1),
}


OF_TRUTH = (
    *("success", "progress", "spl", "soft_spl", "barn_score", "collisions", "least_clearance"),
    *("path_ratio", "time_to_goal"),
    *("nees", "coverage_x", "coverage_y", "coverage_z"),
)
"""Metrics that need the truth, which a recording lacks."""

OF_STACKS_ON_TRIAL = ("not_admitted", "guard_cuts")
"""Figures that only stacks on trial have."""


def score(trace: Trace) -> dict[str, float | None]:
    """Every metric of an episode, by name; of a recording those that need no truth."""
    return {
        name: None if trace.recorded and name in OF_TRUTH else metric.function(trace)
        for name, metric in METRICS.items()
    }
