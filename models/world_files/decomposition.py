"""Convex decomposition of meshes for contact, by CoACD, kept in the user's cache.

Source: Wei et al., "Approximate Convex Decomposition for 3D Meshes with Collision-Aware Concavity
and Tree Search", ACM Transactions on Graphics 41(4), 2022.
"""

from __future__ import annotations

import hashlib
import importlib.metadata
import importlib.util
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, QhullError, cKDTree

from wayproof.models.world_files.parts import Mesh
from wayproof.models.world_files.reading import WorldFileError
from wayproof.models.worlds.solids.triangles import distance_to_triangles

CONCAVITY = 0.1
"""Depth of a hollow up to which it may be filled, m; CoACD's threshold is relative to the size."""

THRESHOLDS = (0.03, 0.3)
"""Least and greatest threshold, as shares of half the size of the mesh."""

SETTINGS = {
    "preprocess_resolution": 30, "resolution": 1000, "mcts_nodes": 10, "mcts_iterations": 60,
}  # fmt: skip
"""Settings of CoACD: the least effort that it accepts in searching where to cut."""

TIME_LIMIT = 300.0
"""Time for one mesh, s; what takes longer is refused."""

SEED = 0

MAX_SAMPLES = 20_000
"""Number of points on a mesh at which the error is measured, about."""

PIECE_SAMPLES = 500
"""Number of points on a piece at which it is measured, about."""

MAX_EXACT_FACES = 1500
"""Triangles of a mesh up to which distances to all of them are measured."""

NEAREST = 8
"""Number of points on a mesh whose triangles a piece's vertex is measured against."""

_WORKER = """
import sys
import coacd
import numpy as np
coacd.set_log_level("error")
source, target, threshold, seed, *settings = sys.argv[1:]
given = np.load(source)
mesh = coacd.Mesh(given["vertices"], given["faces"])
more = dict(zip(settings[::2], map(int, settings[1::2])))
pieces = coacd.run_coacd(mesh, threshold=float(threshold), seed=int(seed), **more)
arrays = {f"v{n}": piece[0] for n, piece in enumerate(pieces)}
np.savez(target, **arrays)
"""
# A process of its own: the library prints, cannot be interrupted, and may end the process on a
# broken mesh.


def decompose(path: Path, mesh: Mesh) -> tuple[list[Mesh], float]:
    """Cut a mesh into convex pieces.

    The result depends on the mesh, the threshold, the seed and CoACD's version only; it is read
    from the cache where it was computed before.

    Args:
        path: File of the mesh, for messages.
        mesh: Any surface, in metres.

    Returns:
        Convex pieces, and the greatest distance between their surface and the mesh's, m.

    Raises:
        WorldFileError: CoACD is not installed, takes too long, or fails.
    """
    if importlib.util.find_spec("coacd") is None:
        what = "a mesh that is not convex needs coacd: pip install 'wayproof[imports]'"
        raise WorldFileError(path, what)
    half = float(np.ptp(mesh.vertices, axis=0).max()) / 2.0
    threshold = round(float(np.clip(CONCAVITY / half, *THRESHOLDS)), 3)
    pieces = _pieces(path, mesh, threshold)
    return pieces, surface_error(mesh, pieces)


def hull(points: NDArray[np.float64]) -> Mesh | None:
    """Return the convex hull of points (n, 3); None where they lie in a plane."""
    try:
        found = ConvexHull(points)
    except (QhullError, ValueError):
        return None
    inner = points[found.vertices].mean(axis=0)
    a, b, c = (points[found.simplices[:, n]] for n in range(3))
    outward = np.einsum("ij,ij->i", np.cross(b - a, c - a), a - inner) > 0.0
    faces = np.where(outward[:, None], found.simplices, found.simplices[:, ::-1])
    used, own = np.unique(faces, return_inverse=True)
    return Mesh(points[used], own.reshape(-1, 3).astype(np.int64))


def cache_folder() -> Path:
    """Return the folder in which decompositions are kept."""
    base = os.environ.get("XDG_CACHE_HOME") or str(Path.home() / ".cache")
    return Path(base) / "wayproof" / "convex"


def _pieces(path: Path, mesh: Mesh, threshold: float) -> list[Mesh]:
    version = importlib.metadata.version("coacd")
    digest = hashlib.sha256(f"{version} {threshold} {SEED} {SETTINGS}".encode())
    digest.update(np.ascontiguousarray(mesh.vertices).tobytes())
    digest.update(np.ascontiguousarray(mesh.faces).tobytes())
    kept = cache_folder() / f"{digest.hexdigest()[:32]}.npz"
    arrays = _read(kept)
    if not arrays:
        arrays = _run(path, mesh, threshold, kept)
    pieces = [piece for points in arrays if (piece := hull(points)) is not None]
    if not pieces:
        raise WorldFileError(path, "no convex piece found in a mesh")
    return pieces


def _read(kept: Path) -> list[NDArray[np.float64]]:
    try:
        with np.load(kept, allow_pickle=False) as arrays:
            return [np.asarray(arrays[f"v{n}"], np.float64) for n in range(len(arrays.files))]
    except Exception:  # not there, or the rest of an interrupted write: computed again
        return []


