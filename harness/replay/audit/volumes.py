"""Exact distances of committed paths from the volumes of cells.

The planner compares centres of cells: of the cell that contains the centre of the body with those
of cells that are not free. Here the body is at its exact position, and a cell is a square or a
cube.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from wayproof.harness.log.paths import Array
from wayproof.harness.replay.audit.body import BESIDE, Discs, track_of
from wayproof.harness.replay.audit.moment import Moment


@dataclass(frozen=True)
class Volumes:
    """Distances of committed paths from the volumes of cells that the body may not overlap.

    Attributes:
        paths: Number of measured paths, those without a violation.
        short: Number of these that come nearer than the radius of the body plus the margin.
        greatest_m: Greatest shortfall, m; 0 without one.
        bound_m: Bound of the shortfall, half a diagonal of a cell, m.
        bare: Number of paths that come nearer than the radius of the body alone.
    """

    paths: int = 0
    short: int = 0
    greatest_m: float = 0.0
    bound_m: float = 0.0
    bare: int = 0


def together(parts: Iterable[Volumes]) -> Volumes:
    """Combine the measurements of several logs."""
    parts = list(parts)
    return Volumes(
        paths=sum(one.paths for one in parts),
        short=sum(one.short for one in parts),
        greatest_m=max((one.greatest_m for one in parts), default=0.0),
        bound_m=max((one.bound_m for one in parts), default=0.0),
        bare=sum(one.bare for one in parts),
    )


def measure(moment: Moment) -> Volumes:
    """Measure one path."""
    body, size = moment.body, moment.map.resolution
    discs, slack = swept_as(moment)
    missing = max(shortfall(moment, discs), 0.0)
    bound = body.half_diagonal * size + slack
    return Volumes(
        paths=1,
        short=int(missing > 0.0),
        greatest_m=missing,
        bound_m=bound,
        bare=int(missing > moment.margin),
    )


def swept_as(moment: Moment) -> tuple[Discs, float]:
    """Return the circumscribed disc where it has room, else the discs, and their slack, m."""
    body = moment.body
    if not moment.mission.discs:
        return body.discs, 0.0
    ((_, radius),) = body.about
    if body.first_overlap(moment.map, moment.poses[:, :3], radius + moment.margin) is None:
        return body.about, 0.0
    return body.discs, math.sqrt(2.0) * BESIDE


def shortfall(moment: Moment, discs: Discs) -> float:
    """Return by how much some discs come nearer to forbidden cells than radius and margin, m.

    Negative if they keep a greater distance; minus infinity if nothing is near.
    """
    size, found = moment.map.resolution, -math.inf
    for offset, radius in discs:
        track, kept = track_of(moment.poses, offset), radius + moment.margin
        # A point is at most half a diagonal from the centre of its cell, in both cells; between two
        # sampled points a path may cut a corner of a cell.
        reach = kept / size + 2.0 * moment.body.half_diagonal + 1.0
        cells = moment.body.cells(moment.map, track, reach * size)
        wrong = cells.not_free if moment.body.policy == "forbid" else cells.occupied
        low = cells.near(cells.touched(track), wrong, reach) * size + cells.corner
        found = max(found, kept - distance_from_boxes(track[:, : cells.axes], low, low + size))
    return found


def distance_from_boxes(path: Array, low: Array, high: Array) -> float:
    """Return the least distance of a path (n, k) from boxes with corners (m, k), m; inf without."""
    least = math.inf
    for a, b in itertools.pairwise(path) if len(path) > 1 else [(path[0], path[0])]:
        half = 0.5 * math.dist(a, b)
        near = _box_distances(0.5 * (a + b), low, high) < least + half
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


def _box_distances(point: Array, low: Array, high: Array) -> Array:
    """Return the distances (m,), m, of a point (k,) from boxes (m, k)."""
    excess = _excess(point, low, high)
    outside: Array = np.sqrt((excess * excess).sum(axis=-1))
    return outside


def _excess(points: Array, low: Array, high: Array) -> Array:
    """Return by axis how far points are beyond boxes; negative below, 0 between the faces."""
    beyond: Array = np.minimum(points - low, 0.0) + np.maximum(points - high, 0.0)
    return beyond
