"""Materials of solids: semantic class and colour."""

from __future__ import annotations

from typing import NamedTuple

from wayproof.models.classes import CLASSES


class Kind(NamedTuple):
    """One kind of solid.

    Attributes:
        class_name: Name in `CLASSES`; a geom of class `floor` may be stepped on.
        colour: Red, green, blue, opacity; for pictures only.
    """

    class_name: str
    colour: str


KINDS = {
    "floor": Kind("floor", "0.9 0.9 0.9 1"),
    "plank": Kind("floor", "0.80 0.68 0.45 1"),
    "ramp": Kind("floor", "0.72 0.72 0.70 1"),
    "step": Kind("floor", "0.72 0.72 0.70 1"),
    "wall": Kind("wall", "0.75 0.75 0.72 1"),
    "partition": Kind("wall", "0.70 0.72 0.75 1"),
    "lintel": Kind("wall", "0.70 0.72 0.75 1"),
    "pillar": Kind("wall", "0.70 0.72 0.75 1"),
    "shelf": Kind("shelf", "0.30 0.42 0.60 1"),
    "overhang": Kind("structure", "0.85 0.55 0.20 1"),
    "crate": Kind("crate", "0.62 0.47 0.31 1"),
    "furniture": Kind("furniture", "0.55 0.40 0.28 1"),
    "person": Kind("person", "0.80 0.30 0.45 1"),
    "vehicle": Kind("vehicle", "0.95 0.70 0.10 1"),
    "hedge": Kind("vegetation", "0.25 0.40 0.22 1"),
    "trunk": Kind("vegetation", "0.40 0.30 0.20 1"),
    "branch": Kind("vegetation", "0.36 0.45 0.22 1"),
    "pole": Kind("structure", "0.45 0.47 0.50 1"),
    "bar": Kind("structure", "0.70 0.35 0.20 1"),
    "structure": Kind("structure", "0.55 0.57 0.60 1"),
    "barrier": Kind("structure", "0.90 0.35 0.15 1"),
    "door": Kind("door", "0.50 0.33 0.22 1"),
    "ghost": Kind("unknown", "0.60 0.55 0.80 1"),
}
"""Materials by the kind of solid; any other kind is allowed and of unknown class."""

UNKNOWN = Kind("unknown", "0.6 0.6 0.6 1")


def colour_of(kind: str) -> str:
    """Return the colour of a kind, as MJCF writes it."""
    return KINDS.get(kind, UNKNOWN).colour


def class_of(kind: str) -> int:
    """Return the index of a kind's class in `CLASSES`; a class's own name is a kind too."""
    name = kind if kind in CLASSES else KINDS.get(kind, UNKNOWN).class_name
    return CLASSES.index(name)
