"""Smoothing of setpoints: a reference with bounded derivatives up to snap."""

from __future__ import annotations

from math import floor, pi, sqrt

from wayproof.models._jit import allocating, kernel
from wayproof.models.arrays import Array
from wayproof.models.robots.quadrotor.parameters import Smoothing


@allocating
def smooth_setpoint(
    smoothing: Smoothing, reference: Array, setpoint: Array, timestep: float
) -> None:
    """Advance the reference by one tick and choose its snap toward a setpoint.

    Args:
        smoothing: Bandwidth and limits.
        reference: (5, 4) position, velocity, acceleration, jerk and snap by row; x, y, z, m, and
            heading, rad, unwrapped, by column; updated.
        setpoint: (4,) x, y, z, m, and heading, rad.
        timestep: s.
    """
    _integrate(reference, timestep)
    target = setpoint.copy()
    target[3] -= 2 * pi * floor((target[3] - reference[0, 3] + pi) / (2 * pi))
    _choose_snap(reference[:, :3], target[:3], smoothing.bandwidth, smoothing.limits)
    _choose_snap(reference[:, 3:], target[3:], smoothing.bandwidth, smoothing.heading_limits)


@kernel
def _integrate(reference: Array, timestep: float) -> None:
    """Integrate over a tick, exactly for a constant snap."""
    for channel in range(4):
        for order in range(4):
            power = 1.0
            for higher in range(order + 1, 5):
                power *= timestep / (higher - order)
                reference[order, channel] += power * reference[higher, channel]


@allocating
def _choose_snap(
    reference: Array, target: Array, bandwidth: float, limits: tuple[float, float, float, float]
) -> None:
    """Set the snap by four nested loops, each with a limit on its demand of the next.

    Unlimited, their gains put all four poles at the bandwidth: (s + b)^4 = s^4 + 4 b s^3
    + 6 b^2 s^2 + 4 b^3 s + b^4, read from the inside out.
    """
    demand = target
    gains = (bandwidth / 4, bandwidth * 2 / 3, bandwidth * 3 / 2, bandwidth * 4)
    for order in range(4):
        demand = gains[order] * (demand - reference[order])
        norm = sqrt((demand * demand).sum())
        demand *= min(1.0, limits[order] / max(norm, 1e-9))
    reference[4] = demand
