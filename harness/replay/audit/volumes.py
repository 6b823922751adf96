"""Exact distances of committed paths from the volumes of cells.

The planner compares centres of cells: of the cell that contains the centre of the body with those
of cells that are not free. Here the body is at its exact position, and a cell is a square or a
cube.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

from wayproof.harness.judge.body import BESIDE, Discs, track_of
from wayproof.harness.judge.volumes import distance_from_boxes
from wayproof.harness.replay.audit.committed import Committed


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


def measure(committed: Committed) -> Volumes:
    """Measure one path."""
    body, size = committed.body, committed.map.resolution
    discs, slack = swept_as(committed)
    missing = max(shortfall(committed, discs), 0.0)
    bound = body.half_diagonal * size + slack
    return Volumes(
        paths=1,
        short=int(missing > 0.0),
        greatest_m=missing,
        bound_m=bound,
        bare=int(missing > committed.margin),
    )


def swept_as(committed: Committed) -> tuple[Discs, float]:
    """Return the circumscribed disc where it has room, else the discs, and their slack, m."""
    body = committed.body
    if not committed.mission.discs:
        return body.discs, 0.0
    if (
        body.first_overlap(committed.map, committed.poses[:, :3], body.radius + committed.margin)
        is None
    ):
        return body.about, 0.0
    return body.discs, math.sqrt(2.0) * BESIDE


def shortfall(committed: Committed, discs: Discs) -> float:
    """Return by how much some discs come nearer to forbidden cells than radius and margin, m.

    Negative if they keep a greater distance; minus infinity if nothing is near.
    """
    size, found = committed.map.resolution, -math.inf
    for offset, radius in discs:
        track, kept = track_of(committed.poses, offset), radius + committed.margin
        # A point is at most half a diagonal from the centre of its cell, in both cells; between two
        # sampled points a path may cut a corner of a cell.
        reach = kept / size + 2.0 * committed.body.half_diagonal + 1.0
        cells = committed.body.cells(committed.map, track, reach * size)
        low = (
            cells.near(cells.touched(track), committed.body.wrong(cells), reach) * size
            + cells.corner
        )
        found = max(found, kept - distance_from_boxes(track[:, : cells.axes], low, low + size))
    return found
