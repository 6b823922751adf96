"""Checks of the messages of a log: numbers, times, digests, hashes and the chain."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence

import numpy as np

from wayproof.harness.decision import Difference, chain_hash
from wayproof.harness.input_messages import unit_quaternion
from wayproof.harness.log.digest import CONTENT
from wayproof.harness.log.reader import Log
from wayproof.harness.log.streams import own_streams
from wayproof.harness.replay.consistency.subject import HALF_STEP_S, Subject
from wayproof.harness.replay.content import Content
from wayproof.harness.result import RECORDED_FIELDS, RESULT_FIELDS, is_recovered
from wayproof.harness.schema import wayproof_pb2 as pb

NUMBERED = ("poses", "latencies", "truths", "streams")
"""Kinds of messages with one message per decision."""

NUMBERED_OF_GOALS = ("poses", "goals", "latencies", "truths", "streams")
"""Kinds of messages with one message per decision in a mission with several goals."""

NUMBERED_OF_RECORDING = ("poses", "goals", "latencies", "motions", "streams")
"""Kinds of messages with one message per decision of a recording, which has no truth."""

INPUTS = ("poses", "goals", "latencies")
"""Kinds of them that are inputs, which are not read for a row of a study."""


def check_digest(log: Log, content: Content) -> Iterator[Difference]:
    """Check that the file's digest is that in the result."""
    recorded = log.result.get(CONTENT)
    if content.digest and recorded != content.digest:
        yield Difference("content digest", recorded or "none", content.digest)


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
    """Check numbers and times of one kind of messages; at an error inputs may lead by one."""
    found = [(one.sequence, one.timestamp.ToNanoseconds()) for one in messages]
    leads = may_lead and kind in (*INPUTS, "motions") and len(found) == len(stamps) + 1
    if len(found) != len(stamps) and not leads:
        yield Difference(f"number of {kind}", str(len(found)), str(len(stamps)))
    for number, (one, expected) in enumerate(zip(found, stamps, strict=False)):
        if one != expected:
            place = f"{kind}[{number}]"
            yield Difference(place, "{} at {} ns".format(*one), "{} at {} ns".format(*expected))
            return


def check_period(subject: Subject) -> Iterator[Difference]:
    """Check that decisions follow each other at the rate of the first sensor."""
    times = [one.timestamp.ToNanoseconds() * 1e-9 for one in subject.content.decisions]
    for number, (before, now) in enumerate(itertools.pairwise(times), 1):
        period = subject.segment_of(number - 1).period_s
        if abs(now - before - period) > HALF_STEP_S:
            name = f"time between decisions {number - 1} and {number}"
            yield Difference(name, f"{now - before:.3f} s", f"{period:.3f} s")
            return


def check_chain(subject: Subject) -> Iterator[Difference]:
    """Check that each link hashes its record and the link before; the last is the result's.

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


def check_inputs(subject: Subject) -> Iterator[Difference]:
    """Check that each decision repeats its pose and the digest of its inputs."""
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


def check_hashes(subject: Subject) -> Iterator[Difference]:
    """Check that the running hashes follow from the logged inputs."""
    content = subject.content
    for streams, had in zip(content.streams, content.inputs, strict=False):
        recorded = {one.name: one.hash for one in streams.streams}
        expected_names = {f"sensor/{name}" for name in subject.segment_of(streams.sequence).beams}
        for name in sorted({*expected_names, *own_streams(subject.log.config)}):
            one, other = recorded.get(name, "none"), had.hashes[name]
            if one != other:
                yield Difference(f"/streams[{streams.sequence}].{name}", one, other)
                return
