"""Headings by exactly rounded operations only, so that no maths library can change a bit."""

import math

import numpy as np

from planners._jit import kernel
from planners.kernels import Floats

TURN = 2.0 * math.pi


@kernel
def wrap(angle: float) -> float:
    """The same angle [rad] in [-pi, pi)."""
    return angle - TURN * math.floor(angle / TURN + 0.5)


@kernel
def heading_of(x: float, y: float) -> float:
    """atan2(y, x) [rad] to 1e-12, by additions, products, quotients and roots.

    Three half-angle steps, atan(t) = 2 atan(t / (1 + sqrt(1 + t^2))), bring the argument below
    0.1, where six terms of the series are enough.
    """
    if x == 0.0 and y == 0.0:
        return 0.0
    steep = abs(y) > abs(x)
    t = abs(x) / abs(y) if steep else abs(y) / abs(x)
    for _ in range(3):
        t = t / (1.0 + math.sqrt(1.0 + t * t))
    q = t * t
    series = 1.0 - q * (1 / 3 - q * (1 / 5 - q * (1 / 7 - q * (1 / 9 - q * (1 / 11)))))
    angle = 8.0 * t * series
    if steep:
        angle = 0.5 * math.pi - angle
    if x < 0.0:
        angle = math.pi - angle
    return -angle if y < 0.0 else angle


@kernel
def edge_headings(tangents: Floats, initial: float) -> Floats:
    """Heading of each edge [rad], shape (n,), without jumps by full turns.

    Args:
        tangents: Unit tangents, shape (n, 3).
        initial: Heading [rad] kept by leading edges that are too steep to have one.
    """
    headings = np.empty(len(tangents))
    heading = initial
    for n in range(len(tangents)):
        x, y, z = tangents[n]
        if x * x + y * y > 1e-4 * z * z:  # steeper than 89.4 degrees: no heading
            heading += wrap(heading_of(x, y) - heading)
        headings[n] = heading
    return headings


@kernel
def turn_after(targets: Floats, initial: float, largest_step: float) -> Floats:
    """Headings [rad] that run after their targets by at most a step at a time, shape (n + 1,)."""
    headings = np.empty(len(targets) + 1)
    headings[0] = initial
    for n in range(len(targets)):
        error = targets[n] - headings[n]
        headings[n + 1] = headings[n] + min(max(error, -largest_step), largest_step)
    return headings
