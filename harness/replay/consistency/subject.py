"""Subject of the checks: a log with its messages, and facts that several checks need."""

from __future__ import annotations

import math
from dataclasses import dataclass

from wayproof.harness.ending import BETWEEN_DECISIONS
from wayproof.harness.log.reader import Log
from wayproof.harness.perturbations import UNPERTURBED
from wayproof.harness.recompute.segments import Segment
from wayproof.harness.replay.content import Content
from wayproof.harness.result import ends_in_error

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


def ends_at_decision(subject: Subject) -> bool:
    """Return whether the outcome is one that a decision brings about, not the simulation."""
    return subject.log.result["outcome"] not in BETWEEN_DECISIONS


def time_of(subject: Subject, number: int) -> int:
    """Return the time of a decision by which perturbations act, ns."""
    segment = subject.segment_of(number)
    if segment.config.recording is not None:
        return subject.content.decisions[number].timestamp.ToNanoseconds()
    rate = next(iter(segment.beams.values())).rate  # as in `harness.sim.injector`
    return round(number / rate * 1e9)


def is_active(subject: Subject, number: int) -> bool:
    """Return whether the perturbation acts on the inputs of a decision."""
    perturbation = subject.segment_of(number).config.perturbation or UNPERTURBED
    return perturbation.is_active(time_of(subject, number))


def added_delay(subject: Subject, number: int) -> float:
    """Return the delay that the perturbation adds to that of a decision, s."""
    config = subject.segment_of(number).config
    perturbation = config.perturbation or UNPERTURBED
    if not is_active(subject, number):
        return 0.0
    return perturbation.delay_at(config.seed, time_of(subject, number))


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
