"""Verdict of a counterfactual check: results of the simulations, and the remaining cause."""

from __future__ import annotations

from dataclasses import dataclass

from wayproof.harness.attribution.finding import Finding

CONTROL = "control"
"""Name of the simulation without a change."""

HARM = ("collision", "fall", "out_of_bounds", "error")
"""Outcomes that harm the robot or end the episode by a failure of code."""

TOUCHED = ("collision", "fall", "out_of_bounds")
"""Outcomes at a moment, before which there was a last chance."""

MORE_TIME = 5.0
"""Time that an episode may continue beyond its contact, s."""


@dataclass(frozen=True)
class Check:
    """Outcome of one remedy.

    Attributes:
        remedy: One of `REMEDIES`, or `CONTROL`.
        begin: Number of the first decision with it.
        outcome: Outcome of the episode with it.
        end_s: Simulated time of its end, s.
        saves: Whether the robot reached the goal or, after a contact or a fall, came to no harm.
        again: Whether it was tried with another seed of the noise.
    """

    remedy: str
    begin: int
    outcome: str
    end_s: float
    saves: bool
    again: bool = False


@dataclass(frozen=True)
class Verdict:
    """Cause of a failure after its check.

    Attributes:
        finding: The cause.
        answer: `confirmed`, `changed` or `inconclusive`.
        checks: All remedies that were tried.
        simulated_s: Simulated time of the check, s.
        note: Further remarks, in words; may be empty.
    """

    finding: Finding
    answer: str
    checks: tuple[Check, ...]
    simulated_s: float
    note: str = ""
