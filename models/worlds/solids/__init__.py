"""Solids of worlds: shapes with exact distances and MJCF."""

from wayproof.models.worlds.solids.box import Box
from wayproof.models.worlds.solids.convex import ConvexMesh
from wayproof.models.worlds.solids.round import Capsule, Cylinder, Sphere
from wayproof.models.worlds.solids.solid import FRICTION, Band, Solid
from wayproof.models.worlds.solids.surfaces import HeightField, TriangleMesh

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
