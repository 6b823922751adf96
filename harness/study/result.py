"""Result of a study: arms, gates, lost episodes, changes and answers, and the verdict on them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, Protocol

from wayproof.harness.study.analysis import ArmSummary
from wayproof.harness.study.changes import Change
from wayproof.harness.study.gates import GateResult
from wayproof.harness.study.lost import Lost
from wayproof.harness.study.plan import Arm

StudyVerdict = Literal["complete", "held", "failed", "inconclusive", "incomplete"]

EXIT_CODES: dict[StudyVerdict, int] = {
    "complete": 0,
    "held": 0,
    "failed": 1,
    "inconclusive": 3,
    "incomplete": 3,
}


class Answer(Protocol):
    """Answer for one arm or episode of a study that has more to tell than outcomes."""

    @property
    def arm(self) -> Arm:
        """The arm."""
        ...

    @property
    def exit_code(self) -> int:
        """Exit code that it asks for: 0, 1 or 3."""
        ...

    def in_words(self) -> str:
        """Return the answer in a line or more."""
        ...


@dataclass(frozen=True)
class Paired:
    """Pairs of episodes of two studies.

    Attributes:
        count: Number of pairs.
        reached: Number of the second study's that reached the goal.
        reached_before: Number of the first study's that did.
    """

    count: int
    reached: int
    reached_before: int


@dataclass(frozen=True)
class StudyResult:
    """Result of a study.

    Attributes:
        name: Name of the study.
        episodes: Number of episodes.
        missing: Number of episodes that have not run yet.
        errors: Number of episodes that failed to run, without a log.
        first_error: Error of the first of these; empty without any.
        arms: Summary of each arm; none of a study over recordings, which has no outcomes.
        gates: Result of each gate on each arm.
        foreign: Lines about logs of other episodes, which count as missing.
        of_recordings: Whether it is a study over recordings.
        gates_set: Number of gates that the study sets, each for one arm or more.
        pairs: Paired results of a comparison; None of a single study.
        differences: What else than the episodes differs between the studies of a comparison.
        lost: Episodes that failed, in a comparison those of its second study.
        changes: Paired differences of the figures, of arms that are compared.
        answers: Answers of a threshold, a calibration, a falsification or of recordings; none of
            another grid.
    """

    name: str
    episodes: int
    missing: int
    errors: int
    first_error: str
    arms: list[ArmSummary]
    gates: list[GateResult]
    foreign: tuple[str, ...] = ()
    of_recordings: bool = False
    gates_set: int = 0
    pairs: Paired | None = None
    answers: Sequence[Answer] = ()
    differences: tuple[str, ...] = ()
    lost: tuple[Lost, ...] = ()
    changes: Sequence[Change] = ()

    @property
    def verdict(self) -> StudyVerdict:
        """Return the verdict: `incomplete` with missing episodes, `complete` without gates."""
        if self.missing or self.errors:
            return "incomplete"
        verdicts = {gate.verdict for gate in self.gates}
        if "failed" in verdicts:
            return "failed"
        if "inconclusive" in verdicts:
            return "inconclusive"
        return "held" if verdicts else "complete"

    def exit_code(self, allow_inconclusive: bool = False) -> int:
        """Return 0 if all ran and every gate is held, 1 if a gate or an answer failed, else 3.

        Args:
            allow_inconclusive: Let inconclusive gates pass, except those that must be `proven`.
        """
        if self.verdict == "inconclusive" and allow_inconclusive:
            undecided = [gate for gate in self.gates if gate.verdict == "inconclusive"]
            return 3 if any(gate.required for gate in undecided) else 0
        asked = {EXIT_CODES[self.verdict], *(one.exit_code for one in self.answers)}
        return next((code for code in (1, 3) if code in asked), 0)
