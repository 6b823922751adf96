"""Speed zones of a path: where its curvature and the turns of the body limit the speed."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from wayproof.kernel_compiler import kernel
from wayproof.planners.kernels.angles import edge_headings
from wayproof.planners.kernels.curvature import limit_speeds
from wayproof.planners.kernels.grid import Floats
from wayproof.planners.path import arc_lengths, edge_lengths, edge_tangents, speed_limits
from wayproof.planners.speed_profile import LEAST_ZONE, SpeedZone
from wayproof.planners.trajectory import MotionLimits

TURNING = 0.25
"""Heading error from which on a body that moves still turns into its path, rad."""

OBLIQUE = ((1.05, 1.0), (0.79, 1.15), (0.52, 1.4), (0.35, 2.0), (TURNING, 2.9))
"""Turns left, rad, and the speed above each in sideways speeds: the inverse of the sine of the
turn at which it begins, so that the part across the body keeps to the sideways speed."""

TURN_LAG = 0.3
"""Time that a body takes to begin and to end a turn while it moves, s."""

LEAST_SPEED = 0.02
"""Smallest speed limit, m/s: below it a profile would take hours."""


class SlowEnd(NamedTuple):
    """A speed limit from an arc length of a path on, such as where space is unknown."""

    begin: float  # m
    speed: float  # m/s; at least LEAST_SPEED counts


def speed_zones(
    path: Floats,
    s: float,
    cap: float,
    limits: MotionLimits,
    sideways_speed: float = 0.0,
    speed: float = math.inf,
) -> list[SpeedZone]:
    """Cut a path from an arc length on where its curvature begins or ceases to limit the speed.

    Args:
        path: Shape (n, 3), m.
        s: Arc length at which the first zone begins, m.
        cap: Speed limit where the path is straight, m/s.
        limits: Limits of the robot.
        sideways_speed: Speed at which it need not have turned into the path, m/s.
        speed: Speed at `s`, m/s. A bend that begins or ends a path that was cut there has its zone
            to the end, as it would be left without acceleration 1 cm on; unless this is too fast.
    """
    arcs = arc_lengths(path)
    allowed = _allowed(path, arcs, limits, sideways_speed)
    if len(path) > 2 and speed < math.inf:
        allowed[-1] = allowed[-2]
        zones = _zones(arcs, np.append(allowed[1], allowed[1:]), s, cap)
        if zones and speed <= zones[0].speed:
            return zones
    return _zones(arcs, allowed, s, cap)


def _zones(arcs: Floats, allowed: Floats, s: float, cap: float) -> list[SpeedZone]:
    """Return zones from an arc length on, of points (n,) and the speeds that they allow (n,)."""
    lengths, speeds = np.empty(len(arcs)), np.empty(len(arcs))
    count = cut_zones(arcs, allowed, s, cap, lengths, speeds)
    return list(map(SpeedZone, lengths[:count].tolist(), speeds[:count].tolist()))


def _allowed(path: Floats, arcs: Floats, limits: MotionLimits, sideways_speed: float) -> Floats:
    """Return the speeds (n,) that the curvature of a path allows; infinite at its ends.

    A body need not turn with the path at a speed that it has in any direction. Where its turn falls
    behind the path's, it keeps to that speed until it has caught up.
    """
    if sideways_speed <= 0.0:
        return speed_limits(path, limits.lateral_acceleration, limits.yaw_rate)
    lengths, tangents = edge_lengths(path), edge_tangents(path)
    headings, acceleration = edge_headings(tangents, 0.0), limits.lateral_acceleration
    turning = limit_speeds(lengths, tangents, headings, acceleration, limits.yaw_rate)
    lateral = limit_speeds(lengths, tangents, headings, acceleration, math.inf)
    turns = np.abs(np.diff(headings))  # (n - 2,)
    speeds: Floats = np.minimum(lateral, np.maximum(turning, sideways_speed))
    slow_while_behind(arcs, turns, turning, limits.yaw_rate, sideways_speed, speeds)
    return speeds


@kernel
def slow_while_behind(
    arcs: Floats,  # (n,)
    turns: Floats,  # (n - 2,) of the path at its inner points, rad, not negative
    allowed: Floats,  # (n,) speeds of a body that turns with the path
    yaw_rate: float,
    sideways_speed: float,
    speeds: Floats,  # (n,) in, out
) -> None:
    """Limit the speeds at which the heading has not caught up with the path's yet."""
    behind = 0.0  # rad
    for k in range(1, len(arcs)):
        taken = (arcs[k] - arcs[k - 1]) / sideways_speed
        behind = max(behind - yaw_rate * taken, 0.0)
        if k <= len(turns) and allowed[k] < sideways_speed:
            behind += turns[k - 1]
        if behind > TURNING:
            speeds[k] = min(speeds[k], sideways_speed)


