"""Whether and how a body fits: along a trajectory, at a place, turning into a path."""

from __future__ import annotations

import math

import numpy as np

from wayproof.harness.stack.footprint import HEADING_TOLERANCE
from wayproof.harness.stack.global_path import heading_at
from wayproof.harness.stack.types import Array, View, length
from wayproof.maps.elementary import sines_cosines
from wayproof.planners import FreeSpace, Trajectory, TrajectorySample, arc_lengths, truncate

CHECK_STEP = 0.02
"""Poses of a trajectory are checked so far apart, s."""

LEAST_STEP = 0.1
"""A shorter path is not worth setting out for, m."""


def as_it_faces(view: View, believed: TrajectorySample, now: TrajectorySample) -> TrajectorySample:
    """Where the robot will be asked to be, but as it will face if it turns after what is asked.

    Legs turn late: a body that is longer than wide is planned for as it lies, within the heading
    tolerance, so that what is checked is what comes.

    Args:
        view: Of this decision.
        believed: Where it is asked to be at the time of the view.
        now: Where it is asked to be at the time of effect.
    """
    late = wrapped(view.heading - believed.heading)
    if not view.admitted.discs or abs(late) <= HEADING_TOLERANCE:
        return now
    if view.admitted.turnable(now.position[None])[0]:  # there it matters not how the body lies
        return now
    beyond = late - math.copysign(HEADING_TOLERANCE, late)
    return now._replace(heading=now.heading + beyond)


def fits(space: FreeSpace, now: TrajectorySample) -> bool:
    """Whether the body is free where it stands."""
    if not space.discs:
        return space.is_free(now.position)
    return space.pose_free(now.position, now.heading)


def fits_along(space: FreeSpace, trajectory: Trajectory, begun: float = 0.0) -> float | None:
    """Arc length [m] at which a body of discs no longer fits along a trajectory; None if it does.

    Args:
        space: Where it may be.
        trajectory: Checked pose by pose to its rest, its turns with it.
        begun: Seconds of it that have passed.
    """
    if not space.discs:
        return None
    poses = trajectory.poses(CHECK_STEP)
    first = len(poses) - len(poses_from(trajectory, begun))
    free = first + space.free_poses(poses[first:])
    if free == len(poses):
        return None
    return float(arc_lengths(poses[: max(free, 1), :3])[-1])


def poses_from(trajectory: Trajectory, begun: float) -> Array:
    """Poses (n, 4) of a trajectory of which some seconds have passed."""
    poses = trajectory.poses(CHECK_STEP)
    return poses[min(int(max(begun, 0.0) / CHECK_STEP), len(poses) - 1) :]


def tail_first(view: View, now: TrajectorySample, path: Array) -> bool:
    """Whether the body moves along a path tail first."""
    if not view.admitted.discs or now.speed < 1e-3 or length(path) < 1e-6:
        return False
    return abs(wrapped(heading_at(path, 0.0) - now.heading)) > 0.5 * np.pi


def ways_to_face(space: FreeSpace, now: TrajectorySample, ahead: float) -> list[tuple[float, bool]]:
    """Headings to set out at, and whether that is tail first, by preference.

    Where it can turn about it goes nose first. Else it takes the heading that is nearer, and the
    other one only if it cannot turn to that.
    """
    ways = [(ahead, False), (ahead + np.pi, True)]
    if space.turnable(now.position[None])[0]:
        return ways[:1]
    ways.sort(key=lambda way: abs(wrapped(way[0] - now.heading)))
    return [way for way in ways if space.turn_free(now.position, now.heading, way[0])][:1]


def to_where_it_turns(space: FreeSpace, path: Array, least: float) -> Array:
    """A path up to the first place where the body can turn about, but for what it takes to stop."""
    arcs = arc_lengths(path)
    there = np.flatnonzero((arcs >= least) & space.turnable(path))
    if len(there) == 0:
        return path
    return truncate(path, max(float(arcs[there[0]]), LEAST_STEP))


def leads_away(space: FreeSpace, now: TrajectorySample, target: Array, heading: float) -> bool:
    """Whether no disc comes nearer to what blocks, by more than a cell, on a straight way out."""
    offsets = [disc.offset for disc in space.discs] or [0.0]
    turns = np.linspace(now.heading, heading, 9)
    sines, cosines = sines_cosines(turns)
    ahead = np.column_stack((cosines, sines, np.zeros(9)))  # (9, 3)
    places = now.position + np.linspace(0.0, 1.0, 9)[:, None] * (target - now.position)
    ways = [places + offset * ahead for offset in offsets]
    here = min(space.least_clearance(way[[0, 0]]) for way in ways)
    return min(space.least_clearance(way) for way in ways) >= here - space.resolution


def wrapped(angle: float) -> float:
    """The same angle from -pi on, below pi, rad."""
    return float((angle + np.pi) % (2 * np.pi) - np.pi)
