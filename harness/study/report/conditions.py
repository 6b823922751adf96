"""Success by world and robot against stack or variant, as a table of coloured cells."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from wayproof.harness.study.analysis import Sample
from wayproof.harness.study.plan import CLEAN, Arm


@dataclass(frozen=True)
class Cell:
    """Share of successes in words, and the colour of the cell."""

    text: str
    colour: str


@dataclass(frozen=True)
class Conditions:
    """Table of the unperturbed arms.

    Attributes:
        what: Meaning of the columns: stack, variant or both.
        columns: Headings.
        rows: World and robot, and a cell for each column.
    """

    what: str
    columns: list[str]
    rows: list[tuple[str, list[Cell]]]


def conditions_of(samples: Sequence[Sample]) -> Conditions | None:
    """Return the table; None without an unperturbed arm."""
    clean = [one for one in samples if one.arm.perturbation == CLEAN]
    if not clean:
        return None
    columns = list(dict.fromkeys(_column(one.arm) for one in clean))
    lines = list(dict.fromkeys(_line(one.arm) for one in clean))
    cells = {(_line(one.arm), _column(one.arm)): _cell(one) for one in clean}
    nothing = Cell("", "transparent")
    rows = [(line, [cells.get((line, column), nothing) for column in columns]) for line in lines]
    kinds = [name for name in ("stack", "variant") if any(getattr(one.arm, name) for one in clean)]
    return Conditions(" and ".join(kinds), columns, rows)


def _line(arm: Arm) -> str:
    return f"{arm.world}, {arm.robot}"


def _column(arm: Arm) -> str:
    return " ".join(part for part in (arm.stack, arm.variant) if part) or "reached the goal"


def _cell(sample: Sample) -> Cell:
    ran = [row for row in sample.rows if row.ran]
    if not ran:
        return Cell("none ran", "transparent")
    reached = sum(row.success for row in ran)
    share = reached / len(ran)
    return Cell(f"{reached} of {len(ran)}", f"hsl({120.0 * share:.0f} 55% 85%)")
