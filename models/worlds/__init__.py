"""Worlds by name."""

from __future__ import annotations

from collections.abc import Callable

from models.worlds.corridor import corridor
from models.worlds.empty import empty
from models.worlds.movers import Mover
from models.worlds.solids import (
    Box,
    Capsule,
    Cylinder,
    HeightField,
    Solid,
    Sphere,
    TriangleMesh,
)
from models.worlds.solvability import is_solvable, is_solvable_in_any, shortest_path_length
from models.worlds.warehouse import warehouse
from models.worlds.world import World

WORLDS: dict[str, Callable[..., World]] = {
    "warehouse": warehouse,
    "corridor": corridor,
    "empty": empty,
}

__all__ = [
    "WORLDS",
    "Box",
    "Capsule",
    "Cylinder",
    "HeightField",
    "Mover",
    "Solid",
    "Sphere",
    "TriangleMesh",
    "World",
    "is_solvable",
    "is_solvable_in_any",
    "shortest_path_length",
]
