"""Surfaces of triangles (`.stl`, `.obj`), by trimesh."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse import csgraph

from wayproof.models.world_files.options import Found, ImportOptions
from wayproof.models.world_files.parts import Mesh, Part
from wayproof.models.world_files.reading import WorldFileError, check_file

MOST_FACES = 1_000_000
MOST_BYTES = 64 * 2**20
MOST_PIECES = 2000
ENDINGS = (".stl", ".obj")


def read_mesh(path: Path, options: ImportOptions) -> Found:
    """Read a mesh, in pieces.

    Raises:
        WorldFileError: No trimesh, no mesh, or more triangles than allowed.
    """
    found = Found()
    found.parts = mesh_parts(path, np.full(3, options.scale), found.notes)
    return found


def mesh_parts(path: Path, scale: NDArray[np.float64], notes: list[str]) -> list[Part]:
    """Read the connected pieces of a mesh file, each a part of its own.

    MuJoCo lets beams meet the triangles, but bodies collide with a mesh's convex hull: apart, the
    pieces of a scene do not close the space between them.

    Args:
        path: `.stl` or `.obj`.
        scale: (3,) metres to a unit.
        notes: Notes on pieces that are not convex are appended.

    Raises:
        WorldFileError: As `read_mesh`.
    """
    if path.suffix.lower() not in ENDINGS:
        raise WorldFileError(path, f"a mesh of this format, expected {' or '.join(ENDINGS)}")
    check_file(path, MOST_BYTES)
    _check_count(path)
    vertices, faces = _load(path)
    if not 1 <= len(faces) <= MOST_FACES:
        raise WorldFileError(path, f"{len(faces)} triangles, expected 1 to {MOST_FACES}")
    if faces.min() < 0 or faces.max() >= len(vertices):
        raise WorldFileError(path, "a triangle of a vertex that is not there")
    vertices = vertices * scale
    if np.prod(scale) < 0.0:
        faces = faces[:, ::-1]  # a mirrored surface is inside out
    if not np.isfinite(vertices).all():
        raise WorldFileError(path, "a vertex that is not finite")
    pieces = [_piece(vertices, own) for own in _pieces(faces, len(vertices))]
    if len(pieces) > MOST_PIECES:
        raise WorldFileError(path, f"{len(pieces)} separate pieces, expected at most {MOST_PIECES}")
    hollow = sum(not _is_convex(piece) for piece in pieces)
    if hollow:
        notes.append(f"{path.name}: {hollow} of {len(pieces)} pieces are not convex: beams meet "
                     "their triangles, bodies their convex hull")  # fmt: skip
    return [Part("mesh", (), (0.0, 0.0, 0.0), mesh=piece) for piece in pieces]


def _check_count(path: Path) -> None:
    """Refuse a declared count that is too large before a parser makes arrays of it."""
    data = path.read_bytes()
    if path.suffix.lower() == ".obj":
        count = data.count(b"\nf") + data.count(b"\nv ")
    elif data[:5].lower() == b"solid" and b"facet" in data[:1000]:
        count = data.count(b"facet normal")
    else:
        count = int.from_bytes(data[80:84], "little")
    if count > 2 * MOST_FACES:
        what = f"{count} triangles and vertices, expected at most {2 * MOST_FACES}"
        raise WorldFileError(path, what)


def _load(path: Path) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    try:
        import trimesh
    except ImportError:
        what = "meshes need trimesh: pip install trimesh"
        raise WorldFileError(path, what) from None
    try:
        with path.open("rb") as file:  # not by name: so it looks for no materials
            mesh = trimesh.load_mesh(file, file_type=path.suffix[1:].lower(), process=True)
        vertices = np.array(mesh.vertices, np.float64).reshape(-1, 3)
        return vertices, np.array(mesh.faces, np.int64).reshape(-1, 3)
    except Exception as error:  # whatever a parser of someone else's raises on a broken file
        text = " ".join(str(error).split()) or type(error).__name__
        raise WorldFileError(path, f"no mesh ({text[:100]})") from None


def _pieces(faces: NDArray[np.int64], count: int) -> list[NDArray[np.int64]]:
    """Return the triangles (k, 3) of each connected piece."""
    tails, heads = faces.ravel(), np.roll(faces, 1, axis=1).ravel()
    edges = sparse.csr_matrix((np.ones(len(tails), np.bool_), (tails, heads)), (count, count))
    labels = csgraph.connected_components(edges, directed=False)[1][faces[:, 0]]
    order = np.argsort(labels, kind="stable")
    ends = np.flatnonzero(np.diff(labels[order])) + 1
    return np.split(faces[order], ends)


def _piece(vertices: NDArray[np.float64], faces: NDArray[np.int64]) -> Mesh:
    used, own = np.unique(faces, return_inverse=True)
    return Mesh(vertices[used], own.reshape(-1, 3))


def _is_convex(piece: Mesh) -> bool:
    """Return whether no vertex lies beyond a triangle's plane, but for a share of the size."""
    a, b, c = (piece.vertices[piece.faces[:, n]] for n in range(3))
    normals = np.cross(b - a, c - a)
    lengths = np.linalg.norm(normals, axis=1)
    kept = lengths > 0.0
    normals, a = normals[kept] / lengths[kept, None], a[kept]
    slack = 1e-6 * float(np.ptp(piece.vertices, axis=0).max())
    beyond = [
        float((piece.vertices @ normal).max() - normal @ point)
        for normal, point in zip(normals[:: max(1, len(normals) // 500)],
                                 a[:: max(1, len(normals) // 500)], strict=True)
    ]  # fmt: skip
    return max(beyond, default=0.0) <= slack
