"""Meshes and height fields as triangles under trees, which geoms of the same asset share."""

from __future__ import annotations

import mujoco
import numpy as np
from numpy.typing import NDArray

from wayproof.models.arrays import Array
from wayproof.models.rays.field_grid import (
    FIRST_FACE,
    Fields,
    add_field,
    count_faces,
    field_normals,
    no_fields,
)
from wayproof.models.rays.geometry import PRIMITIVES, shape_name, visible
from wayproof.models.rays.lanes import Beams, SurfaceHits
from wayproof.models.rays.surface_kernels import meet_tiles
from wayproof.models.rays.walks import Placed, Soup
from wayproof.models.rays.wide_tree import LEAF_BITS, build_wide_tree

MESH, HEIGHT_FIELD = int(mujoco.mjtGeom.mjGEOM_MESH), int(mujoco.mjtGeom.mjGEOM_HFIELD)
SHAPES = (MESH, HEIGHT_FIELD)
"""MuJoCo's `mjtGeom` of the shapes that are made of triangles here."""


class Surfaces:
    """The ray-visible meshes and height fields of one model, posed where they are now.

    `meet` passes over beams that already have their hits on primitives and keeps the nearer ones.
    Triangles are met from either side and without gaps between neighbours. Flexes and skins are no
    geoms: neither `mujoco.mj_ray` nor this meets them.
    """

    def __init__(self, model: mujoco.MjModel, group_mask: NDArray[np.uint8]) -> None:
        """Build the triangles and trees of all assets that are seen, and pose what never moves.

        Args:
            model: Its static geoms and its heights must stay as they are.
            group_mask: (6,) non-zero for each geom group that rays meet.

        Raises:
            ValueError: A ray-visible geom is neither a primitive nor a mesh nor a height field; or
                the mask's shape.
        """
        seen = visible(model, group_mask)
        _refuse_what_has_no_triangles(model, seen)
        ids = seen[np.isin(model.geom_type[seen], SHAPES)]
        self._soup, self._fields, places, self._bounds = _gather(model, ids)
        self._geoms = np.column_stack([ids, places]).astype(np.int32)
        self._moves = bool((model.body_weldid[model.geom_bodyid[ids]] != 0).any())
        at_rest = mujoco.MjData(model)
        mujoco.mj_kinematics(model, at_rest)
        self._placed = self._place(at_rest)

    def __len__(self) -> int:
        """Return the number of geoms; without any, a pass has nothing to do."""
        return len(self._geoms)

    def refresh(self, data: mujoco.MjData) -> None:
        """Update the poses of all that can move; call `mujoco.mj_kinematics` first."""
        if self._moves:
            self._placed = self._place(data)

    def meet(
        self,
        starts: NDArray[np.int64],
        beams: Beams,
        range: float,
        hits: SurfaceHits,
    ) -> None:
        """Keep the nearer hits of a sweep; of equal ones the lower geom id's.

        Args:
            starts: (t + 1,) first beam of each tile, and one past the last beam.
            beams: Beams of the sweep.
            range: Longest distance of a hit, m; finite.
            hits: Hits so far; nearer ones are written over them.
        """
        if len(self) and len(starts) > 1:
            meet_tiles(starts, beams, self._soup, self._fields, self._placed, range, hits)

    def face_normals(self, face: NDArray[np.int32]) -> Array:
        """Return unit normals (k, 3) of faces (k,) in their geom's frame, out of the solid."""
        first = self._fields.fields[:, FIRST_FACE]
        field = np.searchsorted(first, face, "right") - 1  # -1 for triangles of trees
        normal = np.empty((len(face), 3))
        for number in np.unique(field):
            rows = field == number
            if number < 0:
                a, b, c = np.moveaxis(self._soup.vertices[self._soup.corners[face[rows]]], 1, 0)
                normal[rows] = np.cross(a - c, b - c)
            else:
                normal[rows] = field_normals(self._fields, number, face[rows] - first[number])
        return np.asarray(normal / np.linalg.norm(normal, axis=1, keepdims=True))

    def _place(self, data: mujoco.MjData) -> Placed:
        """Place the geoms at their poses, in the order of the tree over their boxes there."""
        ids = self._geoms[:, 0]
        position, R = data.geom_xpos[ids], data.geom_xmat[ids].reshape(-1, 3, 3)
        lower, upper = self._bounds[:, :3], self._bounds[:, 3:]
        centre = position + np.einsum("gij,gj->gi", R, (lower + upper) / 2)
        half = np.einsum("gij,gj->gi", np.abs(R), (upper - lower) / 2)
        tree = build_wide_tree(centre - half, centre + half)
        poses = np.concatenate([position, R.reshape(-1, 9)], axis=1)
        own, order = np.abs(self._bounds).max(axis=1), tree.order
        world = np.max(np.abs(centre) + half, initial=0.0)
        reaches = np.append(own[order], world)
        return Placed(tree.boxes, tree.links, self._geoms[order], poses[order], reaches)


