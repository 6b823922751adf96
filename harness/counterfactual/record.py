"""Verdict of a counterfactual check, written into the log of the failure and read back."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import msgspec

from wayproof.harness.attribution.finding import Finding
from wayproof.harness.counterfactual.verdict import Check, Verdict
from wayproof.harness.errors import InputError
from wayproof.harness.log.codec.container import walk
from wayproof.harness.log.codec.messages import read_messages
from wayproof.harness.log.copy import write_copy
from wayproof.harness.log.head import read_head
from wayproof.harness.log.reader import CHECK, Log, open_log


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
