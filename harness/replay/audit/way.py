"""Checks of the committed path of a decision: collision-free, or one of the exceptions."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wayproof.harness.decision import path_of
from wayproof.harness.judge.body import Discs, track_of
from wayproof.harness.log.paths import (
    SAME_PLACE,
    Array,
    arc_lengths,
    rest_of,
    runs_along,
    speed_at,
)
from wayproof.harness.replay.audit.committed import Committed, Violation

SLOWLY = 0.3
"""Fraction of its maximum speed at which a body may leave the inflation."""

SPEED_SLACK = 1.05
"""Tolerance factor of speeds, read from samples 0.1 s apart."""

NEARER = 1.0
"""Distance that a body leaving the inflation may come nearer to forbidden cells, cells."""

ALIKE = 0.5
"""Difference of the distances of two ways from forbidden cells that is that of samples, cells."""

ROUNDING = 1e-6
"""Tolerance of a distance, cells."""


@dataclass(frozen=True)
class Way:
    """Kind of the path of a decision, and its violations.

    Attributes:
        kind: `swept`, `stop`, `recovery` or `late`; empty if the body does not move.
        violations: Violations.
    """

    kind: str
    violations: tuple[Violation, ...] = ()


def judge_way(committed: Committed) -> Way:
    """Sweep the body along the path, or check a stop or a recovery against its rules.

    The path of a late decision is the one before, which was checked with the decision that chose
    it.
    """
    if committed.late:
        return Way("late")
    if not committed.moves:
        return Way("")
    blocked = committed.body.first_blocked(committed.map, committed.poses, committed.margin)
    if blocked is None:
        return Way("swept")
    action = committed.decision.action
    if action == "recover":
        return Way("recovery", tuple(_check_recovery(committed)))
    if (action == "stop_and_wait" or _comes_to_rest(committed)) and _is_forced(committed):
        return Way("stop", tuple(_check_stop(committed)))
    place, state = blocked
    at = ", ".join(f"{value:.2f}" for value in place)
    text = f"action {action}: the body at ({at}) would overlap {state} space"
    return Way("swept", (committed.broken("swept", text),))


def _check_recovery(committed: Committed) -> list[Violation]:
    """Check that a path out of the inflation is slow, comes no nearer to cells, and leads out."""
    body, poses, margin = committed.body, committed.poses, committed.margin
    found = []
    if body.first_overlap(committed.map, poses[:1, :3], body.radius + margin) is None:
        found.append("it starts outside of the inflation, and leads through it")
    if body.first_blocked(committed.map, poses[-1:], margin) is not None:
        found.append("its end is no admitted place")
    allowed = SLOWLY * committed.mission.max_speed * committed.config.motion.speed_fraction
    fastest = _speeds(committed).max(initial=0.0)
    if fastest > allowed * SPEED_SLACK:
        found.append(f"{fastest:.2f} m/s, {allowed:.2f} allowed on the way out of the inflation")
    # The inflation is that of its discs at the heading, or of the circumscribed disc.
    if all(_comes_nearer(committed, discs) for discs in (body.discs, body.about)):
        found.append("it comes nearer to what blocks it, by more than a cell")
    if _runs_into(committed):
        found.append("the bare body overlaps an occupied cell, deeper than at its start")
    return [committed.broken("recover", text) for text in found]


def _comes_nearer(committed: Committed, discs: Discs) -> bool:
    """Return whether any disc comes nearer to forbidden cells than the nearest one at the start."""
    here, least = (_room(committed, one, discs) for one in (committed.poses[:1], committed.poses))
    return least < here - NEARER - ROUNDING


def _runs_into(committed: Committed) -> bool:
    """Return whether a disc without margin overlaps occupied cells more than at the start."""
    for offset, radius in committed.body.discs:
        track, reach = track_of(committed.poses, offset), radius / committed.map.resolution
        here = _distance(committed, track[:1], reach, unknown=False)
        if _distance(committed, track, reach, unknown=False) < here - NEARER - ROUNDING:
            return True
    return False


def _room(committed: Committed, poses: Array, discs: Discs) -> float:
    """Return the least distance of discs at poses to forbidden cells, cells; at most what is free.

    0 where the centre of one lies in such a cell.
    """
    body = committed.body
    reach = body.reach(max(radius for _, radius in discs) + committed.margin)
    tracks = [track_of(poses, offset) for offset, _ in discs]
    return min(_distance(committed, one, reach, body.policy == "forbid") for one in tracks)


def _distance(committed: Committed, track: Array, reach: float, unknown: bool) -> float:
    """Return the least distance of a track to occupied cells, or unknown ones too, cells."""
    cells = committed.body.cells(committed.map, track, reach * committed.map.resolution)
    return cells.least_distance(cells.touched(track), cells.wrong(unknown), reach)


def _comes_to_rest(committed: Committed) -> bool:
    """Return whether the built-in stack goes no farther, whatever it calls that; others creep."""
    return not committed.on_trial and committed.length < SAME_PLACE


def _is_forced(committed: Committed) -> bool:
    """Return whether a body that is not free along its path could do no better.

    It follows what was admitted when it was chosen; or it leaves that, which is blocked by now, and
    comes no nearer to the cells in the way.
    """
    ways = [path_of(earlier.path) for earlier in committed.before]
    if any(runs_along(committed.path, way) for way in ways):
        return True
    straight_on = _straight_on(committed)
    if committed.body.first_blocked(committed.map, straight_on, committed.margin) is None:
        return False
    discs = committed.body.discs
    for poses, others in ((committed.poses, straight_on), (committed.poses[-1:], straight_on[-1:])):
        kept, otherwise = _room(committed, poses, discs), _room(committed, others, discs)
        if max(kept, otherwise) > 0.0:
            return kept > otherwise - ALIKE
    return False  # both end within forbidden cells, and straight on is what was chosen


def _straight_on(committed: Committed) -> Array:
    """Return poses (n, 4) of the trajectory before, as far as the one committed to leads."""
    before, trajectory = committed.before[-1], committed.decision.trajectory
    reach = committed.length
    if committed.mission.discs:
        ahead = committed.body.poses(before, trajectory.start.ToNanoseconds())
        ahead = ahead[arc_lengths(ahead[:, :3]) <= reach]
    else:
        rest = rest_of(path_of(before.path), committed.path[0], reach)
        ahead = np.column_stack((rest, np.zeros(len(rest))))
    return np.vstack((committed.poses[:1], ahead))  # its own cell may be the blocked one


def _check_stop(committed: Committed) -> list[Violation]:
    """Check that a stop that is not collision-free brakes at once at the limits of the body."""
    mission, period = committed.mission, committed.decision.trajectory.sample_period_s
    speeds = _speeds(committed)
    start_ns = committed.decision.trajectory.start.ToNanoseconds()
    ramp = mission.max_acceleration / mission.max_jerk  # s
    # It may have been speeding up, which ends after one ramp; another one ends the braking.
    peak = speed_at(committed.before[-1], start_ns) + mission.max_acceleration * (ramp + period)
    longest = peak / mission.max_acceleration + 2.0 * ramp + 2.0 * period
    if len(speeds) * period <= longest and speeds.max(initial=0.0) <= peak * SPEED_SLACK:
        return []
    text = f"stops within {len(speeds) * period:.1f} s, {longest:.1f} s is what braking takes"
    return [committed.broken("stop", text)]


def _speeds(committed: Committed) -> Array:
    """Return the mean speeds between the samples of the trajectory, (n,) m/s."""
    trajectory = committed.decision.trajectory
    speeds: Array = np.diff(np.array(trajectory.arc_length)) / trajectory.sample_period_s
    return speeds
