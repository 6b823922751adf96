"""Writers of points: PCD (Point Cloud Library) and PLY, both binary."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from wayproof.harness.outputs import written_whole


def write_pcd(points: NDArray[np.float64], path: Path) -> int:
    """Write points (n, 3), m, as PCD 0.7 of float32; return their number."""
    head = (
        "# .PCD v0.7 - Point Cloud Data file format\nVERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\n"
        f"TYPE F F F\nCOUNT 1 1 1\nWIDTH {len(points)}\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\n"
        f"POINTS {len(points)}\nDATA binary\n"
    )
    return _write(head, points, path)


def write_ply(points: NDArray[np.float64], path: Path) -> int:
    """Write points (n, 3), m, as PLY 1.0 of float32; return their number."""
    head = (
        f"ply\nformat binary_little_endian 1.0\nelement vertex {len(points)}\n"
        "property float x\nproperty float y\nproperty float z\nend_header\n"
    )
    return _write(head, points, path)


def _write(head: str, points: NDArray[np.float64], path: Path) -> int:
    with written_whole(path, "--map") as partial:
        partial.write_bytes(head.encode() + points.astype("<f4").tobytes())
    return len(points)
