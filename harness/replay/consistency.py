"""Checks of a log for internal consistency, without deciding or simulating again.

Redundant content must agree: the result follows from decisions and truth, each link of the chain
from its record, hashes from their inputs, delays and perturbation records from the config. The
checks only read the file, so verbs that read a log run them first.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import get_args

import numpy as np

from wayproof.harness.config import BUILTIN
from wayproof.harness.ending import BETWEEN_DECISIONS, Limits
from wayproof.harness.errors import InputError
from wayproof.harness.goals import distance_left, goals_before_last
from wayproof.harness.input_messages import unit_quaternion
from wayproof.harness.interface.errors import PredictorCause, StackCause
from wayproof.harness.log.digest import CONTENT
from wayproof.harness.log.reader import Log
from wayproof.harness.log.streams import own_streams
from wayproof.harness.log.writer import FORMAT_VERSION, WITH_REASONS
from wayproof.harness.perturbations import UNPERTURBED
from wayproof.harness.recompute.segments import Segment, segments_of
from wayproof.harness.replay.content import Content, read_content
from wayproof.harness.result import RECORDED, ends_in_error, figures_of, recorded_figures, way_of
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.harness.stack.decision import Difference, chain_hash

SAME = 1e-9
"""Relative difference up to which two figures, summed in different orders, are equal."""

HALF_STEP_S = 0.005
"""Tolerance of the period of decisions, s: half of the longest physics step."""

NUMBERED = ("poses", "latencies", "truths", "streams")
"""Kinds of messages with one message per decision."""

NUMBERED_OF_GOALS = ("poses", "goals", "latencies", "truths", "streams")
"""The same of a mission with several goals."""

NUMBERED_OF_RECORDING = ("poses", "goals", "latencies", "motions", "streams")
"""The same of a recording, which has no truth."""

INPUTS = ("poses", "goals", "latencies")
"""Of these, inputs, which are not read for a row of a study."""


@dataclass(frozen=True)
class Subject:
    """A log and its messages, the subject of the checks.

    Attributes:
        log: Head of the log.
        content: Messages of the log.
        segments: Settings by segment; one if the log was never forked.
    """

    log: Log
    content: Content
    segments: tuple[Segment, ...]

    def segment_of(self, number: int) -> Segment:
        """Return the settings of a decision."""
        return next(one for one in reversed(self.segments) if one.begin <= max(number, 0))

    @property
    def incomplete(self) -> bool:
        """Whether the result says that the episode ended in an error."""
        return ends_in_error(self.log.result)


def contradictions(log: Log, content: Content | None = None) -> list[Difference]:
    """Return all contradictions in a log: what is recorded, and what follows from the rest.

    Args:
        log: Head of the log.
        content: Its messages, if they were read already.

    Raises:
        InputError: The file breaks off or is damaged, or holds no decision.
    """
    content = content or read_content(log)
    altered = list(_digest(log, content))
    if not content.decisions:
        if ends_in_error(log.result):
            return altered  # a stack may fail before its first decision
        raise InputError(f"log '{log.path}': no decisions in it")
    subject = Subject(log, content, tuple(segments_of(log)))
    found = [*_format(subject), *_numbering(subject)]
    if not found:  # the checks index the messages by number
        checks = CHECKS if log.config.recording is None else CHECKS_OF_RECORDING
        found = [one for check in checks for one in check(subject)]
    return found + altered  # the digest names no place, so it comes last


def refuse_contradictions(log: Log, content: Content | None = None, hint: str = "") -> None:
    """Raise an InputError with the first contradiction in a log, if any, and a hint."""
    found = contradictions(log, content)
    if found:
        one, more = found[0], f", and {len(found) - 1} more" if len(found) > 1 else ""
        raise InputError(
            f"log '{log.path}': {one.field} is {one.recorded}, but {one.recomputed} follows from "
            f"the rest of the log{more}{hint}"
        )


def _digest(log: Log, content: Content) -> Iterator[Difference]:
    """The digest of the file is that in the result; logs of formats before 5 may have none."""
    recorded = log.result.get(CONTENT)
    if not content.digest or (recorded is None and log.run["format_version"] not in WITH_REASONS):
        return
    if recorded != content.digest:
        yield Difference("content digest", recorded or "none", content.digest)


def _format(subject: Subject) -> Iterator[Difference]:
    """Decisions of formats before 5 have no predicate; with one, replay would skip the reasons."""
    version = subject.log.run["format_version"]
    if version not in WITH_REASONS and any(
        one.HasField("predicate") for one in subject.content.decisions
    ):
        yield Difference("run.format_version", version, FORMAT_VERSION)


def _numbering(subject: Subject) -> Iterator[Difference]:
    """Decisions count from 0; each has pose, delay, truth and hashes of its number and time."""
    content, last_ns = subject.content, -1
    for number, decision in enumerate(content.decisions):
        name, now_ns = f"/decision[{number}]", decision.timestamp.ToNanoseconds()
        if decision.sequence != number:
            yield Difference(f"{name}.sequence", str(decision.sequence), str(number))
            return
        if now_ns <= last_ns:
            yield Difference(f"{name}.timestamp", f"{now_ns} ns", f"more than {last_ns} ns")
        last_ns = now_ns
    stamps = [(one.sequence, one.timestamp.ToNanoseconds()) for one in content.decisions]
    for kind in _numbered(subject.log):
        messages: Sequence[pb.Truth] = getattr(content, kind)
        if kind in INPUTS and not messages and not content.inputs:
            continue  # not read for a row of a study
        yield from _stamps(kind, messages, stamps, subject.incomplete)


def _numbered(log: Log) -> tuple[str, ...]:
    """Return the kinds of messages with one message per decision."""
    if log.config.recording is not None:
        return NUMBERED_OF_RECORDING
    return NUMBERED_OF_GOALS if log.has_goals else NUMBERED


def _stamps(
    kind: str, messages: Sequence[pb.Truth], stamps: list[tuple[int, int]], may_lead: bool
) -> Iterator[Difference]:
    """Numbers and times are those of the decisions; at an error inputs may lead by one."""
    found = [(one.sequence, one.timestamp.ToNanoseconds()) for one in messages]
    leads = may_lead and kind in (*INPUTS, "motions") and len(found) == len(stamps) + 1
    if len(found) != len(stamps) and not leads:
        yield Difference(f"number of {kind}", str(len(found)), str(len(stamps)))
    for number, (one, expected) in enumerate(zip(found, stamps, strict=False)):
        if one != expected:
            place = f"{kind}[{number}]"
            yield Difference(place, "{} at {} ns".format(*one), "{} at {} ns".format(*expected))
            return


def _period(subject: Subject) -> Iterator[Difference]:
    """Decisions follow each other at the rate of the first sensor."""
    times = [one.timestamp.ToNanoseconds() * 1e-9 for one in subject.content.decisions]
    for number, (before, now) in enumerate(itertools.pairwise(times), 1):
        period = subject.segment_of(number - 1).period_s
        if abs(now - before - period) > HALF_STEP_S:
            name = f"time between decisions {number - 1} and {number}"
            yield Difference(name, f"{now - before:.3f} s", f"{period:.3f} s")
            return


def _chain(subject: Subject) -> Iterator[Difference]:
    """Each link is the hash of its record and the link before; the last one is the result's.

    A log of decisions keeps few global paths; the links of the others cannot be computed.
    """
    thinned = subject.log.record == "decisions"
    before = ""
    for decision in subject.content.decisions:
        again = chain_hash(decision, before)
        before = decision.chain
        if again != before and not (thinned and not decision.global_path):
            yield Difference(f"/decision[{decision.sequence}].chain", before, again)
            return
    if subject.log.result["chain"] != before:
        yield Difference("result.chain", subject.log.result["chain"], before)


def _figures(subject: Subject) -> Iterator[Difference]:
    """Counts and figures of the result follow from the messages; an old recovered log has few."""
    result, content = subject.log.result, subject.content
    expected = {
        "decisions": float(len(content.decisions)),
        **figures_of(content.decisions, content.truths),
    }
    if _ends_at_decision(subject):
        last = content.truths[-1]
        mission, reached = subject.segments[-1].mission, goals_before_last(content.decisions)
        expected["goal_distance_m"] = distance_left(mission, reached, np.array(last.position))
    for name, value in expected.items():
        recorded = result.get(name)
        if recorded is None and subject.incomplete:
            continue
        if not _is_number(recorded, value):
            yield Difference(f"result.{name}", str(recorded), f"{value:.10g}")


def _end_time(subject: Subject) -> Iterator[Difference]:
    """The episode ends with its last decision, or before the next one."""
    last_s = subject.content.decisions[-1].timestamp.ToNanoseconds() * 1e-9
    recorded = subject.log.result.get("sim_time_s", "")
    if _ends_at_decision(subject):
        if not _is_number(recorded, last_s):
            yield Difference("result.sim_time_s", recorded, f"{last_s:.10g}")
        return
    period = subject.segments[-1].period_s
    end_s = _number(recorded)
    if end_s is None or not last_s - SAME <= end_s <= last_s + period + HALF_STEP_S:
        yield Difference("result.sim_time_s", recorded, f"{last_s:.6g} to {last_s + period:.6g}")


def _outcome(subject: Subject) -> Iterator[Difference]:
    """Only the last decision may end the episode, with the recorded outcome."""
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


def _contacts(subject: Subject) -> Iterator[Difference]:
    """A contact ends the episode: there is none before, and at least one in a collision."""
    result, content = subject.log.result, subject.content
    for truth in content.truths:
        touched = truth.collisions + truth.hit_by_mover
        if touched:
            yield Difference(f"/truth[{truth.sequence}] contacts", str(touched), "0")
            return
    counts = [_number(result.get(name, "0")) or 0.0 for name in ("collisions", "struck")]
    if result["outcome"] == "collision":
        if sum(counts) < 1.0:
            yield Difference("result.collisions and struck", "0", "at least 1 in a collision")
    elif sum(counts) > 0.0:
        yield Difference("result.collisions and struck", f"{sum(counts):g}", "0")
    elif result.get("contact"):
        yield Difference("result.contact", result["contact"], "none but of a collision")


def _cause(subject: Subject) -> Iterator[Difference]:
    """Only a failure has a cause."""
    cause, outcome = subject.log.result.get("cause", ""), subject.log.result["outcome"]
    on_trial = subject.log.config.stack.name != BUILTIN
    predicts = subject.log.config.asks_predictor
    if outcome == "error" and (
        (on_trial and cause in get_args(StackCause))
        or (predicts and cause in get_args(PredictorCause))
    ):
        return
    if cause and outcome in ("success", "error"):
        yield Difference("result.cause", cause, "none")


def _geofence(subject: Subject) -> Iterator[Difference]:
    """Leaving the geofence ends the episode, so every true position is inside."""
    for truth in subject.content.truths:
        mission = subject.segment_of(truth.sequence).mission
        bounds = zip(mission.low, truth.position, mission.high, strict=False)
        if len(truth.position) != 3 or not all(low <= x <= high for low, x, high in bounds):
            place = ", ".join(f"{x:.2f}" for x in truth.position)
            yield Difference(f"/truth[{truth.sequence}].position", place, "inside the geofence")
            return


def _inputs(subject: Subject) -> Iterator[Difference]:
    """Each decision repeats its pose and the digest of its inputs."""
    content = subject.content
    for decision, had in zip(content.decisions, content.inputs, strict=False):
        name = f"/decision[{decision.sequence}].input_digest"
        if decision.input_digest != had.digest:
            yield Difference(name, decision.input_digest, had.digest)
            return
    for decision, pose in zip(content.decisions, content.poses, strict=False):
        pairs = {
            "position": (list(decision.position), list(pose.position)),
            "quaternion": (
                list(decision.quaternion),
                unit_quaternion(np.array(pose.quaternion)).tolist(),
            ),
            "position_sigma": (decision.position_sigma, pose.position_sigma),
        }
        for field, (one, other) in pairs.items():
            if one != other:
                yield Difference(f"/decision[{decision.sequence}].{field}", f"{one}", f"{other}")
                return


def _hashes(subject: Subject) -> Iterator[Difference]:
    """The running hashes follow from the logged inputs."""
    content = subject.content
    older = subject.log.run["format_version"] == "3"  # its first logs have longer hashes
    for streams, had in zip(content.streams, content.inputs, strict=False):
        recorded = {one.name: one.hash for one in streams.streams}
        expected_names = {f"sensor/{name}" for name in subject.segment_of(streams.sequence).beams}
        for name in sorted({*expected_names, *own_streams(subject.log.config)}):
            one, other = recorded.get(name, "none"), had.hashes[name]
            if one != other and not (older and len(one) > len(other)):
                yield Difference(f"/streams[{streams.sequence}].{name}", one, other)
                return


def _delays(subject: Subject) -> Iterator[Difference]:
    """A modelled delay follows from the config, and each decision repeats it."""
    content = subject.content
    for decision, latency in zip(content.decisions, content.latencies, strict=False):
        number = decision.sequence
        config = subject.segment_of(number).config.latency
        if latency.mode != config.mode:
            yield Difference(f"/latency[{number}].mode", latency.mode, config.mode)
            return
        expected = latency.delay_s
        if config.mode == "modelled":
            expected = config.expected + _added_delay(subject, number)
        for place, recorded in (("latency", latency.delay_s), ("decision", decision.delay_s)):
            if recorded != expected:
                yield Difference(f"/{place}[{number}].delay_s", f"{recorded!r}", f"{expected!r}")
                return


def _perturbation(subject: Subject) -> Iterator[Difference]:
    """Perturbation records follow from the config; without a perturbation there is none."""
    records = {one.sequence: one for one in subject.content.perturbations}
    for decision in subject.content.decisions:
        number = decision.sequence
        place, record = f"/perturbation[{number}]", records.get(number)
        perturbation = subject.segment_of(number).config.perturbation
        if record is None or perturbation is None:
            if record is not None or perturbation is not None:
                kinds = [one.kind if one else "none" for one in (record, perturbation)]
                yield Difference(place, *kinds)
                return
            continue
        active = _is_active(subject, number)
        expected = {
            "kind": perturbation.kind,
            "severity": math.ceil(perturbation.severity),
            "amount": perturbation.amount if active else perturbation.nothing,
            "added_delay_s": _added_delay(subject, number),
        }
        for field, value in expected.items():
            if getattr(record, field) != value:
                yield Difference(f"{place}.{field}", str(getattr(record, field)), str(value))
                return


def _places(subject: Subject) -> Iterator[Difference]:
    """Start and goals of the mission are those of the resolved config."""
    for segment in subject.segments:
        config, mission = segment.config, segment.mission
        both = (config.waypoints, mission.waypoints)
        if len(both[0]) != len(both[1]):
            yield Difference("config.waypoints", f"{both[0]}", f"{both[1]}")
        pairs = [("start", config.start, mission.start), ("goal", config.goal, mission.goal)]
        pairs += [("waypoints", *points) for points in zip(*both, strict=False)]
        for name, placed, point in pairs:
            if placed is not None and tuple(placed) != point[: len(placed)]:
                yield Difference(f"config.{name}", str(placed), str(point))


def _goals(subject: Subject) -> Iterator[Difference]:
    """The goal of each decision is the next one of the mission, by the goals reached before."""
    content, reached = subject.content, 0
    for decision, goal in zip(content.decisions, content.goals, strict=False):
        number = decision.sequence
        goals = subject.segment_of(number).mission.goals
        expected = (min(reached, len(goals) - 1), list(goals[min(reached, len(goals) - 1)]))
        if (goal.index, list(goal.position)) != expected:
            got = f"goal {goal.index}, {list(goal.position)}"
            yield Difference(f"/goal[{number}]", got, "goal {}, {}".format(*expected))
            return
        reached += decision.action == "goal"


CHECKS: tuple[Callable[[Subject], Iterator[Difference]], ...] = (
    _goals,
    _outcome,
    _contacts,
    _end_time,
    _figures,
    _period,
    _chain,
    _inputs,
    _hashes,
    _delays,
    _perturbation,
    _cause,
    _geofence,
    _places,
)
"""Independent checks, the most informative first: messages name the first that fails."""


def _recorded_result(subject: Subject) -> Iterator[Difference]:
    """The figures of a recording's result follow from decisions and motion."""
    result, content = subject.log.result, subject.content
    if result["outcome"] not in (RECORDED, "error"):
        yield Difference("result.outcome", result["outcome"], RECORDED)
    for name, value in recorded_figures(content.decisions, content.motions).items():
        same = result.get(name) == value or (
            not isinstance(value, str) and _is_number(result.get(name), value)
        )
        if not same:
            yield Difference(f"result.{name}", result.get(name, "none"), f"{value}")


