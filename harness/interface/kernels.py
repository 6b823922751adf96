"""Kernels of the stack interface: a held velocity to its rest, and the nearest returns around."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wayproof.kernel_compiler import allocating, kernel
from wayproof.maps.elementary import _norm, _sine_cosine
from wayproof.models.sensors.beams import DROPPED, NO_RETURN

Array = NDArray[np.float64]

STEP_S = 0.01
"""Time step of the rollout of a velocity, s."""


@allocating
def roll_out(
    steps: int,
    velocity: Array,
    turning: tuple[float, float],
    target: Array,
    changes: tuple[float, float],
    positions: Array,
    headings: Array,
) -> int:
    """Hold a velocity for some steps, then brake to rest.

    Args:
        steps: Number of steps for which it holds.
        velocity: (3,) at the start, world frame, m/s; is written.
        turning: Yaw rate at the start, and the one to hold, rad/s.
        target: (3,) velocity to hold, in the body's frame, m/s.
        changes: Greatest change of the velocity, m/s, and of the yaw rate, rad/s, in a step.
        positions: (n, 3) m; the first is the start, the others are written.
        headings: (n,) rad, likewise.

    Returns:
        Number of positions; n + 1 if the body does not come to rest.
    """
    rate, held = turning
    change = np.empty(3)
    count = 1
    while count <= steps or _norm(velocity) > 0.0 or rate != 0.0:
        if count >= len(positions):
            return len(positions) + 1
        holds = count <= steps
        wanted = held if holds else 0.0
        next_rate = rate + min(max(wanted - rate, -changes[1]), changes[1])
        heading = headings[count - 1] + 0.5 * (rate + next_rate) * STEP_S
        rate = next_rate
        (sine, _), (cosine, _) = _sine_cosine(heading)
        x, y, z = (target[0], target[1], target[2]) if holds else (0.0, 0.0, 0.0)
        change[0] = cosine * x - sine * y - velocity[0]
        change[1] = sine * x + cosine * y - velocity[1]
        change[2] = z - velocity[2]
        size = _norm(change)
        share = 1.0 if size <= changes[0] else changes[0] / size
        for axis in range(3):
            before = velocity[axis]
            velocity[axis] = before + change[axis] * share
            middle = 0.5 * (before + velocity[axis]) * STEP_S
            positions[count, axis] = positions[count - 1, axis] + middle
        headings[count] = heading
        count += 1
    return count


@kernel
def take_nearest(
    origins: Array,
    directions: Array,
    ranges_mm: NDArray[np.uint16] | NDArray[np.uint32],
    moments: NDArray[np.int32],
    pose: tuple[float, float, float, float],
    band: tuple[float, float],
    edges: Array,
    nearest: Array,
) -> None:
    """Take the horizontal distances of a sweep's returns where they are nearer.

    Args:
        origins: (m, 3) positions of the sensor, world frame, m.
        directions: (n, 3) of the beams, world frame.
        ranges_mm: (n,) mm; 0 is dropped, 65535 no return.
        moments: (n,) index of the origin of each beam.
        pose: Position x and y, m, and sine and cosine of the heading that directions begin at.
        band: Height above which and below which a return counts, m.
        edges: (k,) pseudo-angle at which each direction begins, see `returns`.
        nearest: (k,) distance of the nearest return in each direction so far, m; is written.
    """
    px, py, sine, cosine = pose
    for i in range(len(ranges_mm)):
        if ranges_mm[i] == DROPPED or ranges_mm[i] == NO_RETURN:
            continue
        along, o = ranges_mm[i] * 1e-3, moments[i]
        if not band[0] < origins[o, 2] + along * directions[i, 2] < band[1]:
            continue
        dx = origins[o, 0] + along * directions[i, 0] - px
        dy = origins[o, 1] + along * directions[i, 1] - py
        x, y = cosine * dx + sine * dy, cosine * dy - sine * dx
        distance = np.sqrt(x * x + y * y)
        share = x / (abs(x) + abs(y))
        angle = 1.0 - share if y >= 0.0 else 3.0 + share
        if distance > 0.0:
            k = np.searchsorted(edges, angle, "right") - 1
            nearest[k] = min(nearest[k], distance)
