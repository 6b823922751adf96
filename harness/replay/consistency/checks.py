"""All checks of a log for internal consistency, in turn."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from wayproof.harness.decision import Difference
from wayproof.harness.errors import InputError
from wayproof.harness.log.reader import Log
from wayproof.harness.recompute.segments import segments_of
from wayproof.harness.replay.consistency.messages import (
    check_chain,
    check_digest,
    check_fields,
    check_hashes,
    check_inputs,
    check_numbering,
    check_period,
)
from wayproof.harness.replay.consistency.outcome import (
    check_cause,
    check_contacts,
    check_end_time,
    check_figures,
    check_geofence,
    check_outcome,
)
from wayproof.harness.replay.consistency.recording import check_recorded_result, check_recorded_way
from wayproof.harness.replay.consistency.settings import (
    check_delays,
    check_goals,
    check_perturbation,
    check_places,
)
from wayproof.harness.replay.consistency.subject import Subject
from wayproof.harness.replay.content import Content, read_content
from wayproof.harness.result import ends_in_error

CHECKS: tuple[Callable[[Subject], Iterator[Difference]], ...] = (
    check_goals,
    check_outcome,
    check_contacts,
    check_end_time,
    check_figures,
    check_period,
    check_chain,
    check_inputs,
    check_hashes,
    check_delays,
    check_perturbation,
    check_cause,
    check_geofence,
    check_places,
)
"""Independent checks, the most informative first: messages name the first that fails."""

CHECKS_OF_RECORDING: tuple[Callable[[Subject], Iterator[Difference]], ...] = (
    check_recorded_result,
    check_recorded_way,
    check_chain,
    check_inputs,
    check_hashes,
    check_delays,
    check_perturbation,
)
"""Checks of a recording's log: of inputs and decisions; there is no simulation and no truth."""


def contradictions(log: Log, content: Content | None = None) -> list[Difference]:
    """Return all contradictions in a log, each as the recorded value and the one that follows.

    Args:
        log: Head of the log.
        content: Its messages, if they were read already.

    Raises:
        InputError: The file breaks off or is damaged, or holds no decision.
    """
    content = content or read_content(log)
    altered = [*check_fields(log), *content.strange, *check_digest(log, content)]
    if not content.decisions:
        if ends_in_error(log.result):
            return altered  # a stack may fail before its first decision
        raise InputError(f"log '{log.path}': no decisions in it")
    subject = Subject(log, content, tuple(segments_of(log)))
    found = list(check_numbering(subject))
    if not found:  # the checks index the messages by number
        checks = CHECKS if log.config.recording is None else CHECKS_OF_RECORDING
        found = [one for check in checks for one in check(subject)]
    return found + altered  # least of all it says where, so the digest comes last


def refuse_contradictions(log: Log, content: Content | None = None, hint: str = "") -> None:
    """Raise an InputError with the first contradiction in a log, if any, and a hint."""
    found = contradictions(log, content)
    if found:
        one, more = found[0], f", and {len(found) - 1} more" if len(found) > 1 else ""
        raise InputError(
            f"log '{log.path}': {one.field} is {one.recorded}, but {one.recomputed} follows from "
            f"the rest of the log{more}{hint}"
        )
