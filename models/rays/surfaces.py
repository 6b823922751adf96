"""Meshes and height fields as triangles under trees, which geoms of the same asset share."""

from __future__ import annotations

import mujoco
import numpy as np
from numpy.typing import NDArray

from wayproof.models.arrays import Array
from wayproof.models.rays.geometry import PRIMITIVES, shape_name, visible
from wayproof.models.rays.packets import NORMAL, TRIANGLE_COLUMNS
from wayproof.models.rays.surface_kernels import Beams, Placed, Soup, SurfaceHits, meet_tiles
from wayproof.models.rays.tree import Tree, build_tree

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
        self._soup, roots = _gather(model, ids)
        self._geoms = np.column_stack([ids, roots])
        self._moves = bool((model.body_weldid[model.geom_bodyid[ids]] != 0).any())
        at_rest = mujoco.MjData(model)
        mujoco.mj_kinematics(model, at_rest)
        self._placed = self._place(at_rest)

    def __len__(self) -> int:
        """Number of geoms; with none, a pass has nothing to do."""
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
        """Keep the nearer hits of some tiles of a sweep; of equal ones the lower geom id's.

        Tiles write to places of their own, so that threads may share a sweep.

        Args:
            starts: (t + 1,) first beam of each of these tiles, and one past the last beam.
            beams: Beams of the sweep.
            range: Longest distance of a hit, m; finite.
            hits: Hits so far; nearer ones are written over them.
        """
        if len(self) and len(starts) > 1:
            meet_tiles(starts, beams, self._soup, self._placed, range, hits)

    def face_normals(self, face: NDArray[np.int32]) -> Array:
        """Return unit normals (k, 3) of faces (k,) in their geom's frame, out of the solid."""
        normal = self._soup.triangles[face, NORMAL : NORMAL + 3]
        return np.asarray(normal / np.linalg.norm(normal, axis=1, keepdims=True))

    def _place(self, data: mujoco.MjData) -> Placed:
        """Place the geoms at their poses, in the order of the tree over their boxes there."""
        ids, roots = self._geoms.T
        position, R = data.geom_xpos[ids], data.geom_xmat[ids].reshape(-1, 3, 3)
        corners = self._soup.boxes[roots].reshape(-1, 2, 3)
        centre = position + np.einsum("gij,gj->gi", R, corners.mean(axis=1))
        half = np.einsum("gij,gj->gi", np.abs(R), (corners[:, 1] - corners[:, 0]) / 2)
        tree = build_tree(centre - half, centre + half)
        poses = np.concatenate([position, R.reshape(-1, 9)], axis=1)
        return Placed(tree.boxes, tree.links, self._geoms[tree.order], poses[tree.order])


def _refuse_what_has_no_triangles(model: mujoco.MjModel, ids: NDArray[np.int32]) -> None:
    for geom in ids:
        kind = int(model.geom_type[geom])
        if kind not in PRIMITIVES + SHAPES:
            name = model.geom(geom).name or f"number {geom}"
            raise ValueError(
                f"geom '{name}': got shape {shape_name(model, geom)}, expected a primitive, a mesh "
                "or a height field; ray engine 'mujoco' casts it"
            )


def _gather(model: mujoco.MjModel, ids: NDArray[np.int32]) -> tuple[Soup, NDArray[np.int32]]:
    """Return triangles of all assets of some geoms, and the root of each geom's tree, (g,)."""
    roots = np.empty(len(ids), np.int32)
    root_of: dict[tuple[int, int], int] = {}
    trees: list[Tree] = []
    tables: list[Array] = [np.empty((0, TRIANGLE_COLUMNS))]
    nodes, triangles = 0, 0
    for row, geom in enumerate(ids):
        asset = int(model.geom_type[geom]), int(model.geom_dataid[geom])
        if asset not in root_of:
            corners = _corners(model, *asset)
            tree = build_tree(corners.min(axis=1), corners.max(axis=1))
            leaf = tree.links[:, 1] > 0
            tree.links[:, 0] += np.where(leaf, triangles, nodes).astype(np.int32)
            root_of[asset] = nodes
            trees.append(tree)
            tables.append(_table(corners[tree.order]))
            nodes += len(tree.boxes)
            triangles += len(corners)
        roots[row] = root_of[asset]
    boxes = np.concatenate([np.empty((0, 6)), *(tree.boxes for tree in trees)])
    links = np.concatenate([np.empty((0, 3), np.int32), *(tree.links for tree in trees)])
    return Soup(boxes, links, np.concatenate(tables)), roots


