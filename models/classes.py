"""What things are: the classes that a geom may carry in its user data, as an index."""

from __future__ import annotations

CLASSES = (
    "unknown",
    "floor",
    "wall",
    "shelf",
    "crate",
    "furniture",
    "person",
    "vehicle",
    "vegetation",
    "structure",
    "door",
)
"""The index of a name is what geom user data hold, and what a label in a map means."""
