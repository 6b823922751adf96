"""Checks of a log for internal consistency, without deciding or simulating again.

Redundant content must agree: the result follows from decisions and truth, each link of the chain
from its record, hashes from their inputs, delays and perturbation records from the config. The
checks only read the file, so verbs that read a log run them first.
"""

from wayproof.harness.replay.consistency.checks import contradictions, refuse_contradictions

__all__ = ["contradictions", "refuse_contradictions"]