def _run(path: Path, mesh: Mesh, threshold: float, kept: Path) -> list[NDArray[np.float64]]:
    kept.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=kept.parent) as folder:
        source, target = Path(folder) / "in.npz", Path(folder) / "out.npz"
        np.savez(source, vertices=mesh.vertices, faces=mesh.faces.astype(np.int32))
        more = [str(word) for pair in SETTINGS.items() for word in pair]
        command = [sys.executable, "-c", _WORKER, str(source), str(target)]
        try:
            done = subprocess.run(
                [*command, str(threshold), str(SEED), *more],
                capture_output=True,
                timeout=TIME_LIMIT,
                check=False,
            )
        except subprocess.TimeoutExpired:
            what = f"{len(mesh.faces)} triangles take more than {TIME_LIMIT:g} s to cut into "
            raise WorldFileError(path, what + "convex pieces; expected a simpler mesh") from None
        arrays = _read(target)
        if done.returncode or not arrays:
            text = " ".join(done.stderr.decode(errors="replace").split())[-100:]
            raise WorldFileError(path, f"no convex decomposition ({text})")
        target.replace(kept)
    return arrays


def surface_error(mesh: Mesh, pieces: list[Mesh]) -> float:
    """Return the greatest distance between a mesh's surface and that of its pieces' union, m.

    Measured at points spread over the mesh: how far outside of every piece they lie; and at points
    on pieces that lie in no other piece: how far from the mesh they are.
    """
    on_mesh, triangle = _samples(mesh)
    planes = [_planes(piece) for piece in pieces]
    missing = float(np.maximum(_outside(on_mesh, planes), 0.0).max())
    tree = cKDTree(on_mesh)
    size = float(np.ptp(mesh.vertices, axis=0).max())
    extra = 0.0
    for n, piece in enumerate(pieces):
        points = _samples(piece, PIECE_SAMPLES)[0]
        others = planes[:n] + planes[n + 1 :]
        if others:
            points = points[_outside(points, others) > 1e-3 * size]
        if not len(points):
            continue
        if len(mesh.faces) <= MAX_EXACT_FACES:
            gaps = distance_to_triangles(points, mesh.vertices[mesh.faces])
        else:
            near = tree.query(points, k=min(NEAREST, len(on_mesh)))[1]
            gaps = _to_triangles(points, mesh, triangle[near.reshape(len(points), -1)])
        extra = max(extra, float(gaps.max()))
    return max(missing, extra)


def _to_triangles(
    points: NDArray[np.float64], mesh: Mesh, near: NDArray[np.int64]
) -> NDArray[np.float64]:  # (n,)
    """Return the distance of each point (n, 3) to the nearest of its triangles (n, k), m."""
    from trimesh.triangles import closest_point

    triangles = mesh.vertices[mesh.faces[near.ravel()]]
    repeated = np.repeat(points, near.shape[1], axis=0)
    nearest = closest_point(triangles, repeated)  # type: ignore[no-untyped-call]  # of trimesh
    gaps = np.linalg.norm(nearest - repeated, axis=1)
    return np.asarray(np.nan_to_num(gaps, nan=np.inf).reshape(near.shape).min(axis=1))


def _samples(
    mesh: Mesh, number: int = MAX_SAMPLES
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Return points (n, 3) spread over the triangles by their areas, and the triangle of each."""
    a, b, c = (mesh.vertices[mesh.faces[:, n]] for n in range(3))
    areas = np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2.0
    share = areas / max(float(areas.sum()), 1e-300)
    counts = np.ceil(np.sqrt(2.0 * share * number)).astype(int).clip(1)
    points, triangles = [], []
    for count in np.unique(counts):
        chosen = np.flatnonzero(counts == count)
        i, j = np.indices((count + 1, count + 1)).reshape(2, -1)
        u, v = (w[i + j <= count] / count for w in (i, j))
        at = a[chosen][:, None] + u[:, None] * (b - a)[chosen][:, None]
        points.append((at + v[:, None] * (c - a)[chosen][:, None]).reshape(-1, 3))
        triangles.append(np.repeat(chosen, len(u)))
    return np.concatenate(points), np.concatenate(triangles)


def _planes(piece: Mesh) -> NDArray[np.float64]:  # (m, 4)
    """Return the outward unit normal and offset of each face of a convex piece."""
    return np.unique(np.asarray(ConvexHull(piece.vertices).equations), axis=0)


def _outside(
    points: NDArray[np.float64], planes: list[NDArray[np.float64]]
) -> NDArray[np.float64]:  # (n,)
    """Return how far points lie outside of the nearest piece, at least, m; below 0 inside."""
    least = np.full(len(points), np.inf)
    for piece in planes:
        beyond = np.full(len(points), -np.inf)
        for plane in piece:
            np.maximum(beyond, points @ plane[:3] + plane[3], out=beyond)
        np.minimum(least, beyond, out=least)
    return least
