"""Meshes as convex parts: beams and bodies meet one shape.

MuJoCo lets beams meet a mesh's triangles and bodies its convex hull. So a mesh is taken in
connected pieces, each as its hull where it is close to that, a height field, prisms, or boxes.
"""

from __future__ import annotations

from collections import Counter
from math import ceil
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from wayproof.models.world_files.cells import cell_boxes, cells_of_points
from wayproof.models.world_files.heights import height_part
from wayproof.models.world_files.hulls import cut_extruded, distance_to_hull, hull, surface_points
from wayproof.models.world_files.mesh_files import MOST_FACES, cloud_points, load_mesh_file
from wayproof.models.world_files.options import Found, ImportOptions
from wayproof.models.world_files.parts import Mesh, Part, vector
from wayproof.models.world_files.reading import WorldFileError

MOST_AWAY = 1e9
"""Distance of a vertex from its origin beyond which no area is a number to compute with, m."""

MOST_PIECES = 2000
"""Number of connected pieces of a mesh up to which each is taken by itself."""

SHEET_THICKNESS = 0.01
"""Thickness that a flat piece is given, which no body could touch without, m."""

SMALL = 0.6
"""Size up to which a piece is taken as its convex hull, m: no robot fits into its hollows."""

CELL = 0.05
"""Side of the cells that other pieces are taken as, m, and the distance from its hull up to which
a piece is taken as that."""

MOST_CELLS = 400
"""Number of cells along a piece; those of a longer one are larger."""

HOW = {
    "flat": f"were flat: made {SHEET_THICKNESS * 1e3:g} mm thick",
    "relief": "taken as height fields",
    "near": "taken as their convex hull",
    "cut": "not convex: cut into prisms",
    "cells": "not convex: taken as boxes of cells",
}
"""Ways to take a piece that is not convex as it is, and their text in a note."""

FLAT = 1e-6
"""Thickness below which a piece is flat, as a share of its size."""

MOST_CUT = 4000
"""Number of triangles up to which a piece is looked at as a prism."""

LEAST_HOLLOW = 8
"""Number of cells from which a hollow is looked at."""

LEAST_GROUND = 4.0
"""Width in x and y from which a mesh may be ground, m."""

MAX_NODES = 700
"""Number of heights along a side of ground; more make a world file of many MiB."""

LEAST_COVER = 0.995
"""Share of the bounding rectangle that ground has to cover: a height field has no holes."""

INSET = 1e-9
"""Share of the width by which the outermost nodes lie within the ground, not beside it."""

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


