"""Time parameterization: the fastest jerk-limited motion through zones of limited speed."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from wayproof.kernel_compiler import kernel
from wayproof.planners import jerk_limited
from wayproof.planners.jerk_limited import (
    AxisLimits,
    Leg,
    Profile,
    State,
    change_lengths,
    change_speed,
    join,
    solve,
)
from wayproof.planners.kernels.grid import Floats
from wayproof.planners.trajectory import MotionLimits

SLACK = 1e-7
"""Length that is kept back where a speed is fitted into a length, m: rounding then never makes
ruckig's target speed just out of reach."""

SPEED_SLACK = 1e-7
"""Speed by which a state may exceed the limit of its zone by rounding, m/s."""

LEAST_ZONE = 1e-6
"""Shortest zone, m: a shorter one is left over by rounding."""

BISECTIONS = 30
"""Number of halvings of an interval of speeds."""


class SpeedZone(NamedTuple):
    """A stretch of a path, m, with one speed limit, m/s."""

    length: float
    speed: float


def time_parameterize(
    start: State, zones: Sequence[SpeedZone], limits: AxisLimits
) -> Profile | None:
    """Return the fastest motion through zones of limited speed to rest at the end of the last.

    Zones are left at speeds, without acceleration, that a pass from the end and one from the start
    make reachable (Bobrow, Dubowsky, Gibson, "Time-Optimal Control of Robotic Manipulators Along
    Specified Paths", IJRR 1985, with jerk). A state that is too fast for that is calmed first.

    Args:
        start: State where the first zone begins, its velocity 0 or more.
        zones: Zones in order; all limits above 0.
        limits: Acceleration and jerk.

    Returns:
        The profile, or None if not even a stop fits into the zones.
    """
    if max(start.velocity, settled_velocity(start, limits)) <= zones[0].speed:
        legs = _cross(start, zones, limits)
        if legs is not None:
            return join(legs)
    calm = _calm_speed(start, zones, limits)
    for share in (1.0, 0.5, 0.25, 0.0):
        calming = change_speed(start, share * calm, limits)
        rest = _cut(zones, calming.end.position - start.position)
        legs = _cross(calming.end, rest, limits) if rest else None
        if legs is not None:
            return join([calming, *legs])
    return None


def keeps_limits(start: State, zones: Sequence[SpeedZone], limits: AxisLimits) -> bool:
    """Return whether a motion to rest at the end of the last zone keeps the speed of each."""
    fastest = max(start.velocity, settled_velocity(start, limits))
    if fastest > zones[0].speed + SPEED_SLACK:
        return False
    leaving = _leaving_speeds(zones, limits)[0]
    return _first_leaving(start, zones[0].length, leaving, limits) is not None


def _leaving_speeds(zones: Sequence[SpeedZone], limits: AxisLimits) -> list[float]:
    """Return the speeds at which the zones can be left to come to rest at the end of the last."""
    leaving = [0.0]  # from the last zone to the first
    for before, zone in reversed(list(itertools.pairwise(zones))):
        reachable = fastest_within(leaving[-1], zone.length, limits)
        leaving.append(min(before.speed, zone.speed, reachable))
    return leaving[::-1]


def _cross(start: State, zones: Sequence[SpeedZone], limits: AxisLimits) -> list[Leg] | None:
    """Return a leg for each zone, or None if the first cannot be left at the speed of the next."""
    leaving = _leaving_speeds(zones, limits)
    first = _first_leaving(start, zones[0].length, leaving[0], limits)
    if first is None:
        return None
    legs: list[Leg] = []
    begin, speed = start, first
    for zone, leaving_speed in zip(zones, leaving, strict=True):
        if legs:
            begin = legs[-1].end
            speed = min(leaving_speed, fastest_within(begin.velocity, zone.length, limits))
        target = State(begin.position + zone.length, speed, 0.0)
        # Rounding must not leave a speed above the limit that ruckig is given.
        limit = max(zone.speed, speed, begin.velocity, settled_velocity(begin, limits))
        legs.append(solve(begin, target, limit, limits))
    return legs


