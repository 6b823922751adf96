"""Geometry of logged paths and trajectories, independent of the planner's."""

from __future__ import annotations

import itertools
import math

import numpy as np
from numpy.typing import NDArray

from wayproof.harness.decision import path_of
from wayproof.harness.schema import wayproof_pb2 as pb

Array = NDArray[np.float64]

SAME_PLACE = 0.02
"""Distance up to which two points count as one, m."""

SAME_POINT = 1e-3
"""Distance up to which a point is one of another path, m: the rounding of a log."""


def densely(path: Array, spacing: float) -> Array:
    """Return points (m, 3) along a path (n, 3), its own among them, at most `spacing` m apart."""
    steps = np.diff(path, axis=0)
    lengths = [math.sqrt(step.dot(step)) for step in steps]
    counts = np.array([max(math.ceil(one / spacing), 1) for one in lengths], np.int64)
    ends = np.cumsum(counts)
    number = np.arange(1, int(counts.sum()) + 1) - np.repeat(ends - counts, counts)  # in its step
    share = number * np.repeat(1.0 / counts, counts)
    share[ends - 1] = 1.0
    whole = np.repeat(path[:-1], counts, axis=0) + share[:, None] * np.repeat(steps, counts, axis=0)
    return np.concatenate([path[:1], whole])


def arc_lengths(path: Array) -> Array:
    """Return the arc length of a path (n, 3) at each of its points, (n,) m."""
    steps = np.sqrt((np.diff(path, axis=0) ** 2).sum(axis=1))
    return np.concatenate([[0.0], np.cumsum(steps)])


def length(path: Array) -> float:
    """Return the length of a path (n, 3), m."""
    return float(arc_lengths(path)[-1])


def rest_of(path: Array, start: Array, reach: float) -> Array:
    """Return the part of a path (n, 3) from the point nearest to `start` on, `reach` m long."""
    points = densely(path, SAME_PLACE)
    first = int(np.linalg.norm(points - start, axis=1).argmin())
    lengths = arc_lengths(points[first:])[1:]
    return points[first : first + 1 + int(np.searchsorted(lengths, reach)) + 1]


def refined(thinned: Array, whole: Array) -> Array:
    """Return a thinned path (n, 3) with all points of the path (m, 3) that its beginning is of.

    A log holds every fifth point of a global path, which may leave out a corner.
    """
    if len(thinned) == 0:
        return thinned
    gaps = np.linalg.norm(thinned[:, None] - whole[None], axis=2).min(axis=1)
    left_out = np.flatnonzero(gaps > SAME_POINT)
    along = int(left_out[0]) if len(left_out) else len(thinned)
    return np.concatenate([whole, thinned[along:]]) if along else thinned


def runs_along(path: Array, earlier: Array) -> bool:
    """Return whether every point of a path lies on an earlier path."""
    if len(earlier) == 0:
        return False
    trodden = densely(earlier, SAME_PLACE)
    gaps = np.linalg.norm(path[:, None] - trodden[None], axis=2).min(axis=1)
    return bool(gaps.max() <= SAME_PLACE)


def arc_at(trajectory: pb.Trajectory, time_ns: int) -> float:
    """Return the arc length of a trajectory at a simulated time, interpolated, m."""
    arcs = np.array(trajectory.arc_length)
    begun = (time_ns - trajectory.start.ToNanoseconds()) * 1e-9
    return float(np.interp(begun, np.arange(len(arcs)) * trajectory.sample_period_s, arcs))


def place_at(trajectory: pb.Trajectory, time_ns: int) -> Array:
    """Return the position of a trajectory at a simulated time, (3,) m."""
    path = path_of(trajectory.path)
    along, lengths = arc_at(trajectory, time_ns), arc_lengths(path)
    return np.array([np.interp(along, lengths, path[:, axis]) for axis in range(3)])


def heading_at(trajectory: pb.Trajectory, time_ns: int) -> float:
    """Return the heading of a trajectory at a simulated time, interpolated, rad."""
    headings = np.array(trajectory.heading)
    begun = (time_ns - trajectory.start.ToNanoseconds()) * 1e-9
    times = np.arange(len(headings)) * trajectory.sample_period_s
    return float(np.interp(begun, times, headings))


def speed_at(trajectory: pb.Trajectory, time_ns: int) -> float:
    """Return the speed at a simulated time by the even acceleration through the samples, m/s.

    From the first period of the samples, from before the time where there are any.
    """
    period_ns = round(trajectory.sample_period_s * 1e9)
    first_ns = max(time_ns - period_ns, trajectory.start.ToNanoseconds())
    arcs = [arc_at(trajectory, first_ns + k * period_ns) for k in range(3)]
    speeds = [(b - a) / trajectory.sample_period_s for a, b in itertools.pairwise(arcs)]
    share = (time_ns - first_ns) / period_ns  # periods from the first sample
    return max(speeds[0] + (share - 0.5) * (speeds[1] - speeds[0]), 0.0)
