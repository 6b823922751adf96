"""What a planar stack needs of its sweeps: the returns in the body's way, and a scan of them.

Floor that a robot walks on is in every sweep, and a stack that takes it for an obstacle stands in
one. Both functions leave it out. They use sums, products, quotients and square roots, which every
processor rounds alike.
"""

from __future__ import annotations

import math
from typing import Literal

import numpy as np

from wayproof.harness.geometry import yaw_of_quaternion
from wayproof.harness.interface.kernels import take_nearest
from wayproof.harness.interface.types import Array, Observation
from wayproof.harness.mission import Mission
from wayproof.maps.elementary import sines_cosines

FLOOR_NOISE_M = 0.01
"""Height above what the body steps over below which a return counts as floor, m."""


def body_returns(
    observation: Observation,
    mission: Mission,
    *,
    frame: Literal["world", "body"] = "world",
    thinned_m: float = 0.0,
) -> Array:
    """Return the returns (k, 3) at a height that the body takes, m.

    Args:
        observation: The observation.
        mission: Mission of the task.
        frame: `world`, or `body`: about the estimated position, x forward, y left, z up, level.
        thinned_m: Edge of a cube, m; the first return in each cube is kept. 0 keeps all.
    """
    points = np.vstack([np.zeros((0, 3)), *(sweep.points for sweep in observation.sweeps)])
    low, high = band_of(observation, mission)
    points = points[(points[:, 2] > low) & (points[:, 2] < high)]
    if thinned_m > 0.0:
        cubes = np.floor(points / thinned_m).astype(np.int64)
        _, first = np.unique(cubes, axis=0, return_index=True)
        points = points[np.sort(first)]
    if frame == "world":
        return points
    return in_body(points - observation.position, yaw_of_quaternion(observation.quaternion))


def scan(
    observation: Observation, mission: Mission, *, bearings: int = 72, reach_m: float = 10.0
) -> Array:
    """Return the horizontal distance (bearings,) of the nearest return in each direction, m.

    Args:
        observation: The observation.
        mission: Mission of the task.
        bearings: Number of directions: the k-th is 360/bearings degrees wide, from k times that on,
            counter-clockwise from straight ahead.
        reach_m: Distance where no return is nearer, m.
    """
    sines, cosines = sines_cosines(
        np.append(
            np.arange(bearings) * (2.0 * math.pi / bearings),
            yaw_of_quaternion(observation.quaternion),
        )
    )
    x, y, _ = observation.position.tolist()
    place = x, y, float(sines[-1]), float(cosines[-1])
    band, edges = band_of(observation, mission), _pseudo_angles(cosines[:-1], sines[:-1])
    nearest = np.full(bearings, reach_m)
    for sweep in observation.sweeps:
        one = sweep.placed
        beams = one.origins, one.directions, one.ranges_mm, one.moments
        take_nearest(*beams, place, band, edges, nearest)
    return nearest


def band_of(observation: Observation, mission: Mission) -> tuple[float, float]:
    """Return the heights between which a return is in the body's way, world frame, m."""
    height = float(observation.position[2])
    if not mission.planar:
        return height - mission.radius, height + mission.radius
    floor = height - mission.start[2] + FLOOR_NOISE_M
    return floor + mission.step_height, floor + mission.height


def in_body(vectors: Array, heading: float) -> Array:
    """Return vectors (..., 3) of the world in the body's frame, by its heading alone."""
    sines, cosines = sines_cosines(np.array([heading]))
    sine, cosine = float(sines[0]), float(cosines[0])
    x, y, z = vectors[..., 0], vectors[..., 1], vectors[..., 2]
    return np.stack([cosine * x + sine * y, cosine * y - sine * x, z], axis=-1)


def in_world(vectors: Array, heading: float) -> Array:
    """Return vectors (..., 3) of the body's frame in the world; the inverse of `in_body`."""
    return in_body(vectors, -heading)


def _pseudo_angles(x: Array, y: Array) -> Array:
    """Return numbers (n,) in [0, 4) that grow with the angle of (x, y) from the x axis.

    Their order is that of the angles, and they need no arc tangent.
    """
    share = x / (np.abs(x) + np.abs(y))
    angles: Array = np.where(y >= 0.0, 1.0 - share, 3.0 + share)
    return angles
