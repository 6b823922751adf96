"""Checks of the committed path of a decision: collision-free, or one of the exceptions."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wayproof.harness.config import BUILTIN
from wayproof.harness.decision import path_of
from wayproof.harness.judge.body import Discs, track_of
from wayproof.harness.log.paths import Array, arc_lengths, length, rest_of, runs_along, speed_at
from wayproof.harness.replay.audit.moment import Moment, Violation
from wayproof.harness.stack.global_path import STOP_SLACK

SLOWLY = 0.3
"""Fraction of its maximum speed at which a body may leave the inflation."""

SPEED_SLACK = 1.05
"""Tolerance factor of speeds, read from samples 0.1 s apart."""

NEARER = 1.0
"""Distance that a body leaving the inflation may come nearer to forbidden cells, cells."""

NO_ROOM = -np.inf
"""Margin of poses whose centre lies in a forbidden cell."""

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


def judge_way(moment: Moment) -> Way:
    """Sweep the body along the path, or check a stop or a recovery against its rules.

    The path of a late decision is the one before, which was checked with the decision that chose
    it.
    """
    if moment.late:
        return Way("late")
    if not moment.moves:
        return Way("")
    blocked = moment.body.first_blocked(moment.map, moment.poses, moment.margin)
    if blocked is None:
        return Way("swept")
    action = moment.decision.action
    if action == "recover":
        return Way("recovery", tuple(_check_recovery(moment)))
    if (action == "stop_and_wait" or _comes_to_rest(moment)) and _is_last_resort(moment):
        return Way("stop", tuple(_check_stop(moment)))
    place, state = blocked
    at = ", ".join(f"{value:.2f}" for value in place)
    text = f"action {action}: the body at ({at}) would overlap {state} space"
    return Way("swept", (moment.broken("swept", text),))


def _check_recovery(moment: Moment) -> list[Violation]:
    """Check that a path out of the inflation is slow, comes no nearer to cells, and leads out."""
    body, poses, margin = moment.body, moment.poses, moment.margin
    ((_, about),) = body.about
    found = []
    if body.first_overlap(moment.map, poses[:1, :3], about + margin) is None:
        found.append("it starts outside of the inflation, and leads through it")
    if body.first_blocked(moment.map, poses[-1:], margin) is not None:
        found.append("its end is no admitted place")
    allowed = SLOWLY * moment.mission.max_speed * moment.config.motion.speed_fraction
    fastest = _speeds(moment).max(initial=0.0)
    if fastest > allowed * SPEED_SLACK:
        found.append(f"{fastest:.2f} m/s, {allowed:.2f} allowed on the way out of the inflation")
    # The inflation is that of its discs at the heading, or of the circumscribed disc.
    if all(_comes_nearer(moment, discs) for discs in (body.discs, body.about)):
        found.append("it comes nearer to what blocks it, by more than a cell")
    if _runs_into(moment):
        found.append("the bare body overlaps an occupied cell, deeper than at its start")
    return [moment.broken("recover", text) for text in found]


def _comes_nearer(moment: Moment, discs: Discs) -> bool:
    """Return whether any disc comes nearer to forbidden cells than the nearest one at the start."""
    body, poses = moment.body, moment.poses
    reach = max(radius for _, radius in discs) + moment.margin
    reach = reach / moment.map.resolution + body.half_diagonal
    tracks = [track_of(poses, offset) for offset, _ in discs]
    here = min(_distance(moment, track[:1], reach, body.policy == "forbid") for track in tracks)
    least = min(_distance(moment, track, reach, body.policy == "forbid") for track in tracks)
    return least < here - NEARER - ROUNDING


def _runs_into(moment: Moment) -> bool:
    """Return whether a disc without margin overlaps occupied cells more than at the start."""
    for offset, radius in moment.body.discs:
        track, reach = track_of(moment.poses, offset), radius / moment.map.resolution
        here = _distance(moment, track[:1], reach, unknown=False)
        if _distance(moment, track, reach, unknown=False) < here - NEARER - ROUNDING:
            return True
    return False


def _distance(moment: Moment, track: Array, reach: float, unknown: bool) -> float:
    """Return the least distance of a track to occupied cells, or unknown ones too, cells."""
    cells = moment.body.cells(moment.map, track, reach * moment.map.resolution)
    wrong = cells.not_free if unknown else cells.occupied
    return cells.least_distance(cells.touched(track), wrong, reach)


def _comes_to_rest(moment: Moment) -> bool:
    """Return whether all that the built-in stack drives is the end of a stop, by whatever name."""
    return moment.config.stack.name == BUILTIN and length(moment.path) <= STOP_SLACK


def _is_last_resort(moment: Moment) -> bool:
    """Return whether a stop that is not collision-free is the only option.

    It follows a path that was free in an earlier map; or it leaves that path, which is blocked in
    this map as well, and comes no nearer to the cells in the way.
    """
    poses, path = moment.poses, moment.path
    ways = [path_of(earlier.path) for earlier in moment.before]
    if any(runs_along(path, way) for way in ways):
        return True
    ahead = rest_of(ways[-1], path[0], length(path))
    if len(ahead) < 2:
        return False
    ahead = np.concatenate((path[:1], ahead))  # the cell that it stands in may be the blocked one
    steps = np.vstack((np.diff(ahead, axis=0), ahead[-1:] - ahead[-2:-1]))
    along = np.arctan2(steps[:, 1], steps[:, 0])
    arcs = arc_lengths(poses[:, :3]), np.unwrap(poses[:, 3])
    as_driven = np.interp(arc_lengths(ahead), *arcs)  # a body turns no faster on the way before
    return any(
        _keeps_distance(moment, np.column_stack((ahead, headings)))
        for headings in (along, as_driven)
    )


def _keeps_distance(moment: Moment, straight_on: Array) -> bool:
    """Return whether a path comes no nearer to cells than another one (n, 4), which is blocked.

    Where the centre of the body enters a forbidden cell on both, its end decides.
    """
    if moment.body.first_blocked(moment.map, straight_on, moment.margin) is None:
        return False
    for poses, way in ((moment.poses, straight_on), (moment.poses[-1:], straight_on[-1:])):
        kept = _admitted_margin(moment, poses)
        if kept != _admitted_margin(moment, way):
            return kept > _admitted_margin(moment, way)
        if kept > NO_ROOM:
            return True
    return False  # both end within forbidden cells, and straight on is the way that was chosen


def _admitted_margin(moment: Moment, poses: Array) -> float:
    """Return the widest margin at which poses are free, in halves of a cell; or `NO_ROOM`."""
    step = 0.5 * moment.map.resolution
    for narrower in np.arange(0.0, moment.margin + moment.mission.radius, step):
        if moment.body.first_blocked(moment.map, poses, moment.margin - narrower) is None:
            return float(moment.margin - narrower)
    return NO_ROOM


def _check_stop(moment: Moment) -> list[Violation]:
    """Check that a stop that is not collision-free brakes at once at the limits of the body."""
    mission, period = moment.mission, moment.decision.trajectory.sample_period_s
    speeds = _speeds(moment)
    start_ns = moment.decision.trajectory.start.ToNanoseconds()
    ramp = mission.max_acceleration / mission.max_jerk  # s
    # It may have been speeding up, which ends after one ramp; another one ends the braking.
    peak = speed_at(moment.before[-1], start_ns) + mission.max_acceleration * (ramp + period)
    longest = peak / mission.max_acceleration + 2.0 * ramp + 2.0 * period
    if len(speeds) * period <= longest and speeds.max(initial=0.0) <= peak * SPEED_SLACK:
        return []
    text = f"stops within {len(speeds) * period:.1f} s, {longest:.1f} s is what braking takes"
    return [moment.broken("stop", text)]


def _speeds(moment: Moment) -> Array:
    """Return the mean speeds between the samples of the trajectory, (n,) m/s."""
    trajectory = moment.decision.trajectory
    speeds: Array = np.diff(np.array(trajectory.arc_length)) / trajectory.sample_period_s
    return speeds