def _refuse_what_has_no_triangles(model: mujoco.MjModel, ids: NDArray[np.int32]) -> None:
    for geom in ids:
        kind = int(model.geom_type[geom])
        if kind not in PRIMITIVES + SHAPES:
            name = model.geom(geom).name or f"number {geom}"
            raise ValueError(
                f"geom '{name}': got shape {shape_name(model, geom)}, expected a primitive, a mesh "
                "or a height field; ray engine 'mujoco' casts it"
            )


def _gather(
    model: mujoco.MjModel, ids: NDArray[np.int32]
) -> tuple[Soup, Fields, NDArray[np.int32], Array]:
    """Return the triangles and height fields of some geoms, and where each of the geoms is.

    Of each geom it is the root of its triangles and its row among the fields or -1, (g, 2), and
    the lower and upper corners of the box about it in its frame, (g, 6).
    """
    places, bounds = np.empty((len(ids), 2), np.int32), np.empty((len(ids), 6))
    known: dict[tuple[int, int], tuple[int, int, Array]] = {}
    parts, fields, faces = [_build(np.empty((0, 3)), np.empty((0, 3), np.int32))], no_fields(), 0
    nodes, vertices, triangles = (len(table) for table in parts[0][1:])
    for row, geom in enumerate(ids):
        asset = int(model.geom_type[geom]), int(model.geom_dataid[geom])
        if asset not in known:
            points, corners = _triangles(model, *asset)
            field, height = -1, np.empty(0)
            if asset[0] == HEIGHT_FIELD:
                heights, size = _heights(model, asset[1])
                field, height = len(fields.fields), heights.astype(np.float64) * size[2]
                fields = add_field(fields, heights, tuple(size[:2]), size[2], faces)
                faces += count_faces(*heights.shape)
            part = _build(points, corners)
            links = part.links
            links[links > 0] += nodes
            links[links < 0] -= triangles << LEAF_BITS
            part.corners[:] += vertices
            known[asset] = nodes, field, _bounds(points, height)
            parts.append(part)
            nodes, vertices = nodes + len(links), vertices + len(part.vertices)
            triangles += len(corners)
        root, field, bounds[row] = known[asset]
        places[row] = root, field
    fields.fields[:, FIRST_FACE] += triangles
    soup = Soup(*(np.concatenate(tables) for tables in zip(*parts, strict=True)))
    return soup, fields, places, bounds


def _bounds(points: Array, heights: Array) -> Array:
    """Return the box (6,) about an asset's vertices (v, 3) and heights, m."""
    lower, upper = points.min(axis=0), points.max(axis=0)
    lower[2], upper[2] = heights.min(initial=lower[2]), heights.max(initial=upper[2])
    return np.concatenate([lower, upper])


