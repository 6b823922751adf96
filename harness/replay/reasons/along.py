"""Points, lengths and directions along the thinned paths of a log."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from wayproof.harness.geometry import atan2_rounded
from wayproof.harness.log.paths import Array, arc_lengths, densely, length
from wayproof.harness.replay.reasons.scene import Scene
from wayproof.harness.schema import wayproof_pb2 as pb

NEAR = 1e-3
"""Tolerance of figures computed in two ways, m, s and rad."""

ARC, ARC_SHARE = 0.15, 0.05
"""Tolerance of a length along a thinned path: m, and a fraction of the length."""

CORNER = 0.6
"""Distance before and behind a corner within which its turn is measured, m."""


def same(name: str, claimed: float, found: float, within: float = NEAR) -> Iterator[str]:
    """Yield a text unless two figures are equal within a tolerance."""
    if not abs(claimed - found) <= within:
        yield f"{name} is {claimed:.3f}, found {found:.3f}"


def same_arc(name: str, claimed: float, found: float) -> Iterator[str]:
    """Yield a text unless two lengths along a thinned path are equal within its tolerance."""
    yield from same(name, claimed, found, ARC + ARC_SHARE * abs(claimed))


def point_of(point: pb.Point) -> Array:
    """Return a logged point as an array (3,), m."""
    return np.array([point.x, point.y, point.z])


def nearest(way: Array, place: Array, scene: Scene) -> tuple[float, float]:
    """Return the arc length of the point of a path nearest to a place, and its distance, m."""
    points = densely(way, 0.01)
    gaps = np.linalg.norm((points - place)[:, : scene.axes], axis=1)
    nearest = int(gaps.argmin())
    return float(arc_lengths(points)[nearest]), float(gaps[nearest])


def left_of(way: Array, place: Array) -> float:
    """Return the length of a path from the point nearest to a place in the plane to its end, m."""
    points = densely(way, 0.01)
    nearest = int(np.linalg.norm((points - place)[:, :2], axis=1).argmin())
    return length(points) - float(arc_lengths(points)[nearest])


def directions_near(way: Array, arc: float, within: float) -> list[float]:
    """Return the headings of the segments of a path within a distance of an arc length, rad."""
    arcs, steps = arc_lengths(way), np.diff(way, axis=0)
    near = (arcs[:-1] <= arc + within) & (arcs[1:] >= arc - within) & (np.diff(arcs) > 0.0)
    return [atan2_rounded(y, x) for x, y in steps[near, :2].tolist()]


def turn_at(way: Array, committed: Array, arc: float) -> float:
    """Return the greatest turn between segments of a path near an arc length, rad.

    The last segments of the committed path, which is not thinned, are among them.
    """
    steps = [_steps_near(way, arc), _steps_near(committed, length(committed))]
    pieces = np.concatenate(steps)
    cosine = float((pieces @ pieces.T).min()) if len(pieces) else 1.0
    return math.acos(min(max(cosine, -1.0), 1.0))


def _steps_near(way: Array, arc: float) -> Array:
    """Return the directions (n, 3) of the segments of a path within `CORNER` of an arc length."""
    points = densely(way, 0.02)
    arcs = arc_lengths(points)
    near = (arcs[1:] >= arc - CORNER) & (arcs[:-1] <= arc + CORNER)
    steps = np.diff(points, axis=0)[near]
    lengths = np.linalg.norm(steps, axis=1)
    directions: Array = steps[lengths > 1e-9] / lengths[lengths > 1e-9, None]
    return directions


def heading_of_body(decision: pb.Decision) -> float:
    """Return the heading of a decision's pose, rad."""
    w, x, y, z = decision.quaternion
    return math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
