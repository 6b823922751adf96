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


def is_active(subject: Subject, number: int) -> bool:
    """Return whether the perturbation acts on the inputs of a decision."""
    segment = subject.segment_of(number)
    if segment.config.recording is not None:
        now_ns = subject.content.decisions[number].timestamp.ToNanoseconds()
        return (segment.config.perturbation or UNPERTURBED).is_active(now_ns)
    rate = next(iter(segment.beams.values())).rate  # as in `harness.sim.perturb`
    return (segment.config.perturbation or UNPERTURBED).is_active(round(number / rate * 1e9))


def added_delay(subject: Subject, number: int) -> float:
    """Return the delay that the perturbation adds to that of a decision, s."""
    perturbation = subject.segment_of(number).config.perturbation or UNPERTURBED
    return perturbation.delay if is_active(subject, number) else 0.0


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
