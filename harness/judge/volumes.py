"""Exact distances of a track from the volumes of cells: squares on the ground, cubes in the air."""

from __future__ import annotations

import itertools
import math

import numpy as np

from wayproof.harness.log.paths import Array


def distance_from_boxes(path: Array, low: Array, high: Array) -> float:
    """Return the least distance of a path (n, k) from boxes with corners (m, k), m; inf without."""
    least = math.inf
    for a, b in itertools.pairwise(path) if len(path) > 1 else [(path[0], path[0])]:
        half = 0.5 * math.dist(a, b)
        near = box_distances(0.5 * (a + b), low, high) < least + half
        if near.any():
            least = min(least, segment_from_boxes(a, b, low[near], high[near]))
    return least


def segment_from_boxes(a: Array, b: Array, low: Array, high: Array) -> float:
    """Return the least distance of the segment between two points (k,) from boxes (m, k), m.

    The squared distance from a box is a parabola between the points where the segment crosses the
    planes of its faces, so its least value lies at a vertex or at such a point.
    """
    along = b - a
    with np.errstate(divide="ignore", invalid="ignore"):
        crossings = np.concatenate(((low - a) / along, (high - a) / along), axis=1)  # (m, 2 k)
    crossings = np.where(np.isfinite(crossings), np.clip(crossings, 0.0, 1.0), 0.0)
    ends = np.broadcast_to([0.0, 1.0], (len(low), 2))
    times = np.sort(np.concatenate((crossings, ends), axis=1), axis=1)  # (m, t)
    middles = 0.5 * (times[:, 1:] + times[:, :-1])  # (m, t - 1)
    excess = _excess(a + middles[..., None] * along, low[:, None], high[:, None])
    slope = (excess * along).sum(axis=-1)
    curvature = np.where(excess != 0.0, along * along, 0.0).sum(axis=-1)
    vertex = middles - np.divide(slope, curvature, out=np.zeros_like(slope), where=curvature > 0.0)
    vertex = np.clip(vertex, times[:, :-1], times[:, 1:])
    excess = _excess(a + vertex[..., None] * along, low[:, None], high[:, None])
    return math.sqrt(float((excess * excess).sum(axis=-1).min()))


def box_distances(point: Array, low: Array, high: Array) -> Array:
    """Return the distances (m,), m, of a point (k,) from boxes (m, k)."""
    excess = _excess(point, low, high)
    outside: Array = np.sqrt((excess * excess).sum(axis=-1))
    return outside


def _excess(points: Array, low: Array, high: Array) -> Array:
    """Return by axis how far points are beyond boxes; negative below, 0 between the faces."""
    beyond: Array = np.minimum(points - low, 0.0) + np.maximum(points - high, 0.0)
    return beyond