def mesh_parts(
    path: Path,
    scale: NDArray[np.float64],
    notes: list[str],
    *,
    submesh: str | None = None,
    centred: bool = False,
    upright: bool = False,
) -> list[Part]:
    """Read a mesh file as convex parts.

    Args:
        path: A file of one of `mesh_files.READERS`.
        scale: (3,) factors along the file's axes; its own unit is metres already.
        notes: Notes on pieces that were changed are appended.
        submesh: Name of the node to take alone.
        centred: Whether that node is moved to the origin by the middle of its bounds.
        upright: Whether the file's up axis is turned to z; Gazebo does not.

    Raises:
        WorldFileError: Of `load_mesh_file`; no such node; no triangle; too many boxes; a vertex
            beyond `MOST_AWAY`.
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
    with np.errstate(over="ignore"):  # what is too far away is refused
        vertices = vertices * scale
    if not (reach := float(np.abs(vertices).max())) <= MOST_AWAY:
        raise WorldFileError(path, f"a vertex {reach:g} m away, expected up to {MOST_AWAY:g} m")
    faces = mesh.faces[:, ::-1] if np.prod(scale) < 0.0 else mesh.faces  # mirrored: inside out
    if upright and loaded.up in TURNS:
        vertices = vertices @ TURNS[loaded.up].T
        notes.append(f"{path.name}: its {loaded.up} axis is up, turned to z")
    return _parts(path, Mesh(vertices, faces), notes, may_fill=not doubled)


def _joined(
    path: Path, surfaces: list[tuple[NDArray[np.float64], NDArray[np.int64]]]
) -> tuple[Mesh, bool]:
    """Join surfaces, with one vertex for all at the same place: files repeat them for normals.

    Returns:
        The mesh, and whether triangles are drawn more than once, as from both sides: then which way
        they face says nothing.
    """
    offsets = np.cumsum([0, *(len(vertices) for vertices, _ in surfaces)])
    faces = [own + at for (_, own), at in zip(surfaces, offsets[:-1], strict=True)]
    if not 0 < sum(map(len, faces)) <= MOST_FACES:
        what = f"{sum(map(len, faces))} triangles, expected 1 to {MOST_FACES}"
        raise WorldFileError(path, what)
    all_faces, vertices = np.concatenate(faces), np.concatenate([own for own, _ in surfaces])
    size = max(float(np.ptp(vertices[np.unique(all_faces)], axis=0).max()), 1e-12)
    keys = np.rint((vertices - vertices.min(axis=0)) / (1e-7 * size)).astype(np.int64)
    _, first, inverse = np.unique(keys, axis=0, return_index=True, return_inverse=True)
    all_faces = inverse.reshape(-1)[all_faces]
    kept = all_faces[(all_faces != np.roll(all_faces, 1, axis=1)).all(axis=1)]
    if not len(kept):
        raise WorldFileError(path, "no triangle with an area")
    once = np.unique(np.sort(kept, axis=1), axis=0, return_index=True)[1]
    return Mesh(vertices[first], kept[np.sort(once)]), len(once) < len(kept)  # first of each


def _parts(path: Path, mesh: Mesh, notes: list[str], *, may_fill: bool) -> list[Part]:
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
        how, error, own = _piece_parts(path, piece, may_fill)
        counts[how] += 1
        worst[how] = max(worst.get(how, 0.0), error)
        parts += own
    for how, text in HOW.items():
        if counts[how]:
            within = f", within {worst[how]:.3f} m" if how in worst else ""
            notes.append(f"{path.name}: {counts[how]} of {len(pieces)} pieces {text}{within}")
    return parts


def _piece_parts(path: Path, piece: Mesh, may_fill: bool) -> tuple[str, float, list[Part]]:
    """Return how a piece is taken (a key of `HOW`), the error of its surface, m, and its parts."""
    around = hull(piece.vertices)
    error = np.inf if around is None else distance_to_hull(piece, around)
    if error > 0.0 and (ground := _relief(path, piece)) is not None:
        return "relief", ground[1], [ground[0]]
    size = float(np.ptp(piece.vertices, axis=0).max())
    cell = max(CELL, size / MOST_CELLS)
    if around is not None and (error <= cell or size <= SMALL):
        part = Part("mesh", (), (0.0, 0.0, 0.0), mesh=around)
        return "near" if error else "convex", error, [part]
    if len(piece.faces) <= MOST_CUT and (prisms := cut_extruded(piece)):
        return "cut", 0.0, [Part("mesh", (), (0.0, 0.0, 0.0), mesh=one) for one in prisms]
    return "cells", cell * 3**0.5, cell_parts(path, piece, cell, may_fill)


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
    # What lies on a border between cells is in one of them, whatever its last bits are.
    cells = np.floor(surface_points(piece, cell / 2.0) / cell + 1e-6).astype(np.int64)
    low = cells.min(axis=0)
    occupied = np.zeros(tuple(cells.max(axis=0) - low + 1), np.bool_)
    occupied[tuple((cells - low).T)] = True
    if may_fill and is_closed(piece.faces):
        _fill_inside(occupied, piece, low * cell, cell)
    return cell_boxes(path, occupied, cell, vector(low * cell))


def is_closed(faces: NDArray[np.int64]) -> bool:
    """Return whether each edge of triangles (m, 3) is run once in each direction."""
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    ahead, back = (np.unique(run, axis=0) for run in (edges, edges[:, ::-1]))
    return len(ahead) == len(edges) and np.array_equal(ahead, back)


def _fill_inside(
    occupied: NDArray[np.bool_], mesh: Mesh, low: NDArray[np.float64], cell: float
) -> None:
    """Occupy the hollows of a grid that lie inside of a closed mesh.

    A hollow is a connected part of the free cells that does not reach the border of the grid. One
    that the triangles face, such as a room with its door shut, stays free.
    """
    from scipy import ndimage

    labels, count = ndimage.label(~occupied)
    sizes = np.bincount(labels.ravel(), minlength=count + 1)
    sizes[0] = 0
    for axis in range(3):
        for side in (0, -1):
            sizes[labels.take(side, axis)] = 0  # it reaches the border
    for label in np.flatnonzero(sizes >= LEAST_HOLLOW).tolist():
        places = np.argwhere(labels == label)
        middle = low + (places[len(places) // 2] + 0.5) * cell
        if winding_number(mesh, middle) > 0.5:
            occupied |= labels == label


def winding_number(mesh: Mesh, point: NDArray[np.float64]) -> float:
    """Return how often a surface winds around a point (3,): 1 within one that is closed, else 0.

    Source: the solid angle of a triangle by Van Oosterom and Strackee (1983), "The Solid Angle of a
    Plane Triangle", IEEE Transactions on Biomedical Engineering 30(2).
    """
    a, b, c = (mesh.vertices[mesh.faces[:, k]] - point for k in range(3))
    la, lb, lc = (np.linalg.norm(v, axis=1) for v in (a, b, c))
    below = la * lb * lc + (a * b).sum(axis=1) * lc
    below += (b * c).sum(axis=1) * la + (c * a).sum(axis=1) * lb
    volume = (a * np.cross(b, c)).sum(axis=1)
    return float(np.arctan2(volume, below).sum()) / (2.0 * np.pi)


def _relief(path: Path, mesh: Mesh) -> tuple[Part, float] | None:
    """Return a mesh of ground as a height field, and its greatest error in height, m.

    None where the mesh is no ground: all triangles face up, or all down, they cover a rectangle,
    and none covers another.
    """
    low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    width = high - low
    a, b, c = (mesh.vertices[mesh.faces[:, n]] for n in range(3))
    areas = np.cross(b - a, c - a)[:, 2] / 2.0  # signed, seen from above
    if width[:2].min() < LEAST_GROUND or areas.min() < 0.0 < areas.max():
        return None
    covered = float(np.abs(areas).sum()) / float(width[0] * width[1])
    if not LEAST_COVER <= covered <= 1.0 + 1e-6:
        return None
    from matplotlib.tri import LinearTriInterpolator, Triangulation  # slow to load
    from scipy.interpolate import RegularGridInterpolator

    edge = float(np.sqrt(2.0 * np.median(np.abs(areas[areas != 0.0]))))
    axes = [
        np.linspace(low[n] + INSET * width[n], high[n] - INSET * width[n],
                    int(np.clip(ceil(width[n] / max(edge, 1e-9)) + 1, 2, MAX_NODES)))
        for n in range(2)
    ]  # fmt: skip
    x, y, z = mesh.vertices.T
    try:
        surface = LinearTriInterpolator(Triangulation(x, y, mesh.faces), z)
        heights = np.ma.filled(surface(*np.meshgrid(*axes)), np.nan)
    except (RuntimeError, ValueError):  # such as of steps, whose sides no place lies in
        return None
    if np.isnan(heights).any() or not np.ptp(heights) > 0.0:
        return None
    field = RegularGridInterpolator(axes[::-1], heights, bounds_error=False, fill_value=None)
    error = float(np.abs(field(mesh.vertices[:, [1, 0]]) - z).max())
    middle = (*((low + high) / 2.0)[:2].tolist(), 0.0)
    return height_part(path, heights, (float(width[0]), float(width[1])), middle), error


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
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    _, inverse, counts = np.unique(
        np.sort(edges, axis=1), axis=0, return_inverse=True, return_counts=True
    )
    rim = edges[counts[inverse.reshape(-1)] == 1]  # that no other triangle shares
    sides = [np.column_stack([rim[:, 1], rim[:, 0], rim[:, 0] + count]),
             np.column_stack([rim[:, 1], rim[:, 0] + count, rim[:, 1] + count])]  # fmt: skip
    return Mesh(vertices, np.concatenate([faces, faces[:, ::-1] + count, *sides]))


def _pieces(faces: NDArray[np.int64], count: int) -> list[NDArray[np.int64]]:
    """Return the triangles (k, 3) of each connected piece."""
    from scipy import sparse
    from scipy.sparse import csgraph

    tails, heads = faces.ravel(), np.roll(faces, 1, axis=1).ravel()
    edges = sparse.csr_matrix((np.ones(len(tails), np.bool_), (tails, heads)), (count, count))
    labels = csgraph.connected_components(edges, directed=False)[1][faces[:, 0]]
    order = np.argsort(labels, kind="stable")
    return np.split(faces[order], np.flatnonzero(np.diff(labels[order])) + 1)


def _piece(vertices: NDArray[np.float64], faces: NDArray[np.int64]) -> Mesh:
    used, own = np.unique(faces, return_inverse=True)
    return Mesh(vertices[used], own.reshape(-1, 3))
