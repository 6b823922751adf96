"""Counterfactual checks of a study's failures, within a bound of simulated time."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from wayproof.harness.attribution.case import read_case
from wayproof.harness.attribution.procedure import find_cause
from wayproof.harness.counterfactual.check import check, checkable
from wayproof.harness.counterfactual.record import record_check
from wayproof.harness.errors import InputError
from wayproof.harness.log.reader import open_log
from wayproof.harness.study.file import Planned
from wayproof.harness.study.store import Store


@dataclass
class Tally:
    """What became of a study's failures.

    Attributes:
        answers: How often a check confirmed a cause, changed it, or was inconclusive.
        refused: Failures that cannot be checked.
        left: Failures that the bound left unchecked.
        simulated_s: Simulated time that was spent, s.
    """

    answers: Counter[str] = field(default_factory=Counter)
    refused: int = 0
    left: int = 0
    simulated_s: float = 0.0

    def __str__(self) -> str:
        """In words."""
        told = [f"{count} {answer}" for answer, count in sorted(self.answers.items())]
        told += [f"{self.refused} cannot be checked"] if self.refused else []
        told += [f"{self.left} left unchecked by the bound"] if self.left else []
        return f"{', '.join(told) or 'no failures'}; {self.simulated_s:.0f} s simulated"


def check_failures(
    planned: Sequence[Planned],
    store: Store,
    most_s: float,
    allow_plugins: bool = False,
    watch: Callable[[str], None] = lambda key: None,
) -> Tally:
    """Check every failure that is not checked yet, and write each verdict into its log.

    Args:
        planned: Episodes.
        store: Where their logs are.
        most_s: No check is begun after so much simulated time.
        allow_plugins: Whether code that a log names may be imported.
        watch: Called with the key of each failure before it is checked.
    """
    tally = Tally()
    for key in dict.fromkeys(one.key for one in planned):
        path = store.log(key)
        if not path.is_file():
            continue
        log = open_log(path, allow_plugins)
        if log.result["outcome"] == "success" or log.check:
            continue
        if tally.simulated_s >= most_s:
            tally.left += 1
            continue
        watch(key)
        finding = find_cause(read_case(log)) if checkable(log) else None
        if finding is None:
            tally.refused += 1
            continue
        try:
            verdict = check(log, finding, thorough=False, most_s=most_s - tally.simulated_s)
        except InputError:
            tally.refused += 1
            continue
        record_check(path, verdict)
        tally.answers[verdict.answer] += 1
        tally.simulated_s += verdict.simulated_s
    return tally