def _first_leaving(start: State, length: float, speed: float, limits: AxisLimits) -> float | None:
    """Return the largest speed, up to `speed`, to hold after `length`; None if too short."""
    covered, room = change_lengths(start, limits), length - SLACK
    if covered(speed) <= room:
        return speed
    low, high = settled_velocity(start, limits), speed
    if high <= low or covered(low) > room:
        return None
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if covered(middle) <= room else (low, middle)
    return low


def _calm_speed(start: State, zones: Sequence[SpeedZone], limits: AxisLimits) -> float:
    """Return the speed at which the acceleration ends soonest within the limits of the zones."""
    speed = settled_velocity(start, limits)
    covered, begin = change_lengths(start, limits), 0.0
    for zone in zones:
        if covered(speed) < begin:
            break
        speed = min(speed, zone.speed)
        begin += zone.length
    return speed


def _cut(zones: Sequence[SpeedZone], distance: float) -> list[SpeedZone]:
    """Return the rest of zones after a distance."""
    rest = []
    for zone in zones:
        left = zone.length - max(distance, 0.0)
        distance -= zone.length
        if left > LEAST_ZONE:
            rest.append(SpeedZone(min(left, zone.length), zone.speed))
    return rest


def settled_velocity(state: State, limits: AxisLimits) -> float:
    """Return the velocity after the fastest change of the acceleration to 0."""
    return state.velocity + 0.5 * state.acceleration * abs(state.acceleration) / limits.jerk


@kernel
def speed_change_distance(a: float, b: float, limits: AxisLimits) -> float:
    """Return the least distance for a change between two speeds held without acceleration.

    The acceleration rises and falls symmetrically, so the mean speed is (a + b) / 2.
    """
    change = abs(b - a)
    if change * limits.jerk >= limits.acceleration * limits.acceleration:
        duration = change / limits.acceleration + limits.acceleration / limits.jerk
    else:
        duration = 2.0 * math.sqrt(change / limits.jerk)
    return 0.5 * (a + b) * duration


@kernel
def fastest_within(speed: float, length: float, limits: AxisLimits) -> float:
    """Return the largest speed that can change to or from `speed` within a length."""
    room = max(length - SLACK, 0.0)
    low, high = speed, speed + math.sqrt(2.0 * limits.acceleration * room)  # without jerk limit
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        if speed_change_distance(speed, middle, limits) <= room:
            low = middle
        else:
            high = middle
    return low


STOP_SAMPLES = 64
"""Number of times at which the speed of a stop is sampled."""

REST_SPEED = 1e-9
"""Speed at which a profile that ended counts as at rest, m/s: rounding can leave it below 0."""


@lru_cache(maxsize=64)  # each decision needs the same few several times
def stopping_distance(speed: float, acceleration: float, limits: MotionLimits) -> float:
    """Return the length of the fastest jerk-limited stop, m."""
    start = feasible_state(0.0, speed, acceleration, limits)
    return jerk_limited.stop(start, limits.along).end


def stopping_speeds(
    speed: float, acceleration: float, limits: MotionLimits, arcs: Floats
) -> Floats:
    """Return the speeds (n,) of the fastest jerk-limited stop at arc lengths (n,), m/s.

    They rise at first where the robot was accelerating.
    """
    motion = jerk_limited.stop(feasible_state(0.0, speed, acceleration, limits), limits.along)
    times = np.linspace(0.0, motion.duration, STOP_SAMPLES)
    speeds: Floats = np.interp(arcs, *motion.motion(times))
    return speeds


def feasible_state(s: float, speed: float, acceleration: float, limits: MotionLimits) -> State:
    """Return a state whose deceleration can end before the speed would turn negative."""
    if not speed >= -REST_SPEED:
        raise ValueError(f"speed: got {speed}, expected 0 or more")
    speed = max(speed, 0.0)  # a profile that ends at rest can miss 0 by a rounding
    return State(s, speed, max(acceleration, -math.sqrt(2.0 * limits.jerk * speed)))
