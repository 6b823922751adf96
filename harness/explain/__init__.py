"""Cards of decisions, stories of episodes, and pictures of moments."""

from wayproof.harness.explain.card import Card, make_card
from wayproof.harness.explain.story import Phase, phases

__all__ = ["Card", "Phase", "make_card", "phases"]
