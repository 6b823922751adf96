"""What a cause is, and the evidence for it."""

from __future__ import annotations

from dataclasses import dataclass

CAUSES = (
    "localization",
    "perception",
    "disregarded_obstacle",
    "missed_obstacle",
    "unseen_obstacle",
    "margin_too_small",
    "moved_obstacle",
    "ghost_obstacle",
    "tracking",
    "latency",
    "planner",
    "impossible",
    "stack_died",
    "stack_hung",
    "stack_broken",
    "unexplained",
)
"""Every cause; docs/causes.md says what each means."""


@dataclass(frozen=True)
class Finding:
    """A cause with its evidence.

    Attributes:
        cause: One of `CAUSES`.
        evidence: In words, with cells, distances and times.
        decision: Number of the last decision that could have done otherwise.
        place: (x, y, z) where it happened, world, m.
    """

    cause: str
    evidence: str
    decision: int
    place: tuple[float, float, float]
