"""Solids of triangles: meshes, their convex hulls, and height fields, written into the MJCF."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wayproof.models.arrays import Vector3
from wayproof.models.worlds.solids.solid import (
    Band,
    Solid,
    least_and_greatest,
    numbers,
    write_geom,
)

MIN_RELIEF = 1e-3
"""Height passed to MuJoCo for a height field without relief, m."""


@dataclass(frozen=True)
class TriangleMesh(Solid):
    """A surface of triangles. Beams meet the triangles; bodies, in MuJoCo, their convex hull.

    So a mesh that is to be touched where it is hollow has to come in convex pieces.

    Attributes:
        vertices: World frame, m.
        faces: Three numbers of vertices each, counter-clockwise as seen from outside.
        kind: Kind of thing, such as `floor`.
    """

    vertices: tuple[Vector3, ...]
    faces: tuple[tuple[int, int, int], ...]
    kind: str

    def __post_init__(self) -> None:
        """Refuse a surface that MuJoCo would refuse.

        Raises:
            ValueError: Fewer than four vertices, no face, or a face of a vertex that is not there.
        """
        if len(self.vertices) < 4:
            raise ValueError(f"vertices: got {len(self.vertices)}, expected at least 4")
        used = np.array(self.faces)
        if used.ndim != 2 or used.min() < 0 or used.max() >= len(self.vertices):
            raise ValueError(f"faces: expected triples of vertices 0 to {len(self.vertices) - 1}")

    @classmethod
    def from_arrays(cls, vertices: ArrayLike, faces: ArrayLike, kind: str) -> TriangleMesh:
        """Build it from vertices (n, 3), m, and faces (m, 3)."""
        return cls(
            tuple(map(tuple, np.asarray(vertices, np.float64).tolist())),
            tuple(map(tuple, np.asarray(faces, np.int64).tolist())),
            kind,
        )

    @cached_property
    def triangles(self) -> NDArray[np.float64]:  # (m, 3, 3)
        """Corners of each face, world frame, m."""
        return np.asarray(np.array(self.vertices, np.float64)[np.array(self.faces)])

    @cached_property
    def bounds(self) -> tuple[Vector3, Vector3]:
        """Lower and upper corner of the axis-aligned bounds, m."""
        return least_and_greatest(self.vertices)

    def distance(self, points: ArrayLike) -> NDArray[np.float64]:
        """Return exact distance (n,) from points (n, 3), world frame, to the surface, m; slow."""
        return distance_to_triangles(points, self.triangles)

    def distance_in_plane(self, points: ArrayLike, band: Band) -> NDArray[np.float64]:
        """Return the distance (n,) of points (n, 2) to triangles that touch the band (`Solid`)."""
        return distance_to_triangles(points, _in_band(self.triangles, band)[:, :, :2])

    def asset(self, name: str) -> str:
        """Return the mesh; an open one weighs as a shell, as solids of worlds do not move."""
        vertices = " ".join(numbers(vertex) for vertex in self.vertices)
        faces = " ".join(f"{a} {b} {c}" for a, b, c in self.faces)
        return f'    <mesh name="{name}" inertia="shell" vertex="{vertices}" face="{faces}"/>'

    def geom(self, name: str) -> str:
        """Return its MJCF geom."""
        return write_geom(name, self.kind, f'type="mesh" mesh="{name}"')


@dataclass(frozen=True)
class HeightField(Solid):
    """Ground of given heights at the nodes of a grid, solid down to a base below them.

    Attributes:
        corner: Corner of least x and y; heights count from the corner's z, m.
        spacing: Spacing between nodes in x and y, m.
        heights: heights[i][j] m at the node i along x and j along y.
        kind: Kind of thing, such as `floor`.
        base: Thickness below the lowest node, m.
    """

    corner: Vector3
    spacing: tuple[float, float]
    heights: tuple[tuple[float, ...], ...]
    kind: str
    base: float = 0.5

    def __post_init__(self) -> None:
        """Refuse a surface that MuJoCo would refuse.

        Raises:
            ValueError: Fewer than two nodes along an axis, ragged rows, no spacing or no base.
        """
        widths = {len(row) for row in self.heights}
        if len(self.heights) < 2 or len(widths) != 1 or min(widths) < 2:
            raise ValueError("heights: expected at least 2 x 2 nodes, as many in every row")
        if min(*self.spacing, self.base) <= 0.0:
            raise ValueError(
                f"spacing, base: got {self.spacing} and {self.base}, expected positive lengths"
            )

    @classmethod
    def from_array(
        cls, corner: Vector3, spacing: tuple[float, float], heights: ArrayLike, kind: str
    ) -> HeightField:
        """Build it from heights (nx, ny), m."""
        rows = np.asarray(heights, np.float64).tolist()
        return cls(corner, spacing, tuple(map(tuple, rows)), kind)

    @cached_property
    def nodes(self) -> NDArray[np.float64]:  # (nx, ny, 3)
        """World frame, m."""
        z = np.array(self.heights)
        i, j = np.indices(z.shape)
        grid = np.stack([i * self.spacing[0], j * self.spacing[1], z], axis=-1)
        return np.asarray(grid + self.corner)

    @cached_property
    def triangles(self) -> NDArray[np.float64]:  # (2 (nx - 1) (ny - 1), 3, 3)
        """Two for each cell, cut as MuJoCo cuts it: from the low corner to the high one."""
        n = self.nodes
        a, b, c, d = n[:-1, :-1], n[1:, :-1], n[1:, 1:], n[:-1, 1:]
        faces = np.concatenate([np.stack([a, b, c], axis=2), np.stack([a, c, d], axis=2)])
        return np.asarray(faces.reshape(-1, 3, 3))

    @cached_property
    def bounds(self) -> tuple[Vector3, Vector3]:
        """Lower and upper corner of the axis-aligned bounds, down to the base, m."""
        (x, y, z), high = least_and_greatest(self.nodes.reshape(-1, 3))
        return (x, y, z - self.base), high

    def distance(self, points: ArrayLike) -> NDArray[np.float64]:
        """Return the distance (n,) of points (n, 3) above the base to the ground, m; 0 below."""
        points = np.asarray(points, np.float64)
        return np.where(self._below(points), 0.0, distance_to_triangles(points, self.triangles))

    def distance_in_plane(self, points: ArrayLike, band: Band) -> NDArray[np.float64]:
        """Return the distance (n,) of points (n, 2) to ground that is in the band; see `Solid`."""
        if self.bottom >= band[1]:
            return np.full(len(np.asarray(points)), np.inf)
        rising = self.triangles[self.triangles[:, :, 2].max(axis=1) > band[0]]
        return distance_to_triangles(points, rising[:, :, :2])

    def asset(self, name: str) -> str:
        """Return its heights as shares of its relief, rows from the far side in y."""
        z = np.array(self.heights)
        relief = float(z.max() - z.min())
        shares = ((z - z.min()) / (relief or 1.0)).T[::-1]
        (width, depth), (nx, ny) = self._half_extents(), z.shape
        size = numbers([width, depth, relief or MIN_RELIEF, self.base])
        elevation = " ".join(f"{share:.9g}" for share in shares.ravel())
        return (
            f'    <hfield name="{name}" nrow="{ny}" ncol="{nx}" size="{size}" '
            f'elevation="{elevation}"/>'
        )

    def geom(self, name: str) -> str:
        """Return its MJCF geom."""
        half_x, half_y = self._half_extents()
        x, y, z = self.corner
        pos = numbers([x + half_x, y + half_y, z + min(map(min, self.heights))])
        return write_geom(name, self.kind, f'type="hfield" hfield="{name}" pos="{pos}"')

    def _half_extents(self) -> tuple[float, float]:
        nx, ny = len(self.heights), len(self.heights[0])
        return (nx - 1) * self.spacing[0] / 2, (ny - 1) * self.spacing[1] / 2

    def surface(self, points: ArrayLike) -> NDArray[np.float64]:
        """Return the height of the ground (n,) at points (n, >= 2), m; -inf beside it."""
        at = (np.asarray(points, np.float64)[:, :2] - self.corner[:2]) / self.spacing
        cells = np.subtract(self.nodes.shape[:2], 1)
        over = ((at >= 0.0) & (at <= cells)).all(axis=1)
        i, j = np.clip(at.astype(np.int64), 0, cells - 1).T
        u, v = (at - np.stack([i, j], axis=1)).T
        z = self.nodes[..., 2]
        a, b, c, d = z[i, j], z[i + 1, j], z[i + 1, j + 1], z[i, j + 1]
        ground = np.where(u >= v, a + u * (b - a) + v * (c - b), a + v * (d - a) + u * (c - d))
        return np.where(over, ground, -np.inf)

    def _below(self, points: NDArray[np.float64]) -> NDArray[np.bool_]:  # (n,)
        """Return whether points lie on or under the ground and not under its base."""
        ground = self.surface(points)
        return np.asarray((points[:, 2] <= ground) & (points[:, 2] >= self.bottom))


def _in_band(triangles: NDArray[np.float64], band: Band) -> NDArray[np.float64]:
    heights = triangles[:, :, 2]
    within = (heights.min(axis=1) < band[1]) & (heights.max(axis=1) > band[0])
    return np.asarray(triangles[within])


BOX_FACES = np.array(
    [
        (0, 1, 3), (0, 3, 2), (4, 6, 7), (4, 7, 5), (0, 4, 5), (0, 5, 1),
        (2, 3, 7), (2, 7, 6), (0, 2, 6), (0, 6, 4), (1, 5, 7), (1, 7, 3),
    ]
)  # fmt: skip
"""Triangles (12, 3) of a box whose corners are numbered with x slowest and z fastest."""


def distance_to_triangles(
    points: ArrayLike, triangles: NDArray[np.float64]
) -> NDArray[np.float64]:  # (n,)
    """Return the distance from points to the nearest of the triangles, m; infinite without any.

    Args:
        points: (n, d) with d = 2 or 3.
        triangles: (m, 3, d) corners.
    """
    points = np.asarray(points, np.float64)
    least = np.full(len(points), np.inf)
    for triangle in triangles:
        np.minimum(least, _squared_distance(points, triangle), out=least)
    return np.asarray(np.sqrt(least))


def _squared_distance(
    points: NDArray[np.float64], triangle: NDArray[np.float64]
) -> NDArray[np.float64]:  # (n,)
    """Return the squared distance to the plane if its foot is inside, else to the nearest side."""
    a, b, c = triangle
    sides = [_to_segment(points, p, q) for p, q in ((a, b), (b, c), (c, a))]
    least: NDArray[np.float64] = np.minimum(np.minimum(sides[0], sides[1]), sides[2])
    u, v, offset = b - a, c - a, points - a
    uu, uv, vv = u @ u, u @ v, v @ v
    determinant = uu * vv - uv * uv
    if determinant <= 0.0:
        return least  # the corners lie on one line
    ou, ov = offset @ u, offset @ v
    s, t = (vv * ou - uv * ov) / determinant, (uu * ov - uv * ou) / determinant
    inside = (s >= 0.0) & (t >= 0.0) & (s + t <= 1.0)
    perpendicular = offset - s[:, None] * u - t[:, None] * v
    return np.where(inside, np.square(perpendicular).sum(axis=1), least)


def _to_segment(
    points: NDArray[np.float64], tail: NDArray[np.float64], head: NDArray[np.float64]
) -> NDArray[np.float64]:  # (n,) squared
    along = head - tail
    offset = points - tail
    length = max(float(along @ along), 1e-300)
    share = np.clip(offset @ along / length, 0.0, 1.0)
    nearest: NDArray[np.float64] = np.square(offset - share[:, None] * along).sum(axis=1)
    return nearest


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
