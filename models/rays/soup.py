"""Meshes and height fields as triangles under trees, which geoms of the same asset share."""

from __future__ import annotations

import mujoco
import numpy as np
from numpy.typing import NDArray

from wayproof.models.arrays import Array
from wayproof.models.rays.records import Soup
from wayproof.models.rays.tree import LEAF_BITS, build_wide_tree

MESH, HEIGHT_FIELD = int(mujoco.mjtGeom.mjGEOM_MESH), int(mujoco.mjtGeom.mjGEOM_HFIELD)
SHAPES = (MESH, HEIGHT_FIELD)
"""MuJoCo's `mjtGeom` of the shapes that are made of triangles here."""


def gather(
    model: mujoco.MjModel, ids: NDArray[np.int32]
) -> tuple[Soup | None, NDArray[np.int32], Array]:
    """Return the triangles of some geoms; None without geoms.

    With them come, of each geom, the node that holds its triangles, (g,), and half sides, m, of the
    box about its frame's origin that holds them, (g, 3).
    """
    roots, sides = np.empty(len(ids), np.int32), np.empty((len(ids), 3))
    known: dict[tuple[int, int], tuple[int, Array]] = {}
    parts: list[Soup] = []
    nodes = vertices = triangles = 0
    for row, geom in enumerate(ids):
        asset = int(model.geom_type[geom]), int(model.geom_dataid[geom])
        if asset not in known:
            points, corners = _triangles(model, *asset)
            part = _build(points, corners)
            links = part.links
            links[links > 0] += nodes
            links[links < 0] -= triangles << LEAF_BITS
            part.corners[:] += vertices
            known[asset] = nodes, np.abs(points).max(axis=0)
            parts.append(part)
            nodes, vertices = nodes + len(links), vertices + len(part.vertices)
            triangles += len(corners)
        roots[row], sides[row] = known[asset]
    if not parts:
        return None, roots, sides
    return Soup(*(np.concatenate(tables) for tables in zip(*parts, strict=True))), roots, sides


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

    Triangles are wound about their outer normal. Those of a height field are two a cell, its walls
    and the box under it, as MuJoCo has it.
    """
    return _mesh(model, asset) if kind == MESH else _field(model, asset)


def _mesh(model: mujoco.MjModel, mesh: int) -> tuple[Array, NDArray[np.int32]]:
    start, count = model.mesh_vertadr[mesh], model.mesh_vertnum[mesh]
    vertices = model.mesh_vert[start : start + count].astype(np.float64)
    start, count = model.mesh_faceadr[mesh], model.mesh_facenum[mesh]
    return vertices, model.mesh_face[start : start + count].astype(np.int32)


def _field(model: mujoco.MjModel, field: int) -> tuple[Array, NDArray[np.int32]]:
    """Return the ground of a field, its four walls down to height 0, and the box under it."""
    rows, columns = int(model.hfield_nrow[field]), int(model.hfield_ncol[field])
    half_x, half_y, top, base = model.hfield_size[field]
    start = model.hfield_adr[field]
    heights = model.hfield_data[start : start + rows * columns].astype(np.float64)
    points = np.empty((rows, columns, 3))
    points[..., 0] = 2.0 * half_x / (columns - 1) * np.arange(columns) - half_x
    points[..., 1] = (2.0 * half_y / (rows - 1) * np.arange(rows) - half_y)[:, None]
    points[..., 2] = heights.reshape(rows, columns) * top
    place = np.arange(rows * columns, dtype=np.int32).reshape(rows, columns)
    a, b, c, d = (
        side.ravel() for side in (place[:-1, :-1], place[:-1, 1:], place[1:, 1:], place[1:, :-1])
    )
    ground = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    # Seen from outside, each wall runs to the right.
    crests = points[0], points[:, -1], points[-1, ::-1], points[::-1, 0]
    walls = [_wall(crest, crest * (1.0, 1.0, 0.0)) for crest in crests]
    rim = np.concatenate([*walls, _box(half_x, half_y, base)])  # (t, 3, 3)
    corners = np.arange(3 * len(rim), dtype=np.int32).reshape(-1, 3) + rows * columns
    vertices = np.concatenate([points.reshape(-1, 3), rim.reshape(-1, 3)])
    return vertices, np.concatenate([ground, corners.astype(np.int32)])


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