def slow_while_turning(
    zones: list[SpeedZone],
    turn: float,
    yaw_rate: float,
    sideways_speed: float,
    by_direction: bool = False,
) -> list[SpeedZone]:
    """Limit the speed until the body has turned into the path, by a turn of more than `TURNING`.

    Args:
        zones: Zones of the path.
        turn: Turn that is left, rad, not negative.
        yaw_rate: rad/s.
        sideways_speed: Speed until then, m/s.
        by_direction: Whether only the part of the speed across the body is limited to that.
    """
    if turn <= TURNING:
        return zones
    if not by_direction:
        return slow_at_first(zones, sideways_speed * (turn / yaw_rate + TURN_LAG), sideways_speed)
    slowed, lag = [], TURN_LAG
    for above, share in OBLIQUE:
        if turn > above:
            speed = share * sideways_speed
            length = speed * ((turn - above) / yaw_rate + lag)
            first, zones = _split(zones, length)
            slowed += slow_at_first(first, length, speed)
            turn, lag = above, 0.0
    return slowed + zones


def _split(zones: list[SpeedZone], length: float) -> tuple[list[SpeedZone], list[SpeedZone]]:
    """Split zones at a length from their beginning, m; without pieces that are no length."""
    first, rest = [], []
    for zone in zones:
        before = min(zone.length, max(length, 0.0))
        length -= zone.length
        if before > LEAST_ZONE:
            first.append(SpeedZone(before, zone.speed))
        if zone.length - before > LEAST_ZONE:
            rest.append(SpeedZone(zone.length - before, zone.speed))
    return first, rest


def slow_at_end(zones: list[SpeedZone], length: float, speed: float) -> list[SpeedZone]:
    """Limit the speed beyond a length, m, to a speed, m/s."""
    first, rest = _split(zones, length)
    return first + [
        SpeedZone(zone.length, min(zone.speed, max(speed, LEAST_SPEED))) for zone in rest
    ]


def slow_at_first(zones: list[SpeedZone], length: float, speed: float) -> list[SpeedZone]:
    """Limit the speed over a first length, m, to a speed, m/s."""
    slowed = []
    for zone in zones:
        first = min(zone.length, length)
        length -= first
        if first > LEAST_ZONE:
            slowed.append(SpeedZone(first, min(zone.speed, speed)))
        if zone.length - first > LEAST_ZONE:
            slowed.append(SpeedZone(zone.length - first, zone.speed))
    return slowed


@kernel
def cut_zones(
    arcs: Floats,  # (n,)
    allowed: Floats,  # (n,) speeds
    s: float,
    cap: float,
    lengths: Floats,  # (n,) out
    speeds: Floats,  # (n,) out
) -> int:
    """Cut a path into runs of slow and of fast points; return their number."""
    count = 0
    begin, speed = s, np.inf
    for k in range(len(arcs)):
        speed = min(speed, max(min(allowed[k], cap), LEAST_SPEED))
        last = k == len(arcs) - 1
        if not last and (allowed[k] < cap) == (allowed[k + 1] < cap):
            continue
        end = arcs[k] if last else 0.5 * (arcs[k] + arcs[k + 1])
        if end - begin > LEAST_ZONE:
            lengths[count], speeds[count] = end - begin, speed
            count += 1
        begin, speed = max(end, s), np.inf
    return count