def _build(points: Array, faces: NDArray[np.int32]) -> Soup:
    """Return one asset's triangles, given as rows (t, 3) of points (v, 3), under a tree.

    Vertices stand in the order in which the leaves need them: what is met together is near.
    """
    corners = points[faces]
    tree = build_wide_tree(corners.min(axis=1), corners.max(axis=1))
    ordered = faces[tree.order]
    used, first, rows = np.unique(ordered.ravel(), return_index=True, return_inverse=True)
    order = np.argsort(first)
    place = np.empty(len(used), np.int32)
    place[order] = np.arange(len(used), dtype=np.int32)
    return Soup(tree.boxes, tree.links, points[used[order]], place[rows].reshape(-1, 3))


def _triangles(model: mujoco.MjModel, kind: int, asset: int) -> tuple[Array, NDArray[np.int32]]:
    """Return vertices (v, 3) of an asset in its frame, and triangles (t, 3) as rows of these.

    Triangles are wound about their outer normal. Those of a height field are its walls and the box
    under it, as MuJoCo has it.
    """
    return _mesh(model, asset) if kind == MESH else _rim(model, asset)


def _mesh(model: mujoco.MjModel, mesh: int) -> tuple[Array, NDArray[np.int32]]:
    start, count = model.mesh_vertadr[mesh], model.mesh_vertnum[mesh]
    vertices = model.mesh_vert[start : start + count].astype(np.float64)
    start, count = model.mesh_faceadr[mesh], model.mesh_facenum[mesh]
    return vertices, model.mesh_face[start : start + count].astype(np.int32)


def _heights(model: mujoco.MjModel, field: int) -> tuple[NDArray[np.float32], Array]:
    """Return the shares of a field's highest point (rows, columns), and MuJoCo's size (4,), m."""
    rows, columns = int(model.hfield_nrow[field]), int(model.hfield_ncol[field])
    start = model.hfield_adr[field]
    heights = model.hfield_data[start : start + rows * columns].reshape(rows, columns)
    return heights.astype(np.float32), model.hfield_size[field]


def _rim(model: mujoco.MjModel, field: int) -> tuple[Array, NDArray[np.int32]]:
    """Return the four walls of a field down to height 0, and the box under it."""
    heights, (half_x, half_y, top, base) = _heights(model, field)
    rows, columns = heights.shape
    points = np.empty((rows, columns, 3))
    points[..., 0] = 2.0 * half_x / (columns - 1) * np.arange(columns) - half_x
    points[..., 1] = (2.0 * half_y / (rows - 1) * np.arange(rows) - half_y)[:, None]
    points[..., 2] = heights.astype(np.float64) * top
    # Seen from outside, each wall runs to the right.
    crests = points[0], points[:, -1], points[-1, ::-1], points[::-1, 0]
    walls = [_wall(crest, crest * (1.0, 1.0, 0.0)) for crest in crests]
    triangles = np.concatenate([*walls, _box(half_x, half_y, base)])  # (t, 3, 3)
    corners = np.arange(3 * len(triangles), dtype=np.int32).reshape(-1, 3)
    return triangles.reshape(-1, 3), corners


def _wall(crest: Array, foot: Array) -> Array:
    """Return triangles between a polyline (k, 3) and the one below it."""
    return np.concatenate(
        [
            np.stack([foot[:-1], foot[1:], crest[1:]], axis=1),
            np.stack([foot[:-1], crest[1:], crest[:-1]], axis=1),
        ]
    )


def _box(half_x: float, half_y: float, depth: float) -> Array:
    """Return the twelve triangles of the box from -depth to 0."""
    ring = np.array([(-half_x, -half_y), (half_x, -half_y), (half_x, half_y), (-half_x, half_y)])
    low, high = (np.column_stack([ring, np.full(4, z)]) for z in (-depth, 0.0))
    around = [0, 1, 2, 3, 0]
    sides = _wall(high[around], low[around])
    lids = [high[[0, 1, 2]], high[[0, 2, 3]], low[[0, 2, 1]], low[[0, 3, 2]]]
    return np.concatenate([sides, np.stack(lids)])
