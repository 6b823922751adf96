"""Episodes that failed: each with its cause and the command that explains it."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from wayproof.harness.study.plan import Arm, name_of
from wayproof.harness.study.rows import Row

MOST_SHOWN = 10
"""Number of lost episodes that a console, a pull request or a page lists."""


@dataclass(frozen=True)
class Lost:
    """An episode that did not reach the goal.

    Attributes:
        arm: Arm of the episode.
        seed: Seed of the episode.
        outcome: Outcome.
        cause: Cause with its evidence, or why it did not run.
        log: Path of its log; empty without one.
        won_before: Whether its pair of the first folder of a comparison reached the goal.
    """

    arm: Arm
    seed: int
    outcome: str
    cause: str
    log: str
    won_before: bool = False

    @property
    def command(self) -> str:
        """Command that explains it; empty without a log."""
        return f"wayproof explain {shlex.quote(self.log)}" if self.log else ""

    @property
    def page(self) -> str:
        """Path of its page, with the picture of its last chance, if its report is written."""
        if not self.log:
            return ""
        log = Path(self.log)
        page = log.parent.parent / "report" / "episodes" / f"{log.stem}.html"
        return str(page) if page.is_file() else ""

    def in_words(self) -> str:
        """Return the episode in a line."""
        text = f"{name_of(self.arm)}, seed {self.seed}: {self.outcome}, {self.cause}"
        return f"{text}; {self.command}" if self.command else text


def lost_of(rows: Sequence[Row], pairs: Sequence[tuple[Row, Row]] = ()) -> tuple[Lost, ...]:
    """Return the simulated episodes that failed, those first that were won before.

    Args:
        rows: Rows of the episodes.
        pairs: (first, second) of a comparison; `rows` are the second ones.
    """
    won = {(second.arm, second.seed) for first, second in pairs if first.success}
    failed = [
        Lost(
            arm=row.arm,
            seed=row.seed,
            outcome=row.outcome,
            cause=f"{row.cause}: {row.evidence}" if row.cause else row.reason,
            log=row.log,
            won_before=(row.arm, row.seed) in won,
        )
        for row in rows
        if not row.success and row.way is None
    ]
    return tuple(sorted(failed, key=lambda one: not one.won_before))


def lost_in_words(lost: Sequence[Lost]) -> list[str]:
    """Return the lines of the lost episodes, a bounded number of them."""
    lines = [
        f"lost{' (won before)' if one.won_before else ''}: {one.in_words()}"
        for one in lost[:MOST_SHOWN]
    ]
    if len(lost) > MOST_SHOWN:
        lines.append(f"and {len(lost) - MOST_SHOWN} more")
    return lines
