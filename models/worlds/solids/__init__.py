"""Solids of worlds: shapes with exact distances and MJCF."""

from wayproof.models.worlds.solids.primitives import Box, Capsule, Cylinder, Sphere
from wayproof.models.worlds.solids.solid import FRICTION, Band, Solid
from wayproof.models.worlds.solids.surfaces import ConvexMesh, HeightField, TriangleMesh

__all__ = [
    "FRICTION",
    "Band",
    "Box",
    "Capsule",
    "ConvexMesh",
    "Cylinder",
    "HeightField",
    "Solid",
    "Sphere",
    "TriangleMesh",
]
