"""Outlines in the plane: triangulation by ear clipping, and prisms over them.

Source: Meisters, "Polygons Have Ears", American Mathematical Monthly 82(6), 1975.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wayproof.models.world_files.parts import Mesh

MAX_CORNERS = 2000


def prisms(outline: NDArray[np.float64], height: float) -> list[Mesh]:
    """Return convex prisms from z = 0 to a height that fill an outline exactly.

    Args:
        outline: (n, 2) corners in order, m; the last may repeat the first.
        height: m.

    Raises:
        ValueError: Fewer than three corners, too many, or an outline that crosses itself.
    """
    corners = outline[:-1] if len(outline) > 1 and (outline[0] == outline[-1]).all() else outline
    if not 3 <= len(corners) <= MAX_CORNERS:
        raise ValueError(f"got {len(corners)} corners, expected 3 to {MAX_CORNERS}")
    found = []
    for triangle in triangulate(corners):
        low = np.column_stack([corners[triangle], np.zeros(3)])
        vertices = np.vstack([low, low + np.array([0.0, 0.0, height])])
        faces = [(0, 2, 1), (3, 4, 5), (0, 1, 4), (0, 4, 3), (1, 2, 5), (1, 5, 4), (2, 0, 3),
                 (2, 3, 5)]  # fmt: skip
        found.append(Mesh(vertices, np.array(faces, np.int64)))
    return found


def triangulate(corners: NDArray[np.float64]) -> list[list[int]]:
    """Return triangles of an outline's corners (n, 2), counter-clockwise, that fill it.

    Raises:
        ValueError: The outline crosses itself.
    """
    left = list(range(len(corners)))
    if _doubled_area(corners) < 0.0:
        left.reverse()
    triangles = []
    while len(left) > 2:
        for n in range(len(left)):
            ear = [left[n - 1], left[n], left[(n + 1) % len(left)]]
            turn = _turn(*corners[ear])
            if turn < 0.0 or (turn > 0.0 and not _is_empty(corners, ear, left)):
                continue
            if turn > 0.0:
                triangles.append(ear)
            del left[n]  # a corner on a straight line as well, without a triangle
            break
        else:
            raise ValueError("an outline that crosses itself, expected a simple one")
    return triangles


def holds(outline: NDArray[np.float64], point: NDArray[np.float64]) -> bool:
    """Return whether a point (2,) lies within an outline (n, 2), by parity of crossings."""
    a, b = outline, np.roll(outline, -1, axis=0)
    spans = (a[:, 1] > point[1]) != (b[:, 1] > point[1])
    rise = np.where(spans, b[:, 1] - a[:, 1], 1.0)
    crossing = a[:, 0] + (point[1] - a[:, 1]) / rise * (b[:, 0] - a[:, 0])
    return bool((spans & (crossing > point[0])).sum() % 2)


def _is_empty(corners: NDArray[np.float64], ear: list[int], left: list[int]) -> bool:
    """Return whether no other corner lies in a triangle."""
    a, b, c = corners[ear]
    others = corners[[n for n in left if n not in ear]]
    others = others[~(others[:, None] == corners[ear][None]).all(axis=2).any(axis=1)]
    inside = np.ones(len(others), np.bool_)
    for p, q in ((a, b), (b, c), (c, a)):
        side = (q[0] - p[0]) * (others[:, 1] - p[1]) - (q[1] - p[1]) * (others[:, 0] - p[0])
        inside &= side >= 0.0
    return not inside.any()


def _turn(a: NDArray[np.float64], b: NDArray[np.float64], c: NDArray[np.float64]) -> float:
    return float((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]))


def _doubled_area(corners: NDArray[np.float64]) -> float:
    x, y = corners.T
    return float((x * np.roll(y, -1) - np.roll(x, -1) * y).sum())
