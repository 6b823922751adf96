"""Meshes as convex parts: beams and bodies meet one shape.

MuJoCo lets beams meet a mesh's triangles and bodies its convex hull. So a mesh is taken in
connected pieces, and a piece that is not convex as a height field, as convex pieces, or as boxes.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from wayproof.models.world_files.clouds import cells_of_points
from wayproof.models.world_files.decomposition import decompose
from wayproof.models.world_files.filling import fill_inside, is_closed
from wayproof.models.world_files.hulls import hull, is_convex, surface_error
from wayproof.models.world_files.mesh_files import MOST_FACES, READERS, cloud_points, load_mesh_file
from wayproof.models.world_files.options import Found, ImportOptions
from wayproof.models.world_files.parts import Mesh, Part, vector
from wayproof.models.world_files.reading import WorldFileError
from wayproof.models.world_files.relief import relief_part
from wayproof.models.world_files.voxel_maps import cell_boxes

MOST_PIECES = 2000
"""Number of connected pieces of a mesh up to which each is taken by itself."""

SHEET_THICKNESS = 0.01
"""Thickness that a flat piece is given, which no body could touch without, m."""

SMALL = 0.6
"""Size up to which a piece is taken as its convex hull, m: no robot fits into its hollows."""

NEAR_HULL = 0.05
"""Distance between a piece and its convex hull up to which it is taken as that, m: half of what
the convex pieces of a cut may fill."""

MOST_CUT_FACES = 1500
"""Triangles of a piece up to which it is cut into convex pieces: with more that takes minutes."""

MOST_CUT_ERROR = 0.15
"""Error of a cut up to which it is taken, m: a wall with doors is open, and may come out filled."""

MOST_CUTS = 80
"""Number of pieces of a world that are cut into convex ones: each takes about a second."""

CELL = 0.05
"""Side of the cells that a piece of more triangles is taken as, m."""

MOST_CELLS = 400
"""Number of cells along a piece; those of a longer one are larger."""

HOW = {
    "flat": f"were flat: made {SHEET_THICKNESS * 1e3:g} mm thick",
    "relief": "taken as height fields",
    "near": "taken as their convex hull",
    "hull": f"smaller than {SMALL:g} m taken as their convex hull",
    "cut": "not convex: cut into convex ones",
    "cells": "of many triangles taken as boxes of cells",
    "uncut": f"cut with an error beyond {MOST_CUT_ERROR:g} m taken as boxes of cells instead",
    "more": f"beyond the first {MOST_CUTS} that are not convex taken as boxes of cells",
}
"""Ways to take a piece that is not convex as it is, and their text in a note."""

FLAT = 1e-6
"""Thickness below which a piece is flat, as a share of its size."""

ENDINGS = tuple(READERS)

TURNS = {
    "x": np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]]),
    "y": np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]]),
}
"""Rotation that turns a file's axis up, by the axis."""


def read_mesh(path: Path, options: ImportOptions) -> Found:
    """Read a mesh, in pieces; the axis that its format or file says is up.

    Raises:
        WorldFileError: No trimesh, no mesh, or more triangles than allowed.
    """
    if path.suffix.lower() == ".ply" and (points := cloud_points(path)) is not None:
        return cells_of_points(path, points, options)
    found = Found()
    found.parts = mesh_parts(path, np.full(3, options.scale), found.notes, upright=True)
    return found


@dataclass
class Cuts:
    """Number of pieces that may still be cut into convex ones in one import."""

    left: int = MOST_CUTS


def mesh_parts(
    path: Path,
    scale: NDArray[np.float64],
    notes: list[str],
    *,
    cuts: Cuts | None = None,
    submesh: str | None = None,
    centred: bool = False,
    upright: bool = False,
) -> list[Part]:
    """Read a mesh file as convex parts.

    Args:
        path: A file of one of `ENDINGS`.
        scale: (3,) factors along the file's axes; its own unit is metres already.
        notes: Notes on pieces that were changed are appended.
        cuts: Is counted down; None for a file alone.
        submesh: Name of the node to take alone.
        centred: Whether that node is moved to the origin by the middle of its bounds.
        upright: Whether the file's up axis is turned to z; Gazebo does not.

    Raises:
        WorldFileError: Of `load_mesh_file`; no such node; no triangle; no decomposition.
    """
    loaded = load_mesh_file(path)
    notes += [f"{path.name}: {note}" for note in loaded.notes]
    surfaces = loaded.surfaces
    if submesh is not None:
        surfaces = [surface for surface in surfaces if surface.name == submesh]
        if not surfaces:
            names = ", ".join(dict.fromkeys(surface.name for surface in loaded.surfaces))
            raise WorldFileError(path, f"no submesh '{submesh}' (available: {names[:200]})")
    mesh, doubled = _joined(path, [(surface.vertices, surface.faces) for surface in surfaces])
    vertices = mesh.vertices
    if centred:
        vertices = vertices - (vertices.min(axis=0) + vertices.max(axis=0)) / 2.0
    vertices = vertices * scale
    faces = mesh.faces[:, ::-1] if np.prod(scale) < 0.0 else mesh.faces  # mirrored: inside out
    if upright and loaded.up in TURNS:
        vertices = vertices @ TURNS[loaded.up].T
        notes.append(f"{path.name}: its {loaded.up} axis is up, turned to z")
    return _parts(path, Mesh(vertices, faces), notes, cuts or Cuts(), may_fill=not doubled)


