"""Checks of the messages of a log: numbers, times, hashes, the chain, and what settings make."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from wayproof.harness.decision import Difference, chain_hash
from wayproof.harness.ending import BETWEEN_DECISIONS
from wayproof.harness.input_messages import unit_quaternion
from wayproof.harness.log.digest import CONTENT
from wayproof.harness.log.reader import Log
from wayproof.harness.log.streams import own_streams
from wayproof.harness.perturbations import UNPERTURBED
from wayproof.harness.recompute.moments import Segment
from wayproof.harness.replay.content import Content
from wayproof.harness.result import RECORDED_FIELDS, RESULT_FIELDS, ends_in_error, is_recovered
from wayproof.harness.schema import wayproof_pb2 as pb

INPUTS = ("poses", "goals", "latencies")
"""Kinds of messages that are inputs, which are not read for a row of a study."""


def check_digest(log: Log, content: Content) -> Iterator[Difference]:
    """Check that the file's digest is that in the result."""
    if content.digest:
        yield from differs("content digest", log.result.get(CONTENT) or "none", content.digest)


def check_fields(log: Log) -> Iterator[Difference]:
    """Check that the result has the fields that the log of its kind has, and no other."""
    if is_recovered(log.result):
        return
    fields = RECORDED_FIELDS if log.config.recording is not None else RESULT_FIELDS
    expected = {*fields, "record", CONTENT}
    for name in sorted(expected ^ log.result.keys()):
        pair = (log.result[name][:80], "no such field") if name in log.result else ("none", "one")
        yield Difference(f"result.{name[:80]}", *pair)


def check_numbering(subject: Subject) -> Iterator[Difference]:
    """Check that decisions count from 0, and have all messages of their number and time."""
    content, last_ns = subject.content, -1
    for number, decision in enumerate(content.decisions):
        name, now_ns = f"/decision[{number}]", decision.timestamp.ToNanoseconds()
        yield from differs(f"{name}.sequence", decision.sequence, number)
        if now_ns <= last_ns:
            yield Difference(f"{name}.timestamp", f"{now_ns} ns", f"more than {last_ns} ns")
        last_ns = now_ns
    stamps = [_stamp(one) for one in content.decisions]
    recorded = subject.log.config.recording is not None
    goals = ["goals"] if subject.log.has_goals else []
    own = "motions" if recorded else "truths"  # of a recording there is no truth
    for kind in ("poses", *goals, "latencies", own, "streams"):
        messages: Sequence[pb.Truth] = getattr(content, kind)
        if kind in INPUTS and not messages and not content.inputs:
            continue  # not read for a row of a study
        found = [_stamp(one) for one in messages]
        may_lead = subject.incomplete and kind in (*INPUTS, "motions")  # at an error, by one
        if not may_lead or len(found) != len(stamps) + 1:
            yield from differs(f"number of {kind}", len(found), len(stamps))
        for number, pair in enumerate(zip(found, stamps, strict=False)):
            yield from differs(f"{kind}[{number}]", *pair)


def _stamp(message: pb.Truth | pb.Decision) -> str:
    return f"{message.sequence} at {message.timestamp.ToNanoseconds()} ns"


def check_period(subject: Subject) -> Iterator[Difference]:
    """Check that decisions follow each other at the rate of the first sensor."""
    times = [one.timestamp.ToNanoseconds() * 1e-9 for one in subject.content.decisions]
    for number, (before, now) in enumerate(itertools.pairwise(times), 1):
        period = subject.segment_of(number - 1).period_s
        if abs(now - before - period) > HALF_STEP_S:
            name = f"time between decisions {number - 1} and {number}"
            yield Difference(name, f"{now - before:.3f} s", f"{period:.3f} s")


def check_chain(subject: Subject) -> Iterator[Difference]:
    """Check that each link hashes its record and the link before; the last is the result's.

    A log of decisions keeps few global paths; the links of the others cannot be computed.
    """
    thinned, before = subject.log.record == "decisions", ""
    for decision in subject.content.decisions:
        again = chain_hash(decision, before)
        before = decision.chain
        if not thinned or decision.global_path:
            yield from differs(f"/decision[{decision.sequence}].chain", before, again)
    yield from differs("result.chain", subject.log.result["chain"], before)


def check_inputs(subject: Subject) -> Iterator[Difference]:
    """Check that each decision repeats its pose and the digest of its inputs."""
    content = subject.content
    for decision, had in zip(content.decisions, content.inputs, strict=False):
        name = f"/decision[{decision.sequence}].input_digest"
        yield from differs(name, decision.input_digest, had.digest)
    for decision, pose in zip(content.decisions, content.poses, strict=False):
        name, turn = f"/decision[{decision.sequence}]", unit_quaternion(np.array(pose.quaternion))
        yield from differs(f"{name}.position", list(decision.position), list(pose.position))
        yield from differs(f"{name}.quaternion", list(decision.quaternion), turn.tolist())
        yield from differs(f"{name}.position_sigma", decision.position_sigma, pose.position_sigma)


