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

from wayproof.models.world_files.hulls import hull, surface_error
from wayproof.models.world_files.parts import Mesh
from wayproof.models.world_files.reading import WorldFileError

CONCAVITY = 0.1
"""Depth of a hollow up to which it may be filled, m; CoACD's threshold is relative to the size."""

THRESHOLDS = (0.03, 0.3)
"""Least and greatest threshold, as shares of half the size of the mesh."""

SETTINGS = {
    "preprocess_resolution": 30, "resolution": 1000, "mcts_nodes": 10, "mcts_iterations": 60,
}  # fmt: skip
"""Settings of CoACD: the least effort that it accepts in searching where to cut."""

TIME_LIMIT = 300.0
"""Time for one mesh, s; a mesh that takes longer is refused."""

SEED = 0

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
        what = "a mesh that is not convex needs coacd: pip install coacd (the extra 'imports')"
        raise WorldFileError(path, what)
    half = float(np.ptp(mesh.vertices, axis=0).max()) / 2.0
    threshold = round(float(np.clip(CONCAVITY / half, *THRESHOLDS)), 3)
    pieces = _pieces(path, mesh, threshold)
    return pieces, surface_error(mesh, pieces)


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