def _joined(
    path: Path, surfaces: list[tuple[NDArray[np.float64], NDArray[np.int64]]]
) -> tuple[Mesh, bool]:
    """Join surfaces, with one vertex for all at the same place: files repeat them for normals.

    Returns:
        The mesh, and whether triangles are drawn more than once, as from both sides: then which way
        they face says nothing.
    """
    if not sum(len(faces) for _, faces in surfaces):
        raise WorldFileError(path, f"0 triangles, expected 1 to {MOST_FACES}")
    offsets = np.cumsum([0, *(len(vertices) for vertices, _ in surfaces)])
    vertices = np.concatenate([vertices for vertices, _ in surfaces])
    faces = np.concatenate([f + at for (_, f), at in zip(surfaces, offsets[:-1], strict=True)])
    if len(faces) > MOST_FACES:
        raise WorldFileError(path, f"{len(faces)} triangles, expected 1 to {MOST_FACES}")
    size = max(float(np.ptp(vertices[np.unique(faces)], axis=0).max()), 1e-12)
    keys = np.rint((vertices - vertices.min(axis=0)) / (1e-7 * size)).astype(np.int64)
    _, first, inverse = np.unique(keys, axis=0, return_index=True, return_inverse=True)
    faces = inverse.reshape(-1)[faces]
    distinct = (faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2])
    distinct &= faces[:, 2] != faces[:, 0]
    if not distinct.any():
        raise WorldFileError(path, "no triangle with an area")
    faces = faces[distinct]
    once = np.unique(np.sort(faces, axis=1), axis=0, return_index=True)[1]
    return Mesh(vertices[first], faces[np.sort(once)]), len(once) < len(faces)  # first of each


def _parts(path: Path, mesh: Mesh, notes: list[str], cuts: Cuts, *, may_fill: bool) -> list[Part]:
    pieces = [_piece(mesh.vertices, own) for own in _pieces(mesh.faces, len(mesh.vertices))]
    if len(pieces) > MOST_PIECES:
        notes.append(f"{path.name}: {len(pieces)} loose pieces taken as one")
        pieces = [mesh]
    parts: list[Part] = []
    counts: Counter[str] = Counter()
    worst: dict[str, float] = {}
    for piece in pieces:
        if (thick := _sheet(piece)) is not None:
            counts["flat"] += 1
            piece = thick
        how, error, own = _convex_parts(path, piece, cuts, may_fill)
        counts[how] += 1
        worst[how] = max(worst.get(how, 0.0), error)
        parts += own
    for how, text in HOW.items():
        if counts[how]:
            within = f", within {worst[how]:.3f} m" if how in worst else ""
            notes.append(f"{path.name}: {counts[how]} of {len(pieces)} pieces {text}{within}")
    return parts


def _convex_parts(
    path: Path, piece: Mesh, cuts: Cuts, may_fill: bool
) -> tuple[str, float, list[Part]]:
    """Return how a piece is taken (a key of `HOW`), the error of its surface, m, and its parts."""
    if is_convex(piece):
        return "convex", 0.0, [_mesh_part(piece)]
    ground = relief_part(piece)
    if ground is not None:
        return "relief", ground[1], [ground[0]]
    size = float(np.ptp(piece.vertices, axis=0).max())
    around = hull(piece.vertices)
    if around is not None:
        error = surface_error(piece, [around])
        if error <= NEAR_HULL or size <= SMALL:
            return "near" if error <= NEAR_HULL else "hull", error, [_mesh_part(around)]
    how = "cells" if len(piece.faces) > MOST_CUT_FACES else "more"
    if how == "more" and cuts.left:
        cuts.left -= 1
        convex, error = decompose(path, piece)
        if error <= MOST_CUT_ERROR:
            return "cut", error, [_mesh_part(one) for one in convex]
        how = "uncut"
    cell = max(CELL, size / MOST_CELLS)
    return how, cell * 3**0.5, cell_parts(path, piece, cell, may_fill)


