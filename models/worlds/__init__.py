"""Worlds by name."""

from __future__ import annotations

from collections.abc import Callable

from wayproof.models.worlds.bare import empty, hall, tunnel
from wayproof.models.worlds.construction import construction
from wayproof.models.worlds.corridor import corridor
from wayproof.models.worlds.crossing import crossing
from wayproof.models.worlds.cylinders import cylinders
from wayproof.models.worlds.forest import forest
from wayproof.models.worlds.ghosts import ghosts
from wayproof.models.worlds.maze import maze
from wayproof.models.worlds.movers import Mover, Traffic
from wayproof.models.worlds.office import office
from wayproof.models.worlds.pedestrians import with_traffic
from wayproof.models.worlds.solids import (
    Box,
    Capsule,
    Cylinder,
    HeightField,
    Solid,
    Sphere,
    TriangleMesh,
)
from wayproof.models.worlds.solvability import is_solvable, shortest_path_length
from wayproof.models.worlds.warehouse import warehouse
from wayproof.models.worlds.world import World

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
    "tunnel": tunnel,
    "hall": hall,
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
    "shortest_path_length",
    "with_traffic",
]
