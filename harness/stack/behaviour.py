"""Choosing the next action from the costmap: one pure function and the memory it carries on.

The robot walks a *guide*, a path to the goal through space that is not known to be blocked. Of it,
only the *committed* part may be entered: the part that the unknown policy admits, ending at rest.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from wayproof.harness.stack import obstruction
from wayproof.harness.stack.backtrack import trodden, way_back
from wayproof.harness.stack.decision import Action, Label
from wayproof.harness.stack.diagnosis import (
    BRAKES,
    WAITS,
    ahead,
    errand_reason,
    inside,
    why_it_drives,
    why_no_path,
    why_no_room,
    why_without_path,
)
from wayproof.harness.stack.evasive_stop import clearest_stop
from wayproof.harness.stack.footprint_checks import (
    LEAST_STEP,
    as_it_faces,
    fits,
    fits_along,
    leads_away,
    poses_from,
    tail_first,
    to_where_it_turns,
    ways_to_face,
    wrapped,
)
from wayproof.harness.stack.global_path import (
    ARRIVED,
    HEADINGS,
    apart,
    heading_at,
    keep_or_replan_guide,
    place_for_goal,
)
from wayproof.harness.stack.reasons import Reason
from wayproof.harness.stack.types import (
    Array,
    Choice,
    Errand,
    GivenUp,
    Memory,
    View,
    distance,
    length,
    standing,
)
from wayproof.planners import (
    Plan,
    Trajectory,
    TrajectorySample,
    best_frontier,
    blend_corners,
    first_stop,
    follow_path,
    hold,
    plan,
    plan_seed,
    remaining,
    stop_along,
    stopping_distance,
    truncate,
    turn_in_place,
)

ALIGNED = 0.05
"""A heading this near to the one that is asked for is that one, rad."""

CUTS = 4
"""How often a path is cut short to make the body fit along it."""

CUT_SHORT = 0.02
"""So far before the first place where it does not, m."""

OVERRUN = 0.03
"""A long body that stops so far beyond a corner turns there all the same, m."""

FRONTIERS = 4
"""How many frontiers a long body, which cannot get to each, tries to plan to."""

WAY_OUT = 1.0
"""A way out of the inflation is at most so long, m."""

TURNS_OUT = [sign * 0.1 * n for n in range(1, 9) for sign in (1, -1)]
"""By what a body turns to get out of the inflation, rad."""


def decide(view: View, memory: Memory) -> tuple[Choice, Memory]:
    """Choose the next action; the same view and memory always give the same choice."""
    committed = (*memory.earlier, memory.trajectory)
    begun = [k for k, trajectory in enumerate(committed) if trajectory.start_ns <= view.time_ns]
    committed = committed[begun[-1] if begun else 0 :]
    choice, after = _choose(view, trodden(memory, view), committed[0])
    given_up = _given_up(view, memory, choice) if after.guide is None else None
    return choice, replace(after, earlier=committed, given_up=given_up)


def _given_up(view: View, memory: Memory, choice: Choice) -> GivenUp:
    """Since when there is no guide: since an earlier decision, or since this one."""
    if memory.given_up is not None and choice.reason.since == memory.given_up.sequence:
        return memory.given_up
    return GivenUp(view.sequence, choice.reason.kind, choice.label)


def _choose(view: View, memory: Memory, followed: Trajectory) -> tuple[Choice, Memory]:
    """The action, given the trajectory that the robot follows while the sweep is taken."""
    believed = followed.at(view.time_ns)
    if distance(view.position, believed.position) > view.behaviour.tracking_tolerance:
        return _anchor_again(view, memory, believed)
    now = as_it_faces(view, believed, memory.trajectory.at(view.effect_ns))
    if believed.at_rest and distance(view.position, view.goal) <= view.goal_tolerance:
        return _arrive(view, memory, now)
    if standing(now) and not fits(view.admitted, now):
        return _escape(view, memory, now)
    target = place_for_goal(view)
    if target is not view.goal and believed.at_rest and distance(now.position, target) < ARRIVED:
        return _wait_at_goal(view, memory, now)
    view = replace(view, goal=target, mission_goal=view.goal)
    before = memory
    memory, search, seed = keep_or_replan_guide(view, memory, now)
    if memory.guide is None:
        choice, memory = _stop_or_wait(view, memory, now, before, search)
    else:
        choice, memory = _advance(view, memory, now, memory.guide, before)
    if choice.search is None:  # an errand's search is the one that was acted on
        choice = replace(choice, search=search, search_seed=seed)
    return choice, memory


def _anchor_again(view: View, memory: Memory, believed: TrajectorySample) -> tuple[Choice, Memory]:
    """The robot left its trajectory: hold where it is believed to be, and plan from there."""
    trajectory = hold(view.position, view.effect_ns, view.heading)
    reason = Reason(
        "off_trajectory",
        distance_m=distance(view.position, believed.position),
        limit_m=view.behaviour.tracking_tolerance,
    )
    choice = Choice("recover", reason, "localization_lost", trajectory)
    return choice, replace(memory, trajectory=trajectory, guide=None)


def _arrive(view: View, memory: Memory, now: TrajectorySample) -> tuple[Choice, Memory]:
    trajectory = hold(now.position, view.effect_ns, now.heading)
    left = distance(view.position, view.goal)
    reason = Reason("at_goal", distance_m=left, limit_m=view.goal_tolerance)
    return Choice("goal", reason, "none", trajectory), replace(memory, trajectory=trajectory)


def _wait_at_goal(view: View, memory: Memory, now: TrajectorySample) -> tuple[Choice, Memory]:
    """As near to a blocked goal as can be: wait for it to become free, then give up."""
    trajectory = hold(now.position, view.effect_ns, now.heading)
    since = view.time_ns if memory.rest_since_ns < 0 else memory.rest_since_ns
    waited = (view.time_ns - since) * 1e-9
    memory = replace(memory, trajectory=trajectory, rest_since_ns=since, guide=None)
    found = obstruction.at_place(view, view.goal, float(HEADINGS[0]), unknown_blocks=False)
    away = distance(now.position, view.goal)
    reason = inside("goal_inside_inflation", found, distance_m=away, waited_s=waited)
    action: Action = "abort" if waited >= view.behaviour.goal_patience else "stop_and_wait"
    return Choice(action, reason, "goal_blocked", trajectory), memory


def _escape(view: View, memory: Memory, now: TrajectorySample) -> tuple[Choice, Memory]:
    """The body stands inside the inflation: step to the nearest admitted place, straight."""
    target, heading = _way_out(view, now)
    found = obstruction.at_place(view, now.position, now.heading, view.unknown_blocks)
    if target is None:
        reason = inside("no_way_out", found, limit_m=WAY_OUT)
        return _wait(view, memory, now, "start_blocked", reason)
    away = distance(now.position, target)
    # Away from what is unknown may be towards an obstacle, which is worse.
    if not all(leads_away(one, now, target, heading) for one in (view.admitted, view.passable)):
        reason = inside("way_out_blocked", found, distance_m=away)
        return _wait(view, memory, now, "start_blocked", reason)
    path = np.stack([now.position, target])
    if heading == now.heading:
        trajectory = _profile(view, now, path, speed_share=0.3)
        reason = inside("escaping_inflation", found, distance_m=away)
        if view.admitted.discs:
            trajectory = trajectory.facing(heading)
    else:
        start = now.position, view.effect_ns, now.heading
        trajectory = turn_in_place(*start, heading, view.limits)
        turn = wrapped(heading - now.heading)
        reason = inside("turning_out_of_inflation", found, turn_rad=turn)
    choice = Choice("recover", reason, "start_blocked", trajectory, path)
    return choice, replace(memory, trajectory=trajectory, guide=None, errand=None, rest_since_ns=-1)


def _way_out(view: View, now: TrajectorySample) -> tuple[Array | None, float]:
    """The nearest admitted place at the present heading, or the heading nearest to it here."""
    space = view.admitted
    if not space.discs:
        return space.nearest_free(now.position, WAY_OUT), now.heading
    pose = space.nearest_pose(now.position, WAY_OUT, np.array([now.heading]))
    moved = np.inf if pose is None else distance(now.position, pose[:3])
    for turn in TURNS_OUT:
        if abs(turn) < moved and space.pose_free(now.position, now.heading + turn):
            return now.position, now.heading + turn
    return (None if pose is None else pose[:3]), now.heading


def _stop_or_wait(
    view: View, memory: Memory, now: TrajectorySample, before: Memory, search: Plan | None
) -> tuple[Choice, Memory]:
    """No guide: brake along the old trajectory if moving, else wait for the map to change."""
    if search is not None and standing(now):
        return _wait(view, memory, now, search.label, why_no_path(view, search))
    path = remaining(memory.trajectory.path, now.arc_length)
    if search is not None:
        stop = stopping_distance(now.speed, now.acceleration, view.limits)
        reason = replace(why_no_path(view, search), stop_m=stop)
        return _brake(view, memory, now, path, reason, search.label)
    reason, label = why_without_path(view, before, now)
    choice, memory = _brake(view, memory, now, path, reason, label)
    if reason.path_m is not None:
        reason = replace(reason, path_m=length(choice.trajectory.path))
    return replace(choice, reason=reason), memory


def _advance(
    view: View, memory: Memory, now: TrajectorySample, guide: Array, before: Memory
) -> tuple[Choice, Memory]:
    """Commit to the admitted part of the guide, ending at rest; `before` has the last guide."""
    admitted = view.admitted.free_length(guide)
    corner = first_stop(guide, 0.0, view.behaviour.stop_corner)
    braking = stopping_distance(now.speed, now.acceleration, view.limits)
    overrun = OVERRUN if view.admitted.discs else 0.0
    if corner < braking - overrun:  # too late to stop there: the profile slows down for it
        corner = length(guide)
    end = min(admitted, corner, length(guide))
    blocked = end == admitted and admitted < length(guide)
    if end < braking - 1e-3 - (overrun if end == corner else 0.0):
        return _brake_on_guide(view, memory, now, guide, end, blocked)
    if standing(now) and blocked and end < view.behaviour.least_advance:
        least = view.behaviour.least_advance
        found = obstruction.on_path(view, guide, end, view.unknown_blocks)
        reason, label = ahead(WAITS, found, limit_m=least)
        return _wait(view, memory, now, label, reason)
    if standing(now) and view.admitted.discs:
        return _set_out(view, memory, now, guide, end, blocked)
    if standing(now) and view.turns_in_place:
        target = heading_at(guide, min(0.2, 0.5 * length(guide)))
        if abs(wrapped(target - now.heading)) > view.behaviour.turn_first:
            return _turn(view, memory, now, guide, target)
    choice = _follow(view, memory, now, guide, end, blocked, tail_first(view, now, guide))
    return choice or _keep_course(view, memory, now, before)


def _brake_on_guide(
    view: View, memory: Memory, now: TrajectorySample, guide: Array, end: float, blocked: bool
) -> tuple[Choice, Memory]:
    """Less of the guide may be entered than the robot needs to stop."""
    braking = stopping_distance(now.speed, now.acceleration, view.limits)
    path = truncate(guide, max(end, 1e-3))
    if not blocked:
        reason = Reason("path_too_short", path_m=end, stop_m=braking)
        return _brake(view, memory, now, path, reason, "none")
    found = obstruction.on_path(view, guide, end, view.unknown_blocks)
    return _brake(view, memory, now, path, *ahead(BRAKES, found, stop_m=braking))


def _set_out(
    view: View, memory: Memory, now: TrajectorySample, guide: Array, end: float, blocked: bool
) -> tuple[Choice, Memory]:
    """From rest, nose first; where the body cannot turn about, as it stands, perhaps tail first."""
    nose_first = heading_at(guide, min(0.1, 0.5 * length(guide)))
    for target, backwards in ways_to_face(view.admitted, now, nose_first):
        error = abs(wrapped(target - now.heading))
        if error <= view.behaviour.turn_first:
            chosen = _follow(view, memory, now, guide, end, blocked, backwards)
            if chosen is not None:
                return chosen
        if error > ALIGNED:
            return _turn(view, memory, now, guide, target)
    memory = replace(memory, guide=None)
    reason = why_no_room(view, now, _profile(view, now, truncate(guide, end), 1.0), nose_first)
    return _wait(view, memory, now, "no_path", reason)


def _keep_course(
    view: View, memory: Memory, now: TrajectorySample, before: Memory
) -> tuple[Choice, Memory]:
    """The body does not fit along the new path in motion: go on as before, or stop on that way."""
    trajectory = before.trajectory
    begun = (view.effect_ns - trajectory.start_ns) * 1e-9
    if fits_along(view.admitted, trajectory, begun) is None:
        choice = Choice("follow", Reason("keeping_course"), "none", trajectory, before.guide)
        return choice, replace(before, improved_ns=memory.improved_ns)
    found = obstruction.on_poses(view, poses_from(trajectory, begun), view.unknown_blocks)
    path = remaining(trajectory.path, now.arc_length)
    stop = stopping_distance(now.speed, now.acceleration, view.limits)
    return _brake(view, memory, now, path, *ahead(BRAKES, found, stop_m=stop))


def _follow(
    view: View,
    memory: Memory,
    now: TrajectorySample,
    guide: Array,
    end: float,
    blocked: bool,
    backwards: bool,
) -> tuple[Choice, Memory] | None:
    """Drive the guide to an end; None if the body does not fit along that, or along too little."""
    path = truncate(guide, end)
    if backwards:
        least = stopping_distance(now.speed, now.acceleration, view.limits)
        path = to_where_it_turns(view.admitted, path, least)
    unknown_ahead = view.penalize_unknown and view.known.free_length(path) < length(path)
    share = view.behaviour.penalized_speed if unknown_ahead else 1.0
    trajectory = _fitting(view, now, path, share, backwards)
    if trajectory is None:
        return None
    action, reason, label = why_it_drives(view, memory, now, guide, end, blocked, unknown_ahead)
    choice = Choice(action, reason, label, trajectory, guide)
    return choice, replace(memory, trajectory=trajectory, guide=guide, rest_since_ns=-1)


def _fitting(
    view: View, now: TrajectorySample, path: Array, share: float, backwards: bool
) -> Trajectory | None:
    """The trajectory along a path, or as far along it as the body fits at each heading."""
    if backwards:
        share = min(share, view.behaviour.backwards_speed)
    least = stopping_distance(now.speed, now.acceleration, view.limits)
    for _ in range(CUTS):
        trajectory = _profile(view, now, path, share, backwards)
        fitting = fits_along(view.admitted, trajectory)
        if fitting is None:
            return trajectory
        end = fitting - CUT_SHORT
        if end < max(least, LEAST_STEP):
            return None
        path = truncate(path, end)
    return None


def _turn(
    view: View, memory: Memory, now: TrajectorySample, guide: Array, target: float
) -> tuple[Choice, Memory]:
    trajectory = memory.trajectory
    if now.at_rest or abs(wrapped(target - _final_heading(trajectory))) > 0.2:
        trajectory = turn_in_place(now.position, view.effect_ns, now.heading, target, view.limits)
    reason = Reason("turning_into_path", turn_rad=wrapped(target - now.heading))
    action: Action = "follow"
    if memory.errand is not None:
        action, reason = errand_reason(memory, guide)
    choice = Choice(action, reason, "none", trajectory, guide)
    return choice, replace(memory, trajectory=trajectory, guide=guide, rest_since_ns=-1)


def _wait(
    view: View, memory: Memory, now: TrajectorySample, label: Label, reason: Reason
) -> tuple[Choice, Memory]:
    """Stay at rest; after `patience` look from elsewhere, after `tries` of that abort."""
    trajectory = hold(now.position, view.effect_ns, now.heading)
    since = view.time_ns if memory.rest_since_ns < 0 else memory.rest_since_ns
    waited = (view.time_ns - since) * 1e-9
    memory = replace(memory, trajectory=trajectory, rest_since_ns=since)
    reason = replace(reason, waited_s=waited)
    if waited < view.behaviour.patience:
        return Choice("stop_and_wait", reason, label, trajectory, memory.guide), memory
    if len(memory.visited) >= view.behaviour.tries:
        reason = replace(reason, places=len(memory.visited))
        return Choice("abort", reason, label, trajectory, memory.guide), memory
    return _look_from_elsewhere(view, memory, now, label, reason)


def _look_from_elsewhere(
    view: View, memory: Memory, now: TrajectorySample, label: Label, reason: Reason
) -> tuple[Choice, Memory]:
    """Set out for the best frontier that the robot can reach; without one, wait once more."""
    visited = np.vstack([memory.visited, now.position])
    memory = replace(memory, visited=visited, rest_since_ns=-1)
    seed = plan_seed(view.seed, "errand", view.sequence)
    search = _search_frontier(view, now, visited, seed)
    if search is None or search.waypoints is None:
        back = way_back(view, memory, now)
        if back is not None:
            return _back_up(view, memory, now, back)
        reason = replace(reason, frontier="none" if search is None else "out_of_reach")
        memory = replace(memory, guide=None, errand=None)
        return Choice("stop_and_wait", reason, label, memory.trajectory), memory
    guide = blend_corners(view.admitted, apart(search.waypoints), view.behaviour.blend_length)
    errand = Errand(view.sequence)
    memory = replace(memory, guide=guide, errand=errand, improved_ns=view.time_ns)
    choice, memory = _advance(view, memory, now, guide, memory)
    return replace(choice, search=search, search_seed=seed), memory


def _search_frontier(view: View, now: TrajectorySample, visited: Array, seed: int) -> Plan | None:
    """A way to the best frontier that there is one to; None if there is no frontier left."""
    search = None
    for _ in range(FRONTIERS if view.admitted.discs else 1):
        spaces = view.admitted, view.passable
        target = best_frontier(*spaces, now.position, view.goal, visited)
        if target is None:
            return search
        search = plan(view.admitted, now.position, target, view.planner, seed, now.heading)
        if search.waypoints is not None:
            return search
        visited = np.vstack([visited, target])
    return search


def _back_up(
    view: View, memory: Memory, now: TrajectorySample, back: Array
) -> tuple[Choice, Memory]:
    """Go back on the trail, to look from there."""
    errand = Errand(view.sequence, backing_up=True)
    memory = replace(
        memory, guide=back, errand=errand, improved_ns=view.time_ns, backups=memory.backups + 1
    )
    return _advance(view, memory, now, back, memory)


def _brake(
    view: View,
    memory: Memory,
    now: TrajectorySample,
    path: Array,
    reason: Reason,
    label: Label,
) -> tuple[Choice, Memory]:
    path = clearest_stop(view, now, path)
    start = path, view.effect_ns, 0.0, now.speed, now.acceleration, now.heading
    trajectory = stop_along(*start, view.limits, tail_first(view, now, path))
    choice = Choice("stop_and_wait", reason, label, trajectory)
    return choice, replace(memory, trajectory=trajectory, guide=None, errand=None)


def _profile(
    view: View, now: TrajectorySample, path: Array, speed_share: float, backwards: bool = False
) -> Trajectory:
    return follow_path(
        path,
        view.effect_ns,
        0.0,
        now.speed,
        now.acceleration,
        now.heading,
        view.limits,
        speed_share * view.limits.speed,
        backwards,
    )


def _final_heading(trajectory: Trajectory) -> float:
    return trajectory.at(trajectory.start_ns + round(trajectory.duration_s * 1e9)).heading
