"""Gusts after Dryden, in the low-altitude form of MIL-F-8785C, section 3.7.2.

Turbulence is frozen and carried past by the mean wind, so that white noise through a filter whose
length is in metres becomes a series in time. The specification starts at 10 ft above the ground.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.signal import lfilter

from wayproof.models.arrays import Array

FOOT = 0.3048
LOWEST = 10.0 * FOOT


def dryden_gusts(
    rng: np.random.Generator, count: int, timestep: float, mean_speed: float, height: float = LOWEST
) -> Array:
    """Wind in the world frame (count, 3), m/s: a mean in a drawn direction and gusts on it."""
    direction = rng.uniform(0.0, 2.0 * math.pi)
    along = np.array([math.cos(direction), math.sin(direction), 0.0])
    if mean_speed == 0.0:
        return np.zeros((count, 3))
    feet = max(height, LOWEST) / FOOT
    shape = 0.177 + 0.000823 * feet
    sigma_up = 0.1 * mean_speed
    sigma_flat = sigma_up / shape**0.4
    time_up = feet * FOOT / mean_speed
    time_flat = feet / shape**1.2 * FOOT / mean_speed
    u = _first_order(rng, count, timestep / time_flat) * sigma_flat
    v = _second_order(rng, count, timestep / time_flat) * sigma_flat
    w = _second_order(rng, count, timestep / time_up) * sigma_up
    across = np.array([-along[1], along[0], 0.0])
    up = np.array([0.0, 0.0, 1.0])
    wind: Array = (mean_speed + u)[:, None] * along + v[:, None] * across + w[:, None] * up
    return wind


def _first_order(rng: np.random.Generator, count: int, step: float) -> Array:
    """Return a process of unit variance, spectrum of 1 / (1 + s), in steps of its time constant."""
    keep = math.exp(-step)
    kicks = rng.standard_normal(count)
    kicks[1:] *= math.sqrt(1.0 - keep * keep)
    series: Array = lfilter([1.0], [1.0, -keep], kicks)
    return series


def _second_order(rng: np.random.Generator, count: int, step: float) -> Array:
    """Return a process of unit variance, spectrum of (1 + sqrt(3) s) / (1 + s)^2.

    That is sqrt(3) / (1 + s) + (1 - sqrt(3)) / (1 + s)^2 of white noise of intensity 1.
    """
    keep = math.exp(-step)
    settle = round(12.0 / step)  # time constants before the series begins
    kicks = rng.standard_normal(settle + count) * math.sqrt(1.0 - keep * keep)
    once = lfilter([1.0], [1.0, -keep], kicks)
    twice = lfilter([1.0 - keep], [1.0, -keep], once)
    # Of unit variance is `once`; the sum's is (3 + (1 - sqrt 3)^2 / 2 + sqrt 3 (1 - sqrt 3)) = 2.
    series: Array = (math.sqrt(3.0) * once + (1.0 - math.sqrt(3.0)) * twice) / math.sqrt(2.0)
    return series[settle:]
