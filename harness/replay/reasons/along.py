"""Places, lengths and directions along the thinned paths of a log."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from wayproof.harness.geometry import atan2_rounded
from wayproof.harness.log.paths import Array, arc_lengths, densely, length
from wayproof.harness.replay.reasons.scene import Scene
from wayproof.harness.schema import wayproof_pb2 as pb

NEAR = 1e-3
"""Figures that are worked out in two ways differ by less, m, s and rad."""

ARC, ARC_SHARE = 0.15, 0.05
"""So much [m], and that share of it, may a length along a thinned path be off."""

CORNER = 0.6
"""So far before and behind a corner its turn is looked for, m."""


def same(name: str, claimed: float, found: float, within: float = NEAR) -> Iterator[str]:
    """A text unless a figure is the one found, to within an error."""
    if not abs(claimed - found) <= within:
        yield f"{name} is {claimed:.3f}, found {found:.3f}"


def same_arc(name: str, claimed: float, found: float) -> Iterator[str]:
    """The same for a length along a thinned path."""
    yield from same(name, claimed, found, ARC + ARC_SHARE * abs(claimed))


def point_of(point: pb.Point) -> Array:
    """A logged point (3,), m."""
    return np.array([point.x, point.y, point.z])


def nearest(way: Array, place: Array, scene: Scene) -> tuple[float, float]:
    """Arc length of the point of a way nearest to a place, and how far that is, m."""
    points = densely(way, 0.01)
    gaps = np.linalg.norm((points - place)[:, : scene.axes], axis=1)
    nearest = int(gaps.argmin())
    return float(arc_lengths(points)[nearest]), float(gaps[nearest])


def left_of(way: Array, place: Array) -> float:
    """Arc length from the point of a way nearest to a place, in the plane, to its end, m."""
    points = densely(way, 0.01)
    nearest = int(np.linalg.norm((points - place)[:, :2], axis=1).argmin())
    return length(points) - float(arc_lengths(points)[nearest])


def direction(way: Array, begin: float, end: float) -> float:
    """Heading from one arc length of a way to another, rad."""
    arcs = arc_lengths(way)
    x, y = (np.interp(end, arcs, way[:, k]) - np.interp(begin, arcs, way[:, k]) for k in range(2))
    return atan2_rounded(float(y), float(x))


def turn_at(way: Array, committed: Array, arc: float) -> float:
    """The greatest turn between pieces of a way near an arc length, rad.

    Among them those that the committed part ends with, which is not thinned.
    """
    steps = [_steps_near(way, arc), _steps_near(committed, length(committed))]
    pieces = np.concatenate(steps)
    cosine = float((pieces @ pieces.T).min()) if len(pieces) else 1.0
    return math.acos(min(max(cosine, -1.0), 1.0))


def _steps_near(way: Array, arc: float) -> Array:
    """Directions (n, 3) of the pieces of a way within `CORNER` of an arc length."""
    points = densely(way, 0.02)
    arcs = arc_lengths(points)
    near = (arcs[1:] >= arc - CORNER) & (arcs[:-1] <= arc + CORNER)
    steps = np.diff(points, axis=0)[near]
    lengths = np.linalg.norm(steps, axis=1)
    directions: Array = steps[lengths > 1e-9] / lengths[lengths > 1e-9, None]
    return directions


def heading_of_body(decision: pb.Decision) -> float:
    """Of a decision's pose, rad."""
    w, x, y, z = decision.quaternion
    return math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