def _table(corners: Array) -> Array:
    """Return rows of `Soup.triangles` for corners (t, 3, 3)."""
    following = np.roll(corners, -1, axis=1)
    edges = following - corners  # (t, 3, 3)
    # From the middle of an edge: both triangles at it get the same numbers, but for the sign.
    pose_indices = np.cross((corners + following) / 2, edges)
    normals = np.cross(corners[:, 0] - corners[:, 2], corners[:, 1] - corners[:, 2])
    offsets = np.einsum("ti,ti->t", normals, corners[:, 2])
    sides = np.concatenate([pose_indices, edges], axis=2).reshape(-1, 18)
    return np.concatenate([sides, normals, offsets[:, None]], axis=1)


def _corners(model: mujoco.MjModel, kind: int, asset: int) -> Array:
    """Return triangles of a mesh or a height field in its frame, wound about their outer normal."""
    return _mesh(model, asset) if kind == MESH else _height_field(model, asset)


def _mesh(model: mujoco.MjModel, mesh: int) -> Array:
    start, count = model.mesh_vertadr[mesh], model.mesh_vertnum[mesh]
    vertices = model.mesh_vert[start : start + count].astype(np.float64)
    start, count = model.mesh_faceadr[mesh], model.mesh_facenum[mesh]
    return np.asarray(vertices[model.mesh_face[start : start + count]])


def _height_field(model: mujoco.MjModel, field: int) -> Array:
    """Two triangles a cell, four walls down to height 0 and the box under it, as MuJoCo has it."""
    rows, columns = int(model.hfield_nrow[field]), int(model.hfield_ncol[field])
    half_x, half_y, top, base = model.hfield_size[field]
    start = model.hfield_adr[field]
    heights = model.hfield_data[start : start + rows * columns].astype(np.float64) * top
    points = np.empty((rows, columns, 3))
    points[..., 0] = 2.0 * half_x / (columns - 1) * np.arange(columns) - half_x
    points[..., 1] = (2.0 * half_y / (rows - 1) * np.arange(rows) - half_y)[:, None]
    points[..., 2] = heights.reshape(rows, columns)
    near, far = points[:-1], points[1:]
    cells = np.concatenate(
        [
            np.stack([near[:, :-1], near[:, 1:], far[:, 1:]], axis=2).reshape(-1, 3, 3),
            np.stack([near[:, :-1], far[:, 1:], far[:, :-1]], axis=2).reshape(-1, 3, 3),
        ]
    )
    # Seen from outside, each wall runs to the right.
    crests = points[0], points[:, -1], points[-1, ::-1], points[::-1, 0]
    walls = [_wall(crest, crest * (1.0, 1.0, 0.0)) for crest in crests]
    return np.concatenate([cells, *walls, _box(half_x, half_y, base)])


def _wall(crest: Array, foot: Array) -> Array:
    """Return triangles between a polyline (k, 3) and the one below it."""
    return np.concatenate(
        [
            np.stack([foot[:-1], foot[1:], crest[1:]], axis=1),
            np.stack([foot[:-1], crest[1:], crest[:-1]], axis=1),
        ]
    )


def _box(half_x: float, half_y: float, depth: float) -> Array:
    """Twelve triangles of the box from -depth to 0."""
    ring = np.array([(-half_x, -half_y), (half_x, -half_y), (half_x, half_y), (-half_x, half_y)])
    low, high = (np.column_stack([ring, np.full(4, z)]) for z in (-depth, 0.0))
    around = [0, 1, 2, 3, 0]
    sides = _wall(high[around], low[around])
    lids = [high[[0, 1, 2]], high[[0, 2, 3]], low[[0, 2, 1]], low[[0, 3, 2]]]
    return np.concatenate([sides, np.stack(lids)])
