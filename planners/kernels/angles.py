"""Angles and headings, rad, without functions of the C library, whose last bits vary."""

from __future__ import annotations

import math

import numpy as np

from wayproof.kernel_compiler import allocating, kernel
from wayproof.planners.kernels.grid import Floats

TURN = 2.0 * math.pi
"""A full turn, rad."""


@kernel
def wrap(angle: float) -> float:
    """Wrap an angle to [-pi, pi), rad."""
    return angle - TURN * math.floor(angle / TURN + 0.5)


@kernel
def yaw_of_direction(dx: float, dy: float) -> float:
    """Return the yaw of (dx, dy), rad in [-pi, pi]: atan2(dy, dx) to 1e-12; 0 of (0, 0).

    By sums, products, quotients and roots alone, which every processor rounds alike.

    Three half-angle steps, atan(t) = 2 atan(t / (1 + sqrt(1 + t^2))), bring the argument below
    0.1, where six terms of the series are enough.
    """
    if dx == 0.0 and dy == 0.0:
        return 0.0
    steep = abs(dy) > abs(dx)
    t = abs(dx) / abs(dy) if steep else abs(dy) / abs(dx)
    for _ in range(3):
        t = t / (1.0 + math.sqrt(1.0 + t * t))
    q = t * t
    series = 1.0 - q * (1 / 3 - q * (1 / 5 - q * (1 / 7 - q * (1 / 9 - q * (1 / 11)))))
    angle = 8.0 * t * series
    if steep:
        angle = 0.5 * math.pi - angle
    if dx < 0.0:
        angle = math.pi - angle
    return -angle if dy < 0.0 else angle


@kernel
def cosine_sine(angle: float) -> tuple[float, float]:
    """Return the cosine and sine of an angle, rad, to 1e-14, by sums, products and a floor alone.

    Series for a sixteenth of the angle, and four doublings.
    """
    small = wrap(angle) / 16.0
    q = small * small
    sine = small * (1.0 - q / 6.0 * (1.0 - q / 20.0 * (1.0 - q / 42.0 * (1.0 - q / 72.0))))
    cosine = 1.0 - q / 2.0 * (
        1.0 - q / 12.0 * (1.0 - q / 30.0 * (1.0 - q / 56.0 * (1.0 - q / 90.0)))
    )
    for _ in range(4):
        cosine, sine = cosine * cosine - sine * sine, 2.0 * sine * cosine
    return cosine, sine


@allocating
def edge_headings(tangents: Floats, initial: float) -> Floats:
    """Return the heading of each edge, rad, shape (n,), without jumps by full turns.

    Args:
        tangents: Unit tangents, shape (n, 3).
        initial: Heading of the leading edges that are too steep to have one, rad.
    """
    headings = np.empty(len(tangents))
    heading = initial
    for n in range(len(tangents)):
        x, y, z = tangents[n]
        if x * x + y * y > 1e-4 * z * z:  # steeper than 89.4 degrees: no heading
            heading += wrap(yaw_of_direction(x, y) - heading)
        headings[n] = heading
    return headings


@allocating
def acceleration_limited(
    targets: Floats, initial: float, rate: float, largest_step: float, largest_change: float
) -> Floats:
    """Limit the rate and the acceleration of headings: (n + 1,) that follow targets (n,), rad.

    Each step is that of the target and the greatest from which the error that is left can still
    be braked, as in the time-optimal control of a double integrator.

    Args:
        targets: Headings to follow, one for each step.
        initial: Heading at the beginning, rad.
        rate: Change of heading in the step before, rad.
        largest_step: Largest change of heading in a step, rad.
        largest_change: Largest difference of one step from the one before, rad.
    """
    headings = np.empty(len(targets) + 1)
    headings[0] = initial
    for n in range(len(targets)):
        target = targets[max(n - 1, 0)]  # of now: the next heading is to be at targets[n]
        error = target - headings[n]
        closing = min(math.sqrt(2.0 * largest_change * abs(error)), abs(error))
        step = targets[n] - target + math.copysign(closing, error)
        step = min(max(step, -largest_step), largest_step)
        rate += min(max(step - rate, -largest_change), largest_change)
        headings[n + 1] = headings[n] + rate
    return headings


@allocating
def rate_limited(targets: Floats, initial: float, largest_step: float) -> Floats:
    """Limit the rate of headings to a step: (n + 1,) that follow targets (n,), rad."""
    headings = np.empty(len(targets) + 1)
    headings[0] = initial
    for n in range(len(targets)):
        error = targets[n] - headings[n]
        headings[n + 1] = headings[n] + min(max(error, -largest_step), largest_step)
    return headings
