"""Table of a study over recordings: the share admitted, and the action that each arm changed."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import PurePath

from wayproof.harness.study.plan import CLEAN
from wayproof.harness.study.recorded import short_name
from wayproof.harness.study.rows import Row, other_action, prove, share_differing, twins_of

MOST_STREAMS = 3
"""Maximum number of undeclared streams that are named."""


@dataclass(frozen=True)
class Pass:
    """One pass through a recording, beside its reference.

    Attributes:
        recording: Name of the recording.
        robot: Name of the robot.
        variant: Settings and stack that differ from the reference; empty of it.
        perturbation: `KIND[:MODE]:SEVERITY`, or `none`.
        seed: Seed.
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
        key: Key of its log.
    """

    recording: str
    robot: str
    variant: str
    perturbation: str
    seed: int
    error: str
    verdict: str
    admitted_share: float | None
    driven_m: float
    refused_m: dict[str, float]
    change: float | None
    first: int | None
    actions: tuple[str, str] | None
    share_differing: float | None
    changed: tuple[str, ...]
    undeclared: tuple[str, ...]
    key: str


def passes_of(rows: Sequence[Row], first_variant: str, first_stack: str = "") -> Iterator[Pass]:
    """Yield each pass in the order of the rows, with its reference of the same seed."""
    twins = twins_of(rows, first_variant, first_stack)
    for row in rows:
        twin = twins.get(row.key)
        yield _pass(row, twin if twin is not None and twin.ran else None)


def _pass(row: Row, twin: Row | None) -> Pass:
    arm, way = row.arm, row.way
    first = None if twin is None or not row.ran else other_action(row, twin)
    proof = None if twin is None else prove(row, twin)
    perturbed = arm.perturbation != CLEAN
    return Pass(
        recording=short_name(arm.world),
        robot=PurePath(arm.robot).stem,
        variant=" ".join(part for part in (arm.stack, arm.variant) if part),
        perturbation=f"{arm.perturbation}:{arm.severity:g}" if perturbed else CLEAN,
        seed=row.seed,
        error="" if row.ran else row.reason,
        verdict="" if way is None else way.verdict,
        admitted_share=None if way is None else way.admitted_share,
        driven_m=0.0 if way is None else way.driven_m,
        refused_m={} if way is None else way.refused_m,
        change=_change(row, twin),
        first=first,
        actions=_actions(row, twin, first),
        share_differing=None
        if twin is None or not row.ran
        else share_differing(row.actions, twin.actions),
        changed=() if proof is None else tuple(sorted(proof.pairing.changed)),
        undeclared=() if proof is None else proof.undeclared,
        key=row.key,
    )


def _actions(row: Row, twin: Row | None, first: int | None) -> tuple[str, str] | None:
    return None if twin is None or first is None else (twin.actions[first], row.actions[first])


def _change(row: Row, twin: Row | None) -> float | None:
    own = row.metrics["admitted_share"]
    other = None if twin is None else twin.metrics["admitted_share"]
    return None if own is None or other is None else own - other


COLUMNS = ("arm", "admitted", "change", "not admitted", "first other action", "others", "inputs")
"""Heads of the columns of `cells`."""


def name_of(one: Pass) -> str:
    """Return a pass in words."""
    seed = f"seed {one.seed}" if one.seed else ""
    parts = (one.recording, one.robot, one.variant, one.perturbation, seed)
    return " ".join(part for part in parts if part)


def in_words(one: Pass) -> str:
    """Describe the result of a pass in a line."""
    if one.error:
        return f"error: {one.error}"
    told = zip(COLUMNS[1:], cells(one)[1:], strict=True)
    return "; ".join(f"{head} {text}" for head, text in told if text)


def cells(one: Pass) -> tuple[str, ...]:
    """Return a pass as the texts of a row of the table."""
    if one.error:
        return name_of(one), "error", "", one.error, "", "", ""
    refused = ", ".join(f"{why} {length:.2f} m" for why, length in one.refused_m.items())
    return (
        name_of(one),
        one.verdict if one.admitted_share is None else f"{one.admitted_share:.1%}",
        "" if one.change is None else f"{100.0 * one.change:+.1f}",
        refused,
        _first_difference(one),
        "" if one.share_differing is None else f"{one.share_differing:.1%}",
        _inputs(one),
    )


def _first_difference(one: Pass) -> str:
    if one.first is not None and one.actions is not None:
        return f"{one.first}: {one.actions[0]} -> {one.actions[1]}"
    return "" if one.share_differing is None else "none"


def _inputs(one: Pass) -> str:
    if one.share_differing is None:
        return ""
    if not one.changed:
        return "unchanged"
    if not one.undeclared:
        return "as declared"
    more = "" if len(one.undeclared) <= MOST_STREAMS else " ..."
    return f"also {', '.join(one.undeclared[:MOST_STREAMS])}{more}"
