"""Verdict of a counterfactual check, and its place in the log of the failure."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import msgspec

from wayproof.harness.attribution.finding import Finding
from wayproof.harness.errors import InputError
from wayproof.harness.log.codec.container import walk
from wayproof.harness.log.codec.messages import read_messages
from wayproof.harness.log.copy import write_copy
from wayproof.harness.log.head import read_head
from wayproof.harness.log.reader import CHECK, Log, open_log

CONTROL = "control"
"""Name of the simulation without a change."""

HARM = ("collision", "fall", "out_of_bounds", "error")
"""Outcomes that harm the robot or end the episode by a failure of code."""

TOUCHED = ("collision", "fall", "out_of_bounds")
"""Outcomes at a moment, before which there was a last chance."""

MORE_TIME = 5.0
"""Time that an episode may continue beyond its contact, s."""


@dataclass(frozen=True)
class Check:
    """Outcome of one remedy.

    Attributes:
        remedy: One of `REMEDIES`, or `CONTROL`.
        begin: Number of the first decision with it.
        outcome: Outcome of the episode with it.
        end_s: Simulated time of its end, s.
        saves: Whether the robot reached the goal or, after a contact or a fall, came to no harm.
        again: Whether it was tried with another seed of the noise.
    """

    remedy: str
    begin: int
    outcome: str
    end_s: float
    saves: bool
    again: bool = False


@dataclass(frozen=True)
class Verdict:
    """Cause of a failure after its check.

    Attributes:
        finding: The cause.
        answer: `confirmed`, `changed` or `inconclusive`.
        checks: All remedies that were tried.
        simulated_s: Simulated time of the check, s.
        note: Further remarks, in words; may be empty.
    """

    finding: Finding
    answer: str
    checks: tuple[Check, ...]
    simulated_s: float
    note: str = ""


def record_check(path: Path, verdict: Verdict) -> None:
    """Write a verdict into a finished log in place; everything else stays the same.

    Raises:
        InputError: It is no finished log, or the folder cannot be written to.
    """
    result = open_log(path, allow_plugins=True).result
    head = read_head(walk(path, head_only=True), path, allow_plugins=True)
    x, y, z = verdict.finding.place
    fields = {
        "cause": verdict.finding.cause,
        "evidence": verdict.finding.evidence,
        "decision": str(verdict.finding.decision),
        "place": f"{x!r},{y!r},{z!r}",
        "answer": verdict.answer,
        "simulated_s": repr(verdict.simulated_s),
        "note": verdict.note,
        "checks": msgspec.json.encode(verdict.checks).decode(),
    }
    head = replace(head, metadata={**head.metadata, CHECK: fields})
    write_copy(path, head, read_messages(path), result, record=result.get("record", "full"))


def read_check(log: Log) -> Verdict | None:
    """Return the verdict in a log, or None.

    Raises:
        InputError: It is malformed.
    """
    if not log.check:
        return None
    try:
        x, y, z = (float(value) for value in log.check["place"].split(","))
        return Verdict(
            finding=Finding(
                log.check["cause"], log.check["evidence"], int(log.check["decision"]), (x, y, z)
            ),
            answer=log.check["answer"],
            checks=msgspec.json.decode(log.check["checks"], type=tuple[Check, ...]),
            simulated_s=float(log.check["simulated_s"]),
            note=log.check.get("note", ""),
        )
    except (KeyError, ValueError, msgspec.MsgspecError) as error:
        raise InputError(f"log '{log.path}': damaged (the verdict of its check: {error})") from None
