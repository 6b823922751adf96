"""Lengths, points and joints of logged paths and trajectories."""

from __future__ import annotations

import itertools
import math

import numpy as np
from numpy.typing import NDArray

from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.harness.stack.decision import path_of

Array = NDArray[np.float64]

SAME_PLACE = 0.02
"""Places this near to each other are one, m."""


def densely(path: Array, spacing: float) -> Array:
    """Points of a path, (m, 3), at most so far apart, its own among them."""
    pieces = [path[:1]]
    for a, b in itertools.pairwise(path):
        count = max(math.ceil(float(np.linalg.norm(b - a)) / spacing), 1)
        pieces.append(a + np.linspace(0.0, 1.0, count + 1)[1:, None] * (b - a))
    return np.concatenate(pieces)


def arc_lengths(path: Array) -> Array:
    """Length of a path (n, 3) up to each of its points, (n,) m."""
    steps = np.sqrt((np.diff(path, axis=0) ** 2).sum(axis=1))
    return np.concatenate([[0.0], np.cumsum(steps)])


def length(path: Array) -> float:
    """Length of a path (n, 3), m."""
    return float(arc_lengths(path)[-1])


def rest_of(path: Array, start: Array, reach: float) -> Array:
    """Of a path (n, 3) what follows the point nearest to a start, so far, m."""
    points = densely(path, SAME_PLACE)
    first = int(np.linalg.norm(points - start, axis=1).argmin())
    lengths = arc_lengths(points[first:])[1:]
    return points[first : first + 1 + int(np.searchsorted(lengths, reach)) + 1]


def runs_along(path: Array, earlier: Array) -> bool:
    """Whether every point of a path lies on an earlier one."""
    if len(earlier) == 0:
        return False
    trodden = densely(earlier, SAME_PLACE)
    gaps = np.linalg.norm(path[:, None] - trodden[None], axis=2).min(axis=1)
    return bool(gaps.max() <= SAME_PLACE)


def arc_at(trajectory: pb.Trajectory, time_ns: int) -> float:
    """How far along its path a trajectory is at a simulated time, between its samples, m."""
    arcs = np.array(trajectory.arc_length)
    begun = (time_ns - trajectory.start.ToNanoseconds()) * 1e-9
    return float(np.interp(begun, np.arange(len(arcs)) * trajectory.sample_period_s, arcs))


def place_at(trajectory: pb.Trajectory, time_ns: int) -> Array:
    """Where a trajectory is at a simulated time, (3,) m."""
    path = path_of(trajectory.path)
    along, lengths = arc_at(trajectory, time_ns), arc_lengths(path)
    return np.array([np.interp(along, lengths, path[:, axis]) for axis in range(3)])


def speed_at(trajectory: pb.Trajectory, time_ns: int) -> float:
    """Mean speed over the sample period that follows a simulated time, m/s."""
    period_ns = round(trajectory.sample_period_s * 1e9)
    after, before = arc_at(trajectory, time_ns + period_ns), arc_at(trajectory, time_ns)
    return (after - before) / trajectory.sample_period_s
