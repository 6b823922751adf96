"""Counterfactual checks of a study's failures, within a bound of simulated time."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from wayproof.harness.attribution.case import read_case
from wayproof.harness.attribution.procedure import find_cause
from wayproof.harness.counterfactual.check import check, checkable
from wayproof.harness.counterfactual.verdict import record_check
from wayproof.harness.errors import InputError
from wayproof.harness.interface.connect import isolating
from wayproof.harness.log.reader import open_log
from wayproof.harness.study.plan import Planned
from wayproof.harness.study.store import Store


@dataclass
class Tally:
    """Counts of the checked failures of a study.

    Attributes:
        answers: Answer of a check (confirmed, changed, inconclusive) -> number of failures.
        refused: Number of failures that cannot be checked.
        left: Number of failures left unchecked by the bound.
        simulated_s: Simulated time spent, s.
    """

    answers: Counter[str] = field(default_factory=Counter)
    refused: int = 0
    left: int = 0
    simulated_s: float = 0.0

    def __str__(self) -> str:
        """Return the counts in words."""
        parts = [f"{count} {answer}" for answer, count in sorted(self.answers.items())]
        parts += [f"{self.refused} cannot be checked"] if self.refused else []
        parts += [f"{self.left} left unchecked by the bound"] if self.left else []
        return f"{', '.join(parts) or 'no failures'}; {self.simulated_s:.0f} s simulated"


def check_failures(
    planned: Sequence[Planned],
    store: Store,
    max_s: float,
    allow_plugins: bool = False,
    watch: Callable[[str], None] = lambda key: None,
) -> Tally:
    """Check every failure that is not checked yet, and write each verdict into its log.

    Args:
        planned: Episodes of the study.
        store: Folder of their logs.
        max_s: Simulated time after which no further check starts, s.
        allow_plugins: Import code that a log names.
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
        if tally.simulated_s >= max_s:
            tally.left += 1
            continue
        watch(key)
        finding = find_cause(read_case(log)) if checkable(log) else None
        if finding is None:
            tally.refused += 1
            continue
        try:
            with isolating():
                verdict = check(log, finding, thorough=False, most_s=max_s - tally.simulated_s)
        except InputError:
            tally.refused += 1
            continue
        record_check(path, verdict)
        tally.answers[verdict.answer] += 1
        tally.simulated_s += verdict.simulated_s
    return tally
