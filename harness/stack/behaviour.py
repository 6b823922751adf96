"""Choosing the next action from the costmap: one pure function and the memory it carries on.

The robot walks a *guide*, a path to the goal through space that is not known to be blocked. Of it,
only the *committed* part may be entered: the part that the unknown policy admits, ending at rest.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from harness.stack.decision import Action, Label
from harness.stack.fit import (
    LEAST_STEP,
    as_it_faces,
    fits,
    fits_along,
    leads_away,
    tail_first,
    to_where_it_turns,
    ways_to_face,
    wrapped,
)
from harness.stack.guide import ARRIVED, apart, heading_at, keep_or_replan_guide, place_for_goal
from harness.stack.stopping import clearest_stop
from harness.stack.trail import trodden, way_back
from harness.stack.view import Array, Choice, Memory, View, distance, length, standing
from planners import (
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

TURNS_OUT = [sign * 0.1 * n for n in range(1, 9) for sign in (1, -1)]
"""By what a body turns to get out of the inflation, rad."""


def decide(view: View, memory: Memory) -> tuple[Choice, Memory]:
    """Choose the next action; the same view and memory always give the same choice."""
    committed = (*memory.earlier, memory.trajectory)
    begun = [k for k, trajectory in enumerate(committed) if trajectory.start_ns <= view.time_ns]
    committed = committed[begun[-1] if begun else 0 :]
    choice, memory = _choose(view, trodden(memory, view), committed[0])
    return choice, replace(memory, earlier=committed)


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
    view = replace(view, goal=target)
    before = memory
    memory, search, seed = keep_or_replan_guide(view, memory, now)
    if memory.guide is None:
        choice, memory = _stop_or_wait(view, memory, now, search)
    else:
        choice, memory = _advance(view, memory, now, memory.guide, before)
    if choice.search is None:  # an errand's search is the one that was acted on
        choice = replace(choice, search=search, search_seed=seed)
    return choice, memory


def _anchor_again(view: View, memory: Memory, believed: TrajectorySample) -> tuple[Choice, Memory]:
    """The robot left its trajectory: hold where it is believed to be, and plan from there."""
    off = distance(view.position, believed.position)
    trajectory = hold(view.position, view.effect_ns, view.heading)
    reason = f"{off:.2f} m off the trajectory: holding here"
    choice = Choice("recover", reason, "localization_lost", trajectory)
    return choice, replace(memory, trajectory=trajectory, guide=None)


def _arrive(view: View, memory: Memory, now: TrajectorySample) -> tuple[Choice, Memory]:
    trajectory = hold(now.position, view.effect_ns, now.heading)
    reason = f"at rest {distance(view.position, view.goal):.2f} m from the goal"
    return Choice("goal", reason, "none", trajectory), replace(memory, trajectory=trajectory)


def _wait_at_goal(view: View, memory: Memory, now: TrajectorySample) -> tuple[Choice, Memory]:
    """As near to a blocked goal as can be: wait for it to become free, then give up."""
    trajectory = hold(now.position, view.effect_ns, now.heading)
    since = view.time_ns if memory.rest_since_ns < 0 else memory.rest_since_ns
    waited = (view.time_ns - since) * 1e-9
    memory = replace(memory, trajectory=trajectory, rest_since_ns=since, guide=None)
    reason = (
        f"the goal is inside the inflation, the nearest place outside of it "
        f"{distance(now.position, view.goal):.2f} m away; waited {waited:.1f} s"
    )
    action: Action = "abort" if waited >= view.behaviour.goal_patience else "stop_and_wait"
    return Choice(action, reason, "goal_blocked", trajectory), memory


def _escape(view: View, memory: Memory, now: TrajectorySample) -> tuple[Choice, Memory]:
    """The body stands inside the inflation: step to the nearest admitted place, straight."""
    target, heading = _way_out(view, now)
    if target is None:
        return _wait(view, memory, now, "start_blocked", "no admitted space within 1 m")
    # Away from what is unknown may be towards an obstacle, which is worse.
    if not all(leads_away(one, now, target, heading) for one in (view.admitted, view.passable)):
        return _wait(view, memory, now, "start_blocked", "the way out leads nearer to what blocks")
    path = np.stack([now.position, target])
    if heading == now.heading:
        trajectory = _profile(view, now, path, speed_share=0.3)
        if view.admitted.discs:
            trajectory = trajectory.facing(heading)
    else:
        start = now.position, view.effect_ns, now.heading
        trajectory = turn_in_place(*start, heading, view.limits)
    reason = f"inside the inflation; {distance(now.position, target):.2f} m to admitted space"
    choice = Choice("recover", reason, "start_blocked", trajectory, path)
    return choice, replace(
        memory, trajectory=trajectory, guide=None, on_errand=False, rest_since_ns=-1
    )


def _way_out(view: View, now: TrajectorySample) -> tuple[Array | None, float]:
    """The nearest admitted place at the present heading, or the heading nearest to it here."""
    space = view.admitted
    if not space.discs:
        return space.nearest_free(now.position, 1.0), now.heading
    pose = space.nearest_pose(now.position, 1.0, np.array([now.heading]))
    moved = np.inf if pose is None else distance(now.position, pose[:3])
    for turn in TURNS_OUT:
        if abs(turn) < moved and space.pose_free(now.position, now.heading + turn):
            return now.position, now.heading + turn
    return (None if pose is None else pose[:3]), now.heading


def _stop_or_wait(
    view: View, memory: Memory, now: TrajectorySample, search: Plan | None
) -> tuple[Choice, Memory]:
    """No guide: brake along the old trajectory if moving, else wait for the map to change."""
    if standing(now):
        label: Label = "no_path" if search is None else search.label
        return _wait(view, memory, now, label, "no path to the goal in the map")
    path = remaining(memory.trajectory.path, now.arc_length)
    return _brake(view, memory, now, path, "the way ahead is blocked: stopping on the path")


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
        label: Label = "unknown_ahead" if view.passable.free_length(guide) > end else "none"
        path = truncate(guide, max(end, 1e-3))
        reason = f"{end:.2f} m admitted ahead, {braking:.2f} m needed to stop"
        return _brake(view, memory, now, path, reason, label)
    if standing(now) and blocked and end < view.behaviour.least_advance:
        return _wait(view, memory, now, "unknown_ahead", f"{end:.2f} m admitted ahead")
    if standing(now) and view.admitted.discs:
        return _set_out(view, memory, now, guide, end, blocked)
    if standing(now) and view.turns_in_place:
        target = heading_at(guide, min(0.2, 0.5 * length(guide)))
        if abs(wrapped(target - now.heading)) > view.behaviour.turn_first:
            return _turn(view, memory, now, guide, target)
    choice = _follow(view, memory, now, guide, end, blocked, tail_first(view, now, guide))
    return choice or _keep_course(view, memory, now, before)


def _set_out(
    view: View, memory: Memory, now: TrajectorySample, guide: Array, end: float, blocked: bool
) -> tuple[Choice, Memory]:
    """From rest, nose first; where the body cannot turn about, as it stands, perhaps tail first."""
    ahead = heading_at(guide, min(0.1, 0.5 * length(guide)))
    for target, backwards in ways_to_face(view.admitted, now, ahead):
        error = abs(wrapped(target - now.heading))
        if error <= view.behaviour.turn_first:
            chosen = _follow(view, memory, now, guide, end, blocked, backwards)
            if chosen is not None:
                return chosen
        if error > ALIGNED:
            return _turn(view, memory, now, guide, target)
    memory = replace(memory, guide=None)
    return _wait(view, memory, now, "no_path", "no room to turn into the path")


def _keep_course(
    view: View, memory: Memory, now: TrajectorySample, before: Memory
) -> tuple[Choice, Memory]:
    """The body does not fit along the new path in motion: go on as before, or stop on that way."""
    trajectory = before.trajectory
    begun = (view.effect_ns - trajectory.start_ns) * 1e-9
    if fits_along(view.admitted, trajectory, begun) is None:
        reason = "no room to take the path in motion: following the last trajectory"
        choice = Choice("slow", reason, "none", trajectory, before.guide)
        return choice, replace(before, improved_ns=memory.improved_ns)
    path = remaining(trajectory.path, now.arc_length)
    return _brake(view, memory, now, path, "the way ahead is blocked: stopping on the path")


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
    needed = stopping_distance(view.limits.speed, 0.0, view.limits)
    if not blocked:
        action: Action = "slow" if unknown_ahead else "explore" if memory.on_errand else "follow"
        reason = f"{end:.2f} m admitted to the next stop"
        label: Label = "unknown_ahead" if unknown_ahead else "none"
    else:
        action = "slow" if end < needed or unknown_ahead else "explore"
        reason = f"unknown ahead: {end:.2f} m admitted, {needed:.2f} m for full speed"
        label = "unknown_ahead"
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
    reason = f"turning {np.degrees(wrapped(target - now.heading)):.0f} degrees into the path"
    choice = Choice("follow", reason, "none", trajectory, guide)
    return choice, replace(memory, trajectory=trajectory, guide=guide, rest_since_ns=-1)


def _wait(
    view: View, memory: Memory, now: TrajectorySample, label: Label, reason: str
) -> tuple[Choice, Memory]:
    """Stay at rest; after `patience` look from elsewhere, after `tries` of that abort."""
    trajectory = hold(now.position, view.effect_ns, now.heading)
    since = view.time_ns if memory.rest_since_ns < 0 else memory.rest_since_ns
    waited = (view.time_ns - since) * 1e-9
    memory = replace(memory, trajectory=trajectory, rest_since_ns=since)
    if waited < view.behaviour.patience:
        text = f"{reason}; waited {waited:.1f} s"
        return Choice("stop_and_wait", text, label, trajectory, memory.guide), memory
    if len(memory.visited) >= view.behaviour.tries:
        text = f"{reason}; gave up after looking from {len(memory.visited)} places"
        return Choice("abort", text, label, trajectory, memory.guide), memory
    return _look_from_elsewhere(view, memory, now, label, reason)


def _look_from_elsewhere(
    view: View, memory: Memory, now: TrajectorySample, label: Label, reason: str
) -> tuple[Choice, Memory]:
    """Set out for the best frontier that the robot can reach; without one, wait once more."""
    visited = np.vstack([memory.visited, now.position])
    memory = replace(memory, visited=visited, rest_since_ns=-1)
    seed = plan_seed(view.seed, "errand", view.sequence)
    search = _search_frontier(view, now, visited, seed)
    if search is None or search.waypoints is None:
        back = way_back(view, memory, now)
        if back is not None:
            return _back_up(view, memory, now, back, reason)
        text = f"{reason}; no frontier in reach"
        memory = replace(memory, guide=None, on_errand=False)
        return Choice("stop_and_wait", text, label, memory.trajectory), memory
    guide = blend_corners(view.admitted, apart(search.waypoints), view.behaviour.blend_length)
    memory = replace(memory, guide=guide, on_errand=True, improved_ns=view.time_ns)
    choice, memory = _advance(view, memory, now, guide, memory)
    text = f"{reason}; looking from {length(guide):.2f} m away"
    return replace(choice, reason=text, search=search, search_seed=seed), memory


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
    view: View, memory: Memory, now: TrajectorySample, back: Array, reason: str
) -> tuple[Choice, Memory]:
    """Go back on the trail, to look from there."""
    memory = replace(
        memory, guide=back, on_errand=True, improved_ns=view.time_ns, backups=memory.backups + 1
    )
    choice, memory = _advance(view, memory, now, back, memory)
    text = f"{reason}; going back {length(back):.2f} m on the trail"
    return replace(choice, action="recover", reason=text), memory


def _brake(
    view: View,
    memory: Memory,
    now: TrajectorySample,
    path: Array,
    reason: str,
    label: Label = "none",
) -> tuple[Choice, Memory]:
    path = clearest_stop(view, now, path)
    start = path, view.effect_ns, 0.0, now.speed, now.acceleration, now.heading
    trajectory = stop_along(*start, view.limits, tail_first(view, now, path))
    choice = Choice("stop_and_wait", reason, label, trajectory)
    return choice, replace(memory, trajectory=trajectory, guide=None, on_errand=False)


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