def check_hashes(subject: Subject) -> Iterator[Difference]:
    """Check that the running hashes follow from the logged inputs."""
    content = subject.content
    for streams, had in zip(content.streams, content.inputs, strict=False):
        recorded = {one.name: one.hash for one in streams.streams}
        expected_names = {f"sensor/{name}" for name in subject.segment_of(streams.sequence).beams}
        for name in sorted({*expected_names, *own_streams(subject.log.config)}):
            place = f"/streams[{streams.sequence}].{name}"
            yield from differs(place, recorded.get(name, "none"), had.hashes[name])


def check_delays(subject: Subject) -> Iterator[Difference]:
    """Check that a modelled delay follows from the config, and each decision repeats it."""
    content = subject.content
    for decision, latency in zip(content.decisions, content.latencies, strict=False):
        number = decision.sequence
        config = subject.segment_of(number).config.latency
        yield from differs(f"/latency[{number}].mode", latency.mode, config.mode)
        expected = latency.delay_s
        if config.mode == "modelled":
            expected = config.expected + subject.perturbed(number)[1]
        yield from differs(f"/latency[{number}].delay_s", latency.delay_s, expected)
        yield from differs(f"/decision[{number}].delay_s", decision.delay_s, expected)


def check_perturbation(subject: Subject) -> Iterator[Difference]:
    """Check perturbation records by the config; without a perturbation there is none."""
    records = {one.sequence: one for one in subject.content.perturbations}
    for decision in subject.content.decisions:
        number = decision.sequence
        place, record = f"/perturbation[{number}]", records.get(number)
        perturbation = subject.segment_of(number).config.perturbation
        kinds = [one.kind if one else "none" for one in (record, perturbation)]
        yield from differs(place, *kinds)
        if record is None or perturbation is None:
            continue
        active, delay_s = subject.perturbed(number)
        amount = perturbation.amount if active else perturbation.nothing
        yield from differs(f"{place}.severity", record.severity, math.ceil(perturbation.severity))
        yield from differs(f"{place}.amount", record.amount, amount)
        yield from differs(f"{place}.added_delay_s", record.added_delay_s, delay_s)


def check_places(subject: Subject) -> Iterator[Difference]:
    """Check that start and goals of the mission are those of the resolved config."""
    for segment in subject.segments:
        config, mission = segment.config, segment.mission
        yield from differs("config.waypoints", len(config.waypoints), len(mission.waypoints))
        pairs = [("start", config.start, mission.start), ("goal", config.goal, mission.goal)]
        both = zip(config.waypoints, mission.waypoints, strict=False)
        pairs += [("waypoints", *points) for points in both]
        for name, placed, point in pairs:
            if placed is not None:
                yield from differs(f"config.{name}", tuple(placed), point[: len(placed)])


def check_goals(subject: Subject) -> Iterator[Difference]:
    """Check that the goal of each decision is the next one, by the goals reached before."""
    content, reached = subject.content, 0
    for decision, goal in zip(content.decisions, content.goals, strict=False):
        number = decision.sequence
        goals = subject.segment_of(number).mission.goals
        index = min(reached, len(goals) - 1)
        got, expected = (
            f"goal {k}, {list(at)}"
            for k, at in ((goal.index, goal.position), (index, goals[index]))
        )
        yield from differs(f"/goal[{number}]", got, expected)
        reached += decision.action == "goal"


SAME = 1e-9
"""Relative difference up to which two figures, summed in different orders, are equal."""

HALF_STEP_S = 0.005
"""Tolerance of the period of decisions, s: half of the longest physics step."""


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

    @property
    def ends_at_decision(self) -> bool:
        """Whether the outcome is one that a decision brings about, not the simulation."""
        return self.log.result["outcome"] not in BETWEEN_DECISIONS

    def perturbed(self, number: int) -> tuple[bool, float]:
        """Return whether the perturbation acts on a decision, and the delay that it adds, s."""
        segment = self.segment_of(number)
        config, perturbation = segment.config, segment.config.perturbation or UNPERTURBED
        if config.recording is not None:
            time_ns = self.content.decisions[number].timestamp.ToNanoseconds()
        else:
            rate = next(iter(segment.beams.values())).rate  # as in `harness.sim.injector`
            time_ns = round(number / rate * 1e9)
        if not perturbation.is_active(time_ns):
            return False, 0.0
        return True, perturbation.delay_at(config.seed, time_ns)


def differs(place: str, recorded: object, expected: object) -> Iterator[Difference]:
    """Yield a difference unless two values are equal."""
    if recorded != expected:
        yield Difference(place, str(recorded), str(expected))


def is_number(text: str | None, value: float) -> bool:
    """Return whether a text is a number, but for the order in which it was summed."""
    recorded = number_of(text)
    return recorded is not None and math.isclose(recorded, value, rel_tol=SAME, abs_tol=SAME)


def number_of(text: str | None) -> float | None:
    """Return the number that a text holds; None if it holds none."""
    try:
        return float(text or "")
    except ValueError:
        return None
