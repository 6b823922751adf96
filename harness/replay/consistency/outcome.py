"""Checks of the result of an episode: it follows from decisions and truth."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from wayproof.harness.config import BUILTIN
from wayproof.harness.decision import Difference
from wayproof.harness.ending import BETWEEN_DECISIONS, Limits
from wayproof.harness.goals import distance_left, goals_before_last
from wayproof.harness.interface.errors import PLUGIN_FAILED
from wayproof.harness.replay.consistency.subject import (
    HALF_STEP_S,
    SAME,
    Subject,
    ends_at_decision,
    is_number,
    number_of,
)
from wayproof.harness.result import figures_of


def check_figures(subject: Subject) -> Iterator[Difference]:
    """Check counts and figures of the result by the messages; an old recovered log has few."""
    result, content = subject.log.result, subject.content
    expected = {
        "decisions": float(len(content.decisions)),
        **figures_of(content.decisions, content.truths),
    }
    if ends_at_decision(subject):
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
    if ends_at_decision(subject):
        if not is_number(recorded, last_s):
            yield Difference("result.sim_time_s", recorded, f"{last_s:.10g}")
        return
    period = subject.segments[-1].period_s
    end_s = number_of(recorded)
    if end_s is None or not last_s - SAME <= end_s <= last_s + period + HALF_STEP_S:
        yield Difference("result.sim_time_s", recorded, f"{last_s:.6g} to {last_s + period:.6g}")


def check_outcome(subject: Subject) -> Iterator[Difference]:
    """Check that only the last decision ends the episode, with the recorded outcome."""
    content, result = subject.content, subject.log.result
    positions = [np.array(one.position) for one in content.truths]
    last, reached = len(content.decisions) - 1, 0
    for number, decision in enumerate(content.decisions):
        verdict = _limits(subject, number).ending_at(decision, positions[: number + 1], reached)
        reached += decision.action == "goal"
        if number < last and verdict is not None:
            yield Difference(
                "number of decisions", str(last + 1), f"{number + 1}: {verdict[0]}, {verdict[1]}"
            )
            return
    outcome, reason = result["outcome"], result.get("reason", "")
    if verdict is None and outcome not in BETWEEN_DECISIONS:
        expected = f"one of {', '.join(BETWEEN_DECISIONS)}: decision {last} ends nothing"
        yield Difference("result.outcome", outcome, expected)
    if verdict is not None and not subject.incomplete:
        for name, recorded, expected in zip(
            ("outcome", "reason"), (outcome, reason), verdict, strict=True
        ):
            if recorded != expected:
                yield Difference(f"result.{name}", recorded, expected)


def _limits(subject: Subject, number: int) -> Limits:
    segment = subject.segment_of(number)
    return Limits(segment.config.episode, segment.mission, segment.period_s)


def check_contacts(subject: Subject) -> Iterator[Difference]:
    """Check that contacts end the episode: none before, at least one in a collision."""
    result, content = subject.log.result, subject.content
    for truth in content.truths:
        touched = truth.collisions + truth.hit_by_mover
        if touched:
            yield Difference(f"/truth[{truth.sequence}] contacts", str(touched), "0")
            return
    counts = [number_of(result.get(name, "0")) or 0.0 for name in ("collisions", "struck")]
    if result["outcome"] == "collision":
        if sum(counts) < 1.0:
            yield Difference("result.collisions and struck", "0", "at least 1 in a collision")
    elif sum(counts) > 0.0:
        yield Difference("result.collisions and struck", f"{sum(counts):g}", "0")
    elif result.get("contact"):
        yield Difference("result.contact", result["contact"], "none but of a collision")


def check_cause(subject: Subject) -> Iterator[Difference]:
    """Check that only a failure has a cause."""
    cause, outcome = subject.log.result.get("cause", ""), subject.log.result["outcome"]
    on_trial = subject.log.config.stack.name != BUILTIN
    predicts = subject.log.config.runs_predictor
    if outcome == "error" and cause == PLUGIN_FAILED and (on_trial or predicts):
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
            return
