"""Convex meshes, which bodies collide with in place of a mesh in MuJoCo."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wayproof.models.worlds.solids.solid import Band
from wayproof.models.worlds.solids.surfaces import TriangleMesh
from wayproof.models.worlds.solids.triangles import distance_to_triangles


@dataclass(frozen=True)
class ConvexMesh(TriangleMesh):
    """The convex hull of a mesh, solid throughout; attributes as for `TriangleMesh`."""

    @cached_property
    def _hull(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Outward planes (m, 4) and triangles (m, 3, 3) of the hull."""
        from scipy.spatial import ConvexHull  # slow to load, and few worlds have one

        points = np.array(self.vertices, np.float64)
        hull = ConvexHull(points)
        return np.asarray(hull.equations), np.asarray(points[hull.simplices])

    def distance(self, points: ArrayLike) -> NDArray[np.float64]:
        """Return exact distance (n,) from points (n, 3), world frame, m; 0 inside."""
        points = np.asarray(points, np.float64)
        planes, triangles = self._hull
        beyond = np.full(len(points), -np.inf)
        for plane in planes:
            np.maximum(beyond, points @ plane[:3] + plane[3], out=beyond)
        outside = beyond > 0.0
        distances = np.zeros(len(points))
        distances[outside] = distance_to_triangles(points[outside], triangles)
        return distances

    def distance_in_plane(self, points: ArrayLike, band: Band) -> NDArray[np.float64]:
        """Return exact distance (n,) from points (n, 2) to the part in the band, m; see `Solid`."""
        points = np.asarray(points, np.float64)
        outline = self._outline(band)
        if outline is None:
            return np.full(len(points), np.inf)
        inside = np.ones(len(points), np.bool_)
        least = np.full(len(points), np.inf)
        for tail, head in zip(outline, np.roll(outline, -1, axis=0), strict=True):
            along, offset = head - tail, points - tail
            inside &= along[0] * offset[:, 1] - along[1] * offset[:, 0] >= 0.0
            length = max(float(along @ along), 1e-300)
            share = np.clip(offset @ along / length, 0.0, 1.0)
            gap = np.square(offset - share[:, None] * along).sum(axis=1)
            np.minimum(least, gap, out=least)
        return np.where(inside & (len(outline) > 2), 0.0, np.sqrt(least))

    def _outline(self, band: Band) -> NDArray[np.float64] | None:  # (k, 2)
        """Return the outline, counter-clockwise, of the part between two heights, seen from above.

        None if nothing is; two points for what is as thin as a line.
        """
        _, triangles = self._hull
        tails, heads = triangles.reshape(-1, 3), np.roll(triangles, -1, axis=1).reshape(-1, 3)
        rise = heads[:, 2] - tails[:, 2]
        found = [tails[(tails[:, 2] >= band[0]) & (tails[:, 2] <= band[1])]]
        for height in band:
            crossing = (tails[:, 2] - height) * (heads[:, 2] - height) < 0.0
            share = (height - tails[crossing, 2]) / rise[crossing]
            found.append(tails[crossing] + share[:, None] * (heads - tails)[crossing])
        flat = np.concatenate(found)[:, :2]
        if not len(flat):
            return None
        from scipy.spatial import ConvexHull, QhullError

        try:
            return np.asarray(flat[ConvexHull(flat).vertices])
        except (QhullError, ValueError):  # all on one line
            order = np.lexsort(flat.T)
            return np.asarray(flat[order[[0, -1]]])