def _recorded_way(subject: Subject) -> Iterator[Difference]:
    """The recorded way is unbroken; it leads through the poses but for the perturbation's error.

    A pose that an estimator made of the sweeps is an input of its own.
    """
    before = None
    estimated = subject.log.config.estimate.kind != "model"
    shifts = {one.sequence: list(one.pose_shift) for one in subject.content.perturbations}
    for motion, pose in zip(subject.content.motions, subject.content.poses, strict=False):
        way, place = way_of(motion), f"/recorded[{motion.sequence}]"
        ends = way[0, :3].tolist(), way[-1, :3].tolist()
        if ends[1] != list(motion.position) or (before is not None and ends[0] != before):
            yield Difference(f"{place}.way", f"{ends}", f"{[before, list(motion.position)]}")
            return
        before = ends[1]
        shift = shifts.get(motion.sequence, [0.0, 0.0, 0.0])
        off = np.array(pose.position) - np.array(motion.position) - np.array(shift)
        if not estimated and not (np.abs(off) <= SAME).all():
            yield Difference(f"{place}.position", f"{list(motion.position)}", f"{pose.position}")
            return


CHECKS_OF_RECORDING: tuple[Callable[[Subject], Iterator[Difference]], ...] = (
    _recorded_result,
    _recorded_way,
    _chain,
    _inputs,
    _hashes,
    _delays,
    _perturbation,
)
"""Checks of a recording's log: of inputs and decisions; there is no simulation and no truth."""


