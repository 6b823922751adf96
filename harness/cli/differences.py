"""Differences between what is recorded and what is recomputed, and what a verdict covers."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from rich.console import Console

if TYPE_CHECKING:
    from wayproof.harness.decision import Difference
    from wayproof.harness.replay.replay import Scope

SHOWN_DIFFERENCES = 8


def print_differences(console: Console, differences: Sequence[Difference]) -> None:
    """Print the first few differences, a line each."""
    for one in differences[:SHOWN_DIFFERENCES]:
        console.print(f"  {one.field}: {one.recorded} -> {one.recomputed}")
    if len(differences) > SHOWN_DIFFERENCES:
        console.print(f"  and {len(differences) - SHOWN_DIFFERENCES} more")


def print_elsewhere(console: Console, elsewhere: Sequence[Difference]) -> None:
    """Print in which respects the machine of the recording differs from this one."""
    names = ", ".join(one.field for one in elsewhere)
    console.print(
        f"  recorded with another {names}: a simulation is repeated to the bit only on like "
        "machines, with the same versions"
    )


def print_scope(console: Console, scope: Scope) -> None:
    """Print what a verdict covers and what it does not, a line each."""
    parts = {
        "recomputed": scope.recomputed,
        "only 'replay simulate' shows": scope.simulation,
        "claims": scope.claims,
    }
    for title, names in parts.items():
        if names:
            console.print(f"  {title}: {', '.join(names)}")
