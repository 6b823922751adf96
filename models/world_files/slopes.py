"""Floors that are not level, without the nodes of a height field: tilted boxes, planes, ramps."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wayproof.models.world_files.options import Plane
from wayproof.models.worlds.solids import Box, ConvexMesh, Solid

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


def sloped_floors(planes: Iterable[Plane], floors: Iterable[Solid]) -> Iterator[SlopedFloor]:
    """Yield the floors that are not level among a world's planes and the solids of its floor."""
    for plane in planes:
        if UPWARD < plane.normal[2] < 1.0 - LEVEL:
            yield SlopedFloor(np.array([[*plane.normal, -float(plane.normal @ plane.point)]]))
    for solid in floors:
        if isinstance(solid, Box):
            R, half = solid.R_world_box, np.array(solid.half_extents)
            normals = np.concatenate([R.T, -R.T])
            offsets = -(normals @ np.array(solid.centre)) - np.concatenate([half, half])
            areas = np.roll(half, 1) * np.roll(half, 2) * 4.0
            sloped = _slopes(normals) & (np.concatenate([areas, areas]) > LEAST_AREA)
            if sloped.any():
                yield SlopedFloor(np.column_stack([normals, offsets]))
        elif isinstance(solid, ConvexMesh):
            a, b, c = (solid.triangles[:, n] for n in range(3))
            crosses = np.cross(b - a, c - a)
            doubled = np.linalg.norm(crosses, axis=1)
            kept = doubled > 0.0
            normals = crosses[kept] / doubled[kept, None]
            sloped = _slopes(normals)
            if float((doubled[kept] * normals[:, 2])[sloped].sum()) / 2.0 > LEAST_AREA:
                offsets = -np.einsum("ij,ij->i", normals, a[kept])
                yield SlopedFloor(np.column_stack([normals, offsets]))


def _slopes(normals: NDArray[np.float64]) -> NDArray[np.bool_]:
    return (normals[:, 2] > UPWARD) & (normals[:, 2] < 1.0 - LEVEL)
