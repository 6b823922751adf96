"""Worlds by name."""

from __future__ import annotations

from collections.abc import Callable

from models.worlds.construction import construction
from models.worlds.corridor import corridor
from models.worlds.crossing import crossing
from models.worlds.cylinders import cylinders
from models.worlds.empty import empty
from models.worlds.forest import forest
from models.worlds.ghosts import ghosts
from models.worlds.maze import maze
from models.worlds.movers import Mover
from models.worlds.office import office
from models.worlds.passers_by import with_traffic
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
from models.worlds.traffic import Traffic
from models.worlds.warehouse import warehouse
from models.worlds.world import World

WORLDS: dict[str, Callable[..., World]] = {
    "warehouse": warehouse,
    "corridor": corridor,
    "empty": empty,
    "office": office,
    "forest": forest,
    "construction": construction,
    "maze": maze,
    "cylinders": cylinders,
    "crossing": crossing,
    "ghosts": ghosts,
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
    "Traffic",
    "TriangleMesh",
    "World",
    "is_solvable",
    "is_solvable_in_any",
    "shortest_path_length",
    "with_traffic",
]
