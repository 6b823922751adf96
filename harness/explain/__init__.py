"""One decision as a card, an episode as a story, and a moment as a picture."""

from wayproof.harness.explain.card import Card, make_card
from wayproof.harness.explain.story import Phase, phases

__all__ = ["Card", "Phase", "make_card", "phases"]
