"""Floors that are not level: height fields, tilted boxes and planes, ramps of meshes."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wayproof.models.world_files.options import Plane
from wayproof.models.worlds.solids import Box, ConvexMesh, HeightField, Solid

LEVEL = 1e-6
"""Deviation of a level surface's unit normal from upwards."""

LEAST_AREA = 0.05
"""Area of a face, seen from above, from which it is a floor, m^2: bevels are not."""

UPWARD = 0.5
"""Upward part of a face's unit normal from which it is stepped on; steeper ones are sides."""


class SlopedFloor(NamedTuple):
    """The upper surface of a convex floor.

    Attributes:
        planes: (n, 4) outward unit normals and offsets of its faces: inside `normal . p + d <= 0`.
    """

    planes: NDArray[np.float64]

    def surface(self, points: ArrayLike) -> NDArray[np.float64]:  # (n,)
        """Return the height of the floor at points (n, >= 2), m; minus infinity beside it."""
        at = np.asarray(points, np.float64)[:, :2]
        top, bottom = np.full(len(at), np.inf), np.full(len(at), -np.inf)
        for x, y, z, offset in self.planes.tolist():
            beyond = at[:, 0] * x + at[:, 1] * y + offset
            if z > LEVEL:
                np.minimum(top, -beyond / z, out=top)
            elif z < -LEVEL:
                np.maximum(bottom, -beyond / z, out=bottom)
            else:
                top[beyond > 0.0] = -np.inf
        return np.where(top >= bottom, top, -np.inf)


Terrain = tuple[HeightField | SlopedFloor, ...]


def terrain_of(floors: Sequence[Solid], planes: Iterable[Plane] = ()) -> Terrain:
    """Return what is not level among the solids of a floor, and planes."""
    fields = (one for one in floors if isinstance(one, HeightField))
    return (*fields, *_sloped(planes, floors))


def ground_heights(terrain: Terrain, points: ArrayLike) -> NDArray[np.float64]:  # (n,)
    """Return the height of the highest terrain at points (n, >= 2), m; 0 beside all of it."""
    at = np.asarray(points, np.float64)
    heights = np.full(len(at), -np.inf)
    for one in terrain:
        np.maximum(heights, one.surface(at), out=heights)
    return np.where(np.isfinite(heights), heights, 0.0)


def _sloped(planes: Iterable[Plane], floors: Iterable[Solid]) -> Iterator[SlopedFloor]:
    for plane in planes:
        if UPWARD < plane.normal[2] < 1.0 - LEVEL:
            yield SlopedFloor(np.array([[*plane.normal, -float(plane.normal @ plane.point)]]))
    for solid in floors:
        if isinstance(solid, Box):
            R, half = solid.R_world_box, np.array(solid.half_extents)
            normals = np.concatenate([R.T, -R.T])
            offsets = -(normals @ np.array(solid.centre)) - np.concatenate([half, half])
            areas = np.tile(np.roll(half, 1) * np.roll(half, 2) * 4.0, 2)
            if (_slopes(normals) & (areas > LEAST_AREA)).any():
                yield SlopedFloor(np.column_stack([normals, offsets]))
        elif isinstance(solid, ConvexMesh):
            a, b, c = (solid.triangles[:, n] for n in range(3))
            crosses = np.cross(b - a, c - a)
            doubled = np.linalg.norm(crosses, axis=1)
            kept = doubled > 0.0
            normals = crosses[kept] / doubled[kept, None]
            if float((doubled[kept] * normals[:, 2])[_slopes(normals)].sum()) / 2.0 > LEAST_AREA:
                offsets = -np.einsum("ij,ij->i", normals, a[kept])
                yield SlopedFloor(np.column_stack([normals, offsets]))


def _slopes(normals: NDArray[np.float64]) -> NDArray[np.bool_]:
    return (normals[:, 2] > UPWARD) & (normals[:, 2] < 1.0 - LEVEL)