def _ends_at_decision(subject: Subject) -> bool:
    return subject.log.result["outcome"] not in BETWEEN_DECISIONS


def _limits(subject: Subject, number: int) -> Limits:
    segment = subject.segment_of(number)
    return Limits(segment.config.episode, segment.mission, segment.period_s)


def _is_active(subject: Subject, number: int) -> bool:
    segment = subject.segment_of(number)
    if segment.config.recording is not None:
        now_ns = subject.content.decisions[number].timestamp.ToNanoseconds()
        return (segment.config.perturbation or UNPERTURBED).is_active(now_ns)
    rate = next(iter(segment.beams.values())).rate  # as in `harness.sim.perturb`
    return (segment.config.perturbation or UNPERTURBED).is_active(round(number / rate * 1e9))


def _added_delay(subject: Subject, number: int) -> float:
    """Return the delay that the perturbation adds to that of a decision, s."""
    perturbation = subject.segment_of(number).config.perturbation or UNPERTURBED
    return perturbation.delay if _is_active(subject, number) else 0.0


def _is_number(text: str | None, value: float) -> bool:
    recorded = _number(text)
    return recorded is not None and math.isclose(recorded, value, rel_tol=SAME, abs_tol=SAME)


def _number(text: str | None) -> float | None:
    try:
        return float(text or "")
    except ValueError:
        return None
