"""Attribution of failures: one cause, from the log of an episode and its ground truth."""

from wayproof.harness.attribution.case import Case, Moment, read_case
from wayproof.harness.attribution.finding import CAUSES, Finding
from wayproof.harness.attribution.procedure import find_cause

__all__ = [
    "CAUSES",
    "Case",
    "Finding",
    "Moment",
    "find_cause",
    "read_case",
]
