"""Answers of a study over recordings: the share admitted, and the action that each arm changed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from wayproof.harness.study.plan import Arm, name_of
from wayproof.harness.study.rows import Row, other_action, prove, share_differing, twins_of

MOST_STREAMS = 3
"""Maximum number of undeclared streams that are named."""


@dataclass(frozen=True)
class Pass:
    """One pass through a recording, beside its reference.

    Attributes:
        arm: Its arm.
        seed: Its seed.
        key: Key of its log.
        error: Reason why there is no log; empty with one.
        verdict: `admitted`, `not admitted` or `nothing shown`; empty without a log.
        admitted_share: Share of the way admitted; None without a way.
        driven_m: Length of the way, m.
        refused_m: Length that was not admitted by reason, m.
        change: Share less that of the reference; None without both.
        first: Number of the first decision with another action; None without one or a reference.
        actions: That action of the reference, and of this pass; None without one.
        share_differing: Share of the decisions with another action; None without a reference.
        changed: Input streams that differ up to then.
        undeclared: Streams among them that no perturbation declares.
    """

    arm: Arm
    seed: int
    key: str
    error: str
    verdict: str = ""
    admitted_share: float | None = None
    driven_m: float = 0.0
    refused_m: dict[str, float] | None = None
    change: float | None = None
    first: int | None = None
    actions: tuple[str, str] | None = None
    share_differing: float | None = None
    changed: tuple[str, ...] = ()
    undeclared: tuple[str, ...] = ()

    @property
    def exit_code(self) -> int:
        """0: its gates alone judge it."""
        return 0

    def in_words(self) -> str:
        """Describe the result in a line."""
        cells = zip(COLUMNS[2:], self.cells()[2:], strict=True)
        return f"seed {self.seed}: " + (
            f"error: {self.error}"
            if self.error
            else "; ".join(f"{head} {text}" for head, text in cells if text)
        )

    def cells(self) -> tuple[str, ...]:
        """Return the texts of its row of the table, under `COLUMNS`."""
        name = name_of(self.arm), str(self.seed)
        if self.error:
            return *name, "error", "", self.error, "", "", ""
        refused = (self.refused_m or {}).items()
        return (
            *name,
            self.verdict if self.admitted_share is None else f"{self.admitted_share:.1%}",
            "" if self.change is None else f"{100.0 * self.change:+.1f}",
            ", ".join(f"{why} {length:.2f} m" for why, length in refused),
            self._first_difference(),
            "" if self.share_differing is None else f"{self.share_differing:.1%}",
            self._inputs(),
        )

    def _first_difference(self) -> str:
        if self.first is not None and self.actions is not None:
            return f"{self.first}: {self.actions[0]} -> {self.actions[1]}"
        return "" if self.share_differing is None else "none"

    def _inputs(self) -> str:
        if self.share_differing is None:
            return ""
        if not self.changed:
            return "unchanged"
        if not self.undeclared:
            return "as declared"
        more = "" if len(self.undeclared) <= MOST_STREAMS else " ..."
        return f"also {', '.join(self.undeclared[:MOST_STREAMS])}{more}"


COLUMNS = (
    *("arm", "seed", "admitted", "change", "not admitted", "first other action", "others"),
    "inputs",
)
"""Heads of the columns of `Pass.cells`."""


def passes_of(rows: Sequence[Row]) -> list[Pass]:
    """Return each pass in the order of the rows, with its reference of the same seed."""
    twins = twins_of(rows)
    return [_pass(row, twins.get(row.key)) for row in rows]


def _pass(row: Row, twin: Row | None) -> Pass:
    if row.way is None:
        return Pass(row.arm, row.seed, row.key, row.reason)
    way, alone = row.way, Pass(row.arm, row.seed, row.key, "")
    alone = replace(
        alone,
        verdict=way.verdict,
        admitted_share=way.admitted_share,
        driven_m=way.driven_m,
        refused_m=way.refused_m,
    )
    if twin is None or twin.way is None:
        return alone
    first, proof = other_action(row, twin), prove(row, twin)
    both = way.admitted_share, twin.way.admitted_share
    return replace(
        alone,
        change=None if both[0] is None or both[1] is None else both[0] - both[1],
        first=first,
        actions=None if first is None else (twin.actions[first], row.actions[first]),
        share_differing=share_differing(row.actions, twin.actions),
        changed=() if proof is None else tuple(sorted(proof.pairing.changed)),
        undeclared=() if proof is None else proof.undeclared,
    )
