"""Why an episode failed: one cause, worked out from its log and the simulator's truth."""

from wayproof.harness.attribution.case import Case, Moment, read_case
from wayproof.harness.attribution.finding import CAUSES, Finding
from wayproof.harness.attribution.procedure import NearMiss, find_cause, near_misses

__all__ = [
    "CAUSES",
    "Case",
    "Finding",
    "Moment",
    "NearMiss",
    "find_cause",
    "near_misses",
    "read_case",
]
