"""Causes of failures, and findings."""

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
    "frozen_evidence",
    "stale_evidence",
    "latency",
    "planner",
    "impossible",
    "plugin_failed",
    "stack_held",
    "exploration",
    "unexplained",
)
"""All causes; docs/causes.md defines each."""


@dataclass(frozen=True)
class Finding:
    """A cause with its evidence.

    Attributes:
        cause: One of `CAUSES`.
        evidence: Evidence in words, with cells, distances and times.
        decision: Number of the last decision that could have prevented the failure.
        place: (x, y, z) of the failure, world, m.
    """

    cause: str
    evidence: str
    decision: int
    place: tuple[float, float, float]