def cell_parts(path: Path, piece: Mesh, cell: float, may_fill: bool = True) -> list[Part]:
    """Return merged boxes of the cells that a surface passes through, and of those inside of it.

    Args:
        path: File of the mesh, for messages.
        piece: The surface, m.
        cell: Side of a cell, m.
        may_fill: Whether what is inside of a closed surface is solid.

    Raises:
        WorldFileError: They are more than a world may hold.
    """
    low = np.floor(piece.vertices.min(axis=0) / cell).astype(np.int64)
    high = np.floor(piece.vertices.max(axis=0) / cell).astype(np.int64) + 1
    occupied = np.zeros(tuple(high - low), np.bool_)
    a, b, c = (piece.vertices[piece.faces[:, n]] for n in range(3))
    longest = np.max([np.linalg.norm(q - p, axis=1) for p, q in ((a, b), (b, c), (c, a))], axis=0)
    counts = np.ceil(2.0 * longest / cell).astype(int).clip(1)  # two points a cell
    for count in np.unique(counts):
        chosen = np.flatnonzero(counts == count)
        i, j = np.indices((count + 1, count + 1)).reshape(2, -1)
        u, v = (w[i + j <= count] / count for w in (i, j))
        for n in chosen:
            points = a[n] + u[:, None] * (b[n] - a[n]) + v[:, None] * (c[n] - a[n])
            occupied[tuple((np.floor(points / cell).astype(np.int64) - low).T)] = True
    if may_fill and is_closed(piece.faces):
        fill_inside(occupied, piece, low * cell, cell)
    return cell_boxes(path, occupied, cell, vector(low * cell))


def _mesh_part(mesh: Mesh) -> Part:
    return Part("mesh", (), (0.0, 0.0, 0.0), mesh=mesh)


def _sheet(piece: Mesh) -> Mesh | None:
    """Return a flat piece with a thickness, behind the side that its triangles face, else None."""
    middle = piece.vertices.mean(axis=0)
    _, spans, axes = np.linalg.svd(piece.vertices - middle, full_matrices=False)
    if len(spans) == 3 and spans[2] > FLAT * max(spans[0], 1e-300):
        return None
    normal = axes[2] if len(axes) == 3 else np.cross(axes[0], axes[1])
    a, b, c = (piece.vertices[piece.faces[:, n]] for n in range(3))
    faces = piece.faces
    if np.cross(b - a, c - a).sum(axis=0) @ normal < 0.0:
        normal = -normal
    if normal[2] < -0.999:  # a floor seen from below: its upper side stays where it is
        normal, faces = -normal, faces[:, ::-1]
    count = len(piece.vertices)
    vertices = np.concatenate([piece.vertices, piece.vertices - SHEET_THICKNESS * normal])
    rim = _rim(faces)
    sides = [np.column_stack([rim[:, 1], rim[:, 0], rim[:, 0] + count]),
             np.column_stack([rim[:, 1], rim[:, 0] + count, rim[:, 1] + count])]  # fmt: skip
    return Mesh(vertices, np.concatenate([faces, faces[:, ::-1] + count, *sides]))


def _rim(faces: NDArray[np.int64]) -> NDArray[np.int64]:  # (k, 2)
    """Return the directed edges of triangles that no other triangle shares."""
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    keys = np.sort(edges, axis=1)
    _, inverse, counts = np.unique(keys, axis=0, return_inverse=True, return_counts=True)
    return np.asarray(edges[counts[inverse.reshape(-1)] == 1])


def _pieces(faces: NDArray[np.int64], count: int) -> list[NDArray[np.int64]]:
    """Return the triangles (k, 3) of each connected piece."""
    from scipy import sparse
    from scipy.sparse import csgraph

    tails, heads = faces.ravel(), np.roll(faces, 1, axis=1).ravel()
    edges = sparse.csr_matrix((np.ones(len(tails), np.bool_), (tails, heads)), (count, count))
    labels = csgraph.connected_components(edges, directed=False)[1][faces[:, 0]]
    order = np.argsort(labels, kind="stable")
    ends = np.flatnonzero(np.diff(labels[order])) + 1
    return np.split(faces[order], ends)


def _piece(vertices: NDArray[np.float64], faces: NDArray[np.int64]) -> Mesh:
    used, own = np.unique(faces, return_inverse=True)
    return Mesh(vertices[used], own.reshape(-1, 3))
