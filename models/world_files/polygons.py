"""Outlines in the plane: convex pieces that fill them, and prisms over these.

Sources: Meisters, "Polygons Have Ears", American Mathematical Monthly 82(6), 1975; of outlines with
holes the trapezoids between the heights of all corners (de Berg et al., "Computational Geometry",
chapter 6).
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

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
    corners = _ring(outline)
    return [_prism(corners[triangle], height) for triangle in triangulate(corners)]


def prisms_with_holes(outlines: Sequence[NDArray[np.float64]], height: float) -> list[Mesh]:
    """Return convex prisms of the space inside an odd number of outlines; as of `prisms`."""
    rings = [_ring(outline) for outline in outlines]
    if (count := sum(map(len, rings))) > MAX_CORNERS:
        raise ValueError(f"got {count} corners, expected at most {MAX_CORNERS}")
    return [_prism(piece, height) for piece in trapezoids(rings)]


def _ring(outline: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the corners of an outline without the repeated first one."""
    corners = outline[:-1] if len(outline) > 1 and (outline[0] == outline[-1]).all() else outline
    if not 3 <= len(corners) <= MAX_CORNERS:
        raise ValueError(f"got {len(corners)} corners, expected 3 to {MAX_CORNERS}")
    return corners


def _prism(corners: NDArray[np.float64], height: float) -> Mesh:
    """Return the prism over a convex piece, counter-clockwise."""
    count = len(corners)
    low = np.column_stack([corners, np.zeros(count)])
    vertices = np.vstack([low, low + np.array([0.0, 0.0, height])])
    faces = []
    for n in range(1, count - 1):
        faces += [(0, n + 1, n), (count, count + n, count + n + 1)]
    for n in range(count):
        m = (n + 1) % count
        faces += [(n, m, count + m), (n, count + m, count + n)]
    return Mesh(vertices, np.array(faces, np.int64))


def trapezoids(rings: Sequence[NDArray[np.float64]]) -> list[NDArray[np.float64]]:
    """Return convex pieces (3 or 4, 2), counter-clockwise, of the area that rings (n, 2) enclose.

    A point is enclosed if an odd number of rings is around it: a ring in another is a hole.

    Raises:
        ValueError: Edges cross each other.
    """
    begins = np.concatenate(rings)
    ends = np.concatenate([np.roll(ring, -1, axis=0) for ring in rings])
    upward = begins[:, 1] < ends[:, 1]
    low = np.where(upward[:, None], begins, ends)
    high = np.where(upward[:, None], ends, begins)
    heights = np.unique(begins[:, 1])
    pieces = []
    for bottom, top in pairwise(heights.tolist()):
        spans = (low[:, 1] <= bottom) & (high[:, 1] >= top)
        lefts = _crossings(low[spans], high[spans], bottom, top)
        if (np.diff(lefts, axis=0) < 0.0).any():
            raise ValueError("outlines that cross, expected each around or beside the others")
        for (a, d), (b, c) in zip(lefts[::2], lefts[1::2], strict=True):
            corners = [(a, bottom), (b, bottom), (c, top), (d, top)]
            piece = list(dict.fromkeys(corners))  # a triangle where two are one
            if len(piece) > 2:
                pieces.append(np.array(piece))
    return pieces


def _crossings(
    low: NDArray[np.float64], high: NDArray[np.float64], bottom: float, top: float
) -> NDArray[np.float64]:  # (n, 2)
    """Return where edges (n, 2) pass two heights, from left to right; at a corner exactly there."""
    rise = (high - low)[:, 1]
    found = []
    for level in (bottom, top):
        passed = low[:, 0] + (level - low[:, 1]) / rise * (high - low)[:, 0]
        found.append(np.where(level == high[:, 1], high[:, 0], passed))
    both = np.column_stack(found)
    return both[np.argsort(both.sum(axis=1), kind="stable")]


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
