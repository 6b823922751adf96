"""Checks of the result of an episode or a recording: it follows from decisions and truth."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from wayproof.harness.config import BUILTIN
from wayproof.harness.decision import Difference
from wayproof.harness.ending import BETWEEN_DECISIONS, Limits
from wayproof.harness.goals import distance_left, goals_before_last
from wayproof.harness.interface.errors import PLUGIN_FAILED
from wayproof.harness.replay.consistency.messages import (
    HALF_STEP_S,
    SAME,
    Subject,
    differs,
    is_number,
    number_of,
)
from wayproof.harness.result import RECORDED, figures_of, recorded_figures, way_of


def check_figures(subject: Subject) -> Iterator[Difference]:
    """Check counts and figures of the result by the messages; a recovered log has few."""
    result, content = subject.log.result, subject.content
    expected = {
        "decisions": float(len(content.decisions)),
        **figures_of(content.decisions, content.truths),
    }
    if subject.ends_at_decision:
        last = content.truths[-1]
        mission, reached = subject.segments[-1].mission, goals_before_last(content.decisions)
        expected["goal_distance_m"] = distance_left(mission, reached, np.array(last.position))
    for name, value in expected.items():
        recorded = result.get(name)
        if recorded is None and subject.incomplete:
            continue
        if not is_number(recorded, value):
            yield Difference(f"result.{name}", str(recorded), f"{value:.10g}")


def check_end_time(subject: Subject) -> Iterator[Difference]:
    """Check that the episode ends with its last decision, or before the next one."""
    last_s = subject.content.decisions[-1].timestamp.ToNanoseconds() * 1e-9
    recorded = subject.log.result.get("sim_time_s", "")
    latest = last_s
    if not subject.ends_at_decision:
        latest += subject.segments[-1].period_s + HALF_STEP_S
    end_s = number_of(recorded)
    if end_s is None or not last_s - SAME * max(last_s, 1.0) <= end_s <= latest + SAME * latest:
        yield Difference("result.sim_time_s", recorded, f"{last_s:.10g} to {latest:.10g}")


def check_outcome(subject: Subject) -> Iterator[Difference]:
    """Check that only the last decision ends the episode, with the recorded outcome."""
    content, result = subject.content, subject.log.result
    positions = [np.array(one.position) for one in content.truths]
    last, reached = len(content.decisions) - 1, 0
    for number, decision in enumerate(content.decisions):
        verdict = _limits(subject, number).ending_at(decision, positions[: number + 1], reached)
        reached += decision.action == "goal"
        if number < last and verdict is not None:
            ended = f"{number + 1}: {verdict[0]}, {verdict[1]}"
            yield Difference("number of decisions", str(last + 1), ended)
    outcome, reason = result["outcome"], result.get("reason", "")
    if verdict is None and outcome not in BETWEEN_DECISIONS:
        expected = f"one of {', '.join(BETWEEN_DECISIONS)}: decision {last} ends nothing"
        yield Difference("result.outcome", outcome, expected)
    if verdict is not None and not subject.incomplete:
        yield from differs("result.outcome", outcome, verdict[0])
        yield from differs("result.reason", reason, verdict[1])


def _limits(subject: Subject, number: int) -> Limits:
    segment = subject.segment_of(number)
    return Limits(segment.config.episode, segment.mission, segment.period_s)


def check_contacts(subject: Subject) -> Iterator[Difference]:
    """Check that contacts end the episode: none before, at least one in a collision."""
    result, content = subject.log.result, subject.content
    for truth in content.truths:
        touched = truth.collisions + truth.hit_by_mover
        yield from differs(f"/truth[{truth.sequence}] contacts", touched, 0)
    counts = sum(number_of(result.get(name, "0")) or 0.0 for name in ("collisions", "struck"))
    if result["outcome"] == "collision":
        if counts < 1.0:
            yield Difference("result.collisions and struck", "0", "at least 1 in a collision")
        return
    yield from differs("result.collisions and struck", f"{counts:g}", "0")
    if result.get("contact"):
        yield Difference("result.contact", result["contact"], "none but of a collision")


def check_cause(subject: Subject) -> Iterator[Difference]:
    """Check that only a failure has a cause."""
    cause, outcome = subject.log.result.get("cause", ""), subject.log.result["outcome"]
    config = subject.log.config
    from_outside = config.stack.name != BUILTIN or config.runs_predictor
    if outcome == "error" and cause == PLUGIN_FAILED and from_outside:
        return
    if cause and outcome in ("success", "error"):
        yield Difference("result.cause", cause, "none")


def check_geofence(subject: Subject) -> Iterator[Difference]:
    """Check that every true position is inside the geofence: leaving it ends the episode."""
    for truth in subject.content.truths:
        mission = subject.segment_of(truth.sequence).mission
        bounds = zip(mission.low, truth.position, mission.high, strict=False)
        if len(truth.position) != 3 or not all(low <= x <= high for low, x, high in bounds):
            place = ", ".join(f"{x:.2f}" for x in truth.position)
            yield Difference(f"/truth[{truth.sequence}].position", place, "inside the geofence")


def check_recorded_result(subject: Subject) -> Iterator[Difference]:
    """Check that the figures of a recording's result follow from decisions and motion."""
    result, content = subject.log.result, subject.content
    if result["outcome"] != "error":
        yield from differs("result.outcome", result["outcome"], RECORDED)
    for name, value in recorded_figures(content.decisions, content.motions).items():
        if isinstance(value, str) or not is_number(result.get(name), value):
            yield from differs(f"result.{name}", result.get(name, "none"), value)


def check_recorded_way(subject: Subject) -> Iterator[Difference]:
    """Check that the way is unbroken and leads through the poses, but for a perturbation's error.

    A pose that a perturbation makes late is one that the way led through before. A way of one pose
    begins again: it was not recorded how the robot got there. A pose that an estimator made of the
    sweeps is an input of its own.
    """
    before, passed = None, []
    perturbation = subject.log.config.perturbation
    late = perturbation is not None and perturbation.delays_pose
    estimated = subject.log.config.estimate.kind != "model"
    shifts = {one.sequence: list(one.pose_shift) for one in subject.content.perturbations}
    for motion, pose in zip(subject.content.motions, subject.content.poses, strict=False):
        way, place = way_of(motion), f"/recorded[{motion.sequence}]"
        ends = way[0, :3].tolist(), way[-1, :3].tolist()
        joins = before is None or len(way) == 1 or ends[0] == before
        if ends[1] != list(motion.position) or not joins:
            yield Difference(f"{place}.way", f"{ends}", f"{[before, list(motion.position)]}")
        before = ends[1]
        shift = shifts.get(motion.sequence, [0.0, 0.0, 0.0])
        passed.append(motion.position)
        possible = np.array(passed if late else passed[-1:]) + shift
        off = np.abs(possible - pose.position).max(axis=1).min()
        if not estimated and not off <= SAME:
            yield Difference(f"{place}.position", f"{list(motion.position)}", f"{pose.position}")
