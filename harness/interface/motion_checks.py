"""Checks of commanded motions: what no body can follow is refused in one line."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from wayproof.harness.interface.types import Array, Reference
from wayproof.maps.elementary import norm
from wayproof.planners import Trajectory

MAX_SAMPLES = 20_000
"""Most samples, waypoints or points of a trajectory."""

MAX_LENGTH_M = 1e3
"""Longest path, m."""

MAX_HEADING_RAD = 1e4
"""Greatest heading, full turns included, rad."""

MAX_DISTANCE_M = 1e4
"""Farthest coordinate from the origin, m."""

STARTS_ELSEWHERE_M = 0.05
"""Distance of a trajectory's start from the reference beyond which it is refused, m."""

FALL_M = 1e-3
"""Fall of the arc length of a trajectory up to which it counts as rounding, m."""

STILL_M = 1e-6
"""Steps shorter than this are no motion, m."""

SPACING_S = 0.01
"""Time between the arc lengths of a trajectory that are compared, s."""


class MotionError(ValueError):
    """Motion that no body can follow, in one line: what was got and expected."""


def checked_trajectory(
    trajectory: Trajectory,
    references: tuple[Reference, Reference],
    effect_ns: int,
    planar: bool,
) -> Trajectory:
    """Return an exact trajectory, if it is one."""
    path = checked_points("trajectory.path", trajectory.path)
    height = references[0].position[2]
    if planar and np.abs(path[:, 2] - height).max() > STILL_M:
        path[:, 2] = height
    for name, part in (("motion", trajectory.motion), ("turning", trajectory.turning)):
        count = len(part.times)
        if count > MAX_SAMPLES:
            raise MotionError(f"trajectory.{name}: got {count} pieces, expected {MAX_SAMPLES}")
        shapes = part.states.shape == (count, 3) and part.jerks.shape == (count,)
        numbers = [*part.times, *part.states.ravel(), *part.jerks, part.duration, part.end]
        if not shapes or not all(abs(number) <= MAX_HEADING_RAD for number in numbers):
            raise MotionError(
                f"trajectory.{name}: got pieces that are unequal, or numbers beyond "
                f"{MAX_HEADING_RAD:g}"
            )
        ascending = bool((np.diff(part.times) >= 0.0).all())
        if (count and (part.times[0] != 0.0 or not ascending)) or not 0.0 <= part.duration <= 1e4:
            raise MotionError(f"trajectory.{name}: expected times from 0 on, ascending, to an end")
    if not 0 <= trajectory.start_ns <= effect_ns:
        raise MotionError(
            f"trajectory.start_ns: got {trajectory.start_ns}, expected 0 to {effect_ns}, when the "
            "command takes effect"
        )
    trajectory = replace(trajectory, path=path)
    refuse_elsewhere(trajectory.at(effect_ns).position, references)
    return trajectory


def refuse_backwards(trajectory: Trajectory, effect_ns: int) -> None:
    """Raise a MotionError if the arc length of a trajectory falls: its path is driven one way.

    What is swept is the path from the time of effect to the rest, which are its ends so.
    """
    begin_s = max(effect_ns - trajectory.start_ns, 0) * 1e-9
    left_s = max(trajectory.duration_s - begin_s, 0.0)
    times = begin_s + np.linspace(0.0, left_s, math.ceil(left_s / SPACING_S) + 1)
    arcs = trajectory.motion.positions(np.append(times, begin_s + left_s))
    falls = np.maximum.accumulate(arcs) - arcs
    worst = int(falls.argmax())
    if falls[worst] > FALL_M or arcs[0] < -FALL_M:
        raise MotionError(
            f"trajectory.motion: got an arc length of {arcs[worst]:.2f} m after "
            f"{float(arcs[: worst + 1].max()):.2f} m, expected one that rises from 0 on"
        )


def checked_points(name: str, values: Array) -> Array:
    """Return a copy of points (k, 3), finite and near.

    Raises:
        MotionError: They are not.
    """
    points = np.array(values, np.float64)
    if points.ndim != 2 or points.shape[1] != 3 or not 1 <= len(points) <= MAX_SAMPLES:
        raise MotionError(f"{name}: got shape {points.shape}, expected (k, 3), k to {MAX_SAMPLES}")
    if not (np.abs(points) <= MAX_DISTANCE_M).all():  # nor NaN
        raise MotionError(f"{name}: expected finite coordinates within {MAX_DISTANCE_M:g} m")
    length = float(np.sqrt(np.square(np.diff(points, axis=0)).sum(axis=1)).sum())
    if length > MAX_LENGTH_M:
        raise MotionError(f"{name}: got a path of {length:.0f} m, expected {MAX_LENGTH_M:g} m")
    return points


def refuse_elsewhere(start: Array, references: tuple[Reference, Reference]) -> None:
    """Raise a MotionError if a start (3,) is far from both references of `trajectory_of`."""
    away = min(norm(start - reference.position) for reference in references)
    if away > STARTS_ELSEWHERE_M:
        raise MotionError(
            f"trajectory starts {away:.2f} m from where the robot is then, expected at most "
            f"{STARTS_ELSEWHERE_M:g} m"
        )
