"""Names of places that a mission may lead to, in place of their coordinates."""

from __future__ import annotations

PLACES = {
    "home": "the start",
    "world": "the world's own goal",
    "aisle": "an end, the middle and the other end of the world's aisle, the nearer end first",
}
"""Meaning of each name; `models.worlds.aisle` and `harness.scenario.places` give the points."""
