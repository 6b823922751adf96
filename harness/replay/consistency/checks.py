"""All checks of a log for internal consistency, in turn."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from wayproof.harness.decision import Difference
from wayproof.harness.errors import InputError
from wayproof.harness.log.reader import Log
from wayproof.harness.recompute.moments import segments_of
from wayproof.harness.replay.consistency import messages, outcome
from wayproof.harness.replay.consistency.messages import Subject
from wayproof.harness.replay.content import Content, read_content
from wayproof.harness.result import ends_in_error

Check = Callable[[Subject], Iterator[Difference]]
"""A check whose first difference counts: what follows may be its echo."""

OF_INPUTS: tuple[Check, ...] = (
    messages.check_chain,
    messages.check_inputs,
    messages.check_hashes,
    messages.check_delays,
    messages.check_perturbation,
)

CHECKS: tuple[Check, ...] = (
    messages.check_goals,
    outcome.check_outcome,
    outcome.check_contacts,
    outcome.check_end_time,
    outcome.check_figures,
    messages.check_period,
    *OF_INPUTS,
    outcome.check_cause,
    outcome.check_geofence,
    messages.check_places,
)
"""Independent checks, the most informative first: messages name the first that fails."""

CHECKS_OF_RECORDING: tuple[Check, ...] = (
    outcome.check_recorded_result,
    outcome.check_recorded_way,
    *OF_INPUTS,
)
"""Checks of a recording's log: of inputs and decisions; there is no simulation and no truth."""


def contradictions(log: Log, content: Content | None = None) -> list[Difference]:
    """Return the contradictions in a log, each as the recorded value and the one that follows.

    Args:
        log: Head of the log.
        content: Its messages, if they were read already.

    Raises:
        InputError: The file breaks off or is damaged, or holds no decision.
    """
    content = content or read_content(log)
    altered = [
        *messages.check_fields(log),
        *content.strange,
        *messages.check_digest(log, content),
    ]
    if not content.decisions:
        if ends_in_error(log.result):
            return altered  # a stack may fail before its first decision
        raise InputError(f"log '{log.path}': no decisions in it")
    subject = Subject(log, content, tuple(segments_of(log)))
    first = next(messages.check_numbering(subject), None)
    if first is not None:  # the checks index the messages by number
        return [first, *altered]
    checks = CHECKS if log.config.recording is None else CHECKS_OF_RECORDING
    found = [next(check(subject), None) for check in checks]
    return [*(one for one in found if one is not None), *altered]  # the digest says least where


def refuse_contradictions(log: Log, content: Content | None = None, hint: str = "") -> None:
    """Raise an InputError with the first contradiction in a log, if any, and a hint."""
    found = contradictions(log, content)
    if found:
        one, more = found[0], f", and {len(found) - 1} more" if len(found) > 1 else ""
        raise InputError(
            f"log '{log.path}': {one.field} is {one.recorded}, but {one.recomputed} follows from "
            f"the rest of the log{more}{hint}"
        )
