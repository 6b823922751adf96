"""Collision checks of the footprint: at a pose, along a trajectory, turning into a path."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from wayproof.harness.geometry import wrap_angle
from wayproof.harness.stack.footprint import HEADING_TOLERANCE
from wayproof.harness.stack.global_path import heading_at
from wayproof.harness.stack.types import Array, PlannerInput, arc_length, is_stationary
from wayproof.maps.elementary import sines_cosines
from wayproof.planners import FreeSpace, Trajectory, TrajectorySample, arc_lengths, truncate

CHECK_STEP = 0.02
"""Time between the checked poses of a trajectory, s."""

MIN_PATH = 0.1
"""Minimum length of a path that is worth leaving rest for, m."""


def compensate_yaw_lag(
    input: PlannerInput, setpoint: TrajectorySample, start: TrajectorySample
) -> TrajectorySample:
    """Return the start of the new trajectory, with the yaw that the lagging body will have there.

    Legs turn late. An elongated body is planned for at its own yaw, within the heading tolerance,
    so that the poses checked are those that it takes.

    Args:
        input: Planner input of the decision.
        setpoint: Commanded state at the time of the sweep.
        start: Commanded state at the time of effect.
    """
    lag = wrap_angle(input.heading - setpoint.heading)
    if not input.traversable.discs or abs(lag) <= HEADING_TOLERANCE:
        return start
    if input.traversable.turnable(start.position[None])[0]:  # any heading is free there
        return start
    beyond = lag - math.copysign(HEADING_TOLERANCE, lag)
    return start._replace(heading=start.heading + beyond)


def footprint_free(space: FreeSpace, sample: TrajectorySample) -> bool:
    """Return whether the footprint is free at a pose."""
    if not space.discs:
        return space.is_free(sample.position)
    return space.pose_free(sample.position, sample.heading)


def first_misfit(space: FreeSpace, trajectory: Trajectory, elapsed: float = 0.0) -> float | None:
    """Return the arc length of a trajectory at which the oriented footprint first does not fit, m.

    Args:
        space: Space to keep to.
        trajectory: Checked pose by pose to its rest, turns included.
        elapsed: Time of it that has passed, s.

    Returns:
        None if it fits all along, or if the footprint is circumscribed.
    """
    if not space.discs:
        return None
    poses = poses_from(trajectory, 0.0)
    first = len(poses) - len(poses_from(trajectory, elapsed))
    free = first + space.free_poses(poses[first:])
    if free == len(poses):
        return None
    return float(arc_lengths(poses[: max(free, 1), :3])[-1])


def poses_from(trajectory: Trajectory, elapsed: float) -> Array:
    """Return poses (n, 4) of a trajectory after a time, s, to check: x, y, z, m, and yaw, rad.

    With the corners of its path, which they would cut: at 4 m/s they are 8 cm apart.
    """
    return trajectory.poses(CHECK_STEP, elapsed, corners=True)


def moves_tail_first(input: PlannerInput, start: TrajectorySample, path: Array) -> bool:
    """Return whether an elongated body in motion takes a path (n, 3) backwards."""
    if not input.traversable.discs or is_stationary(start) or arc_length(path) < 1e-6:
        return False
    return abs(wrap_angle(heading_at(path, 0.0) - start.heading)) > 0.5 * np.pi


def headings_to_start_at(
    space: FreeSpace, start: TrajectorySample, path_heading: float
) -> list[tuple[float, bool]]:
    """Return headings to leave rest at, rad, each with whether that is tail first, by preference.

    Nose first where the body can turn about; elsewhere the heading that is nearer, and the other
    one only if it cannot turn to that.
    """
    headings = [(path_heading, False), (path_heading + np.pi, True)]
    if space.turnable(start.position[None])[0]:
        return headings[:1]
    headings.sort(key=lambda heading: abs(wrap_angle(heading[0] - start.heading)))
    return [
        heading
        for heading in headings
        if space.turn_free(start.position, start.heading, heading[0])
    ][:1]


def truncate_where_turnable(space: FreeSpace, path: Array, min_length: float) -> Array:
    """Return a path (n, 3) up to the first place where the body can turn about.

    Args:
        space: Space to keep to.
        path: m.
        min_length: Part of it that is kept in any case, m.
    """
    arcs = arc_lengths(path)
    turnable = np.flatnonzero((arcs >= min_length) & space.turnable(path))
    if len(turnable) == 0:
        return path
    return truncate(path, max(float(arcs[turnable[0]]), MIN_PATH))


def keeps_clearance(
    space: FreeSpace, start: TrajectorySample, target: Array, heading: float
) -> bool:
    """Return whether no disc of the footprint comes nearer to blocked cells, by more than a cell.

    Args:
        space: Space whose clearance is compared.
        start: Pose that a straight motion begins at.
        target: (3,) that it ends at, m.
        heading: Yaw there, rad.
    """
    offsets = [disc.offset for disc in space.discs] or [0.0]
    paths = _disc_paths(offsets, start, target, heading)
    at_start = min(space.least_clearance(path[[0, 0]]) for path in paths)
    return min(space.least_clearance(path) for path in paths) >= at_start - space.resolution


def keeps_bare_clearance(
    space: FreeSpace,
    discs: Sequence[tuple[float, float]],
    start: TrajectorySample,
    target: Array,
    heading: float,
) -> bool:
    """Return whether no disc of the bare body comes deeper into blocked cells, by more than a cell.

    Args:
        space: Space whose clearance is compared.
        discs: Offset along the x axis of the body, and radius, of each disc, m.
        start: Pose that a straight motion begins at.
        target: (3,) that it ends at, m.
        heading: Yaw there, rad.
    """
    paths = _disc_paths([offset for offset, _ in discs], start, target, heading)
    for path, (_, radius) in zip(paths, discs, strict=True):
        at_start = min(space.least_clearance(path[[0, 0]]), radius)
        if space.least_clearance(path) < at_start - space.resolution:
            return False
    return True


def _disc_paths(
    offsets: Sequence[float], start: TrajectorySample, target: Array, heading: float
) -> list[Array]:
    """Return paths (9, 3) of the centres of discs along a straight motion that turns evenly, m."""
    sines, cosines = sines_cosines(np.linspace(start.heading, heading, 9))
    ahead = np.column_stack((cosines, sines, np.zeros(9)))
    positions = start.position + np.linspace(0.0, 1.0, 9)[:, None] * (target - start.position)
    return [positions + offset * ahead for offset in offsets]
