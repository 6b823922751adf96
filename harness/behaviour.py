"""Choosing the next action from the costmap: one pure function and the memory it carries on.

The robot walks a *guide*, a path to the goal through space that is not known to be blocked. Of it,
only the *committed* part may be entered: the part that the unknown policy admits, ending at rest.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from harness.decision import Action, Label
from harness.frontier import best_frontier
from planners import (
    FreeSpace,
    MotionLimits,
    Plan,
    PlannerConfig,
    Trajectory,
    TrajectorySample,
    arc_lengths,
    blend_corners,
    first_stop,
    follow_path,
    hold,
    plan,
    plan_seed,
    remaining,
    stop_along,
    stopping_distance,
    tangent_at,
    truncate,
    turn_in_place,
)

Array = NDArray[np.float64]


ARRIVED = 0.05
"""A path shorter than this is driven, m."""


@dataclass(frozen=True)
class BehaviourConfig:
    """When the stack waits, tries again and gives up.

    Attributes:
        patience: Time at rest before the robot goes to look from elsewhere, s.
        tries: Places it looks from before the action is `abort`.
        tracking_tolerance: Farther from its trajectory than this the robot has left it, m.
        least_advance: A committed part shorter than this is not worth leaving rest for, m.
        turn_first: A ground robot at rest turns in place beyond this heading error, rad.
        stop_corner: Corners sharper than this are taken from rest, rad.
        blend_length: Corners are rounded over at most this length on each side, m.
        improve_period: Time between looks for a cheaper guide, s.
        penalized_speed: Share of the speed while unknown space is entered under `penalize`.
    """

    patience: float = 1.0
    tries: int = 12
    tracking_tolerance: float = 0.8
    least_advance: float = 0.3
    turn_first: float = 0.6
    stop_corner: float = 0.9
    blend_length: float = 0.6
    improve_period: float = 1.0
    penalized_speed: float = 0.4

    def __post_init__(self) -> None:
        """Refuse lengths, times and angles that are not positive."""
        for name, value in vars(self).items():
            if not 0 < value < 1e6:
                raise ValueError(f"behaviour.{name}: got {value:g}, expected more than 0")
        if self.penalized_speed > 1:
            raise ValueError(f"behaviour.penalized_speed: got {self.penalized_speed:g}, at most 1")


@dataclass(frozen=True)
class View:
    """One decision's view of the world; points lie in the costmap's frame.

    Attributes:
        time_ns: When the sweep was taken.
        effect_ns: When the decision reaches the robot.
        sequence: Number of the decision.
        seed: The episode's.
        position: (3,) believed, m.
        heading: rad.
        goal: (3,) m.
        goal_tolerance: m.
        admitted: Space that the unknown policy lets the body enter.
        known: Space known to be free.
        passable: Space not known to be blocked; what is not known to be free costs most.
        turns_in_place: Whether heading matters for motion (ground robots).
        penalize_unknown: Whether unknown space costs speed.
        limits: What the body may be asked for.
        planner: Search settings.
        behaviour: Waiting and giving up.
    """

    time_ns: int
    effect_ns: int
    sequence: int
    seed: int
    position: Array
    heading: float
    goal: Array
    goal_tolerance: float
    admitted: FreeSpace
    known: FreeSpace
    passable: FreeSpace
    turns_in_place: bool
    penalize_unknown: bool
    limits: MotionLimits
    planner: PlannerConfig
    behaviour: BehaviourConfig


@dataclass(frozen=True)
class Memory:
    """What one decision hands to the next.

    Attributes:
        trajectory: The last one committed; the robot follows it until the next takes effect.
        earlier: Those committed before it, from the one that the robot follows now.
        guide: (n, 3) from the start of `trajectory` to the goal, or on an errand to a frontier.
        on_errand: Whether the guide leads to a frontier, to look from there.
        rest_since_ns: Since when the robot has been waiting for the way to open; -1 if it is not.
        improved_ns: When a cheaper guide was last looked for.
        visited: (n, 3) places that it has looked from.
    """

    trajectory: Trajectory
    earlier: tuple[Trajectory, ...] = ()
    guide: Array | None = None
    on_errand: bool = False
    rest_since_ns: int = -1
    improved_ns: int = 0
    visited: Array = field(default_factory=lambda: np.empty((0, 3)))


@dataclass(frozen=True)
class Choice:
    """The action and what led to it.

    Attributes:
        action: What the robot does.
        reason: Why, in words with numbers.
        label: What stood in the way.
        trajectory: What it follows.
        guide: (n, 3) path to the goal, or none.
        search: The search made for this decision, or none if the guide was kept.
        search_seed: Its seed, 0 if none.
    """

    action: Action
    reason: str
    label: Label
    trajectory: Trajectory
    guide: Array | None = None
    search: Plan | None = None
    search_seed: int = 0


def decide(view: View, memory: Memory) -> tuple[Choice, Memory]:
    """Choose the next action; the same view and memory always give the same choice."""
    committed = (*memory.earlier, memory.trajectory)
    begun = [k for k, trajectory in enumerate(committed) if trajectory.start_ns <= view.time_ns]
    committed = committed[begun[-1] if begun else 0 :]
    choice, memory = _choose(view, memory, committed[0])
    return choice, replace(memory, earlier=committed)


def _choose(view: View, memory: Memory, followed: Trajectory) -> tuple[Choice, Memory]:
    """The action, given the trajectory that the robot follows while the sweep is taken."""
    believed = followed.at(view.time_ns)
    if np.linalg.norm(view.position - believed.position) > view.behaviour.tracking_tolerance:
        return _anchor_again(view, memory, believed)
    now = memory.trajectory.at(view.effect_ns)
    if believed.at_rest and _distance(view.position, view.goal) <= view.goal_tolerance:
        return _arrive(view, memory, now)
    if _standing(now) and not view.admitted.is_free(now.position):
        return _escape(view, memory, now)
    memory, search, seed = _keep_or_replan_guide(view, memory, now)
    if memory.guide is None:
        choice, memory = _stop_or_wait(view, memory, now, search)
    else:
        choice, memory = _advance(view, memory, now, memory.guide)
    return replace(choice, search=search, search_seed=seed), memory


def _anchor_again(view: View, memory: Memory, believed: TrajectorySample) -> tuple[Choice, Memory]:
    """The robot left its trajectory: hold where it is believed to be, and plan from there."""
    off = _distance(view.position, believed.position)
    trajectory = hold(view.position, view.effect_ns, view.heading)
    reason = f"{off:.2f} m off the trajectory: holding here"
    choice = Choice("recover", reason, "localization_lost", trajectory)
    return choice, replace(memory, trajectory=trajectory, guide=None)


def _arrive(view: View, memory: Memory, now: TrajectorySample) -> tuple[Choice, Memory]:
    trajectory = hold(now.position, view.effect_ns, now.heading)
    reason = f"at rest {_distance(view.position, view.goal):.2f} m from the goal"
    return Choice("goal", reason, "none", trajectory), replace(memory, trajectory=trajectory)


def _escape(view: View, memory: Memory, now: TrajectorySample) -> tuple[Choice, Memory]:
    """The body stands inside the inflation: step to the nearest admitted cell, straight."""
    target = view.admitted.nearest_free(now.position, 1.0)
    if target is None:
        return _wait(view, memory, now, "start_blocked", "no admitted space within 1 m")
    path = np.stack([now.position, target])
    trajectory = _profile(view, now, path, speed_share=0.3)
    reason = f"inside the inflation; {_distance(now.position, target):.2f} m to admitted space"
    choice = Choice("recover", reason, "start_blocked", trajectory, path)
    return choice, replace(
        memory, trajectory=trajectory, guide=None, on_errand=False, rest_since_ns=-1
    )


def _keep_or_replan_guide(
    view: View, memory: Memory, now: TrajectorySample
) -> tuple[Memory, Plan | None, int]:
    """The guide from where the robot will be: kept while it is valid and none is much cheaper.

    Returns:
        The memory with its guide, the search made if any, and its seed.
    """
    guide = None if memory.guide is None else remaining(memory.guide, now.arc_length)
    if memory.on_errand and guide is not None and _length(guide) < ARRIVED:
        guide = None
    valid = guide is not None and view.passable.free_length(guide) >= _length(guide) - 1e-6
    improve_due = view.time_ns - memory.improved_ns >= view.behaviour.improve_period * 1e9
    if valid and not improve_due:
        return replace(memory, guide=guide), None, 0
    prefix = _prefix_to_keep(view, now, guide)
    if prefix is None:
        return replace(memory, guide=None, on_errand=False), None, 0
    seed = plan_seed(view.seed, "guide", view.sequence)
    only_known = valid and memory.on_errand
    search, fresh = _search(view, prefix, seed, only_known)
    if valid and guide is not None and not _better(view, memory, fresh, guide):
        return replace(memory, guide=guide, improved_ns=view.time_ns), search, seed
    return replace(memory, guide=fresh, on_errand=False, improved_ns=view.time_ns), search, seed


def _prefix_to_keep(view: View, now: TrajectorySample, guide: Array | None) -> Array | None:
    """The stretch that the robot will drive before a new path can bend it; none if it is blocked.

    It reaches beyond the braking distance, so that a stop on the old path always remains, and by
    the length of a blend, so that the new path need not begin with a corner.
    """
    if _standing(now):
        return now.position[None]
    if guide is None:
        return None
    admitted = view.admitted.free_length(guide)
    braking = stopping_distance(now.speed, now.acceleration, view.limits)
    if admitted < braking:
        return None
    return truncate(guide, min(braking + view.behaviour.blend_length, admitted, _length(guide)))


def _search(view: View, prefix: Array, seed: int, only_known: bool) -> tuple[Plan, Array | None]:
    """Plan from the prefix's end: through known space if that reaches the goal, else beyond it."""
    space = view.known
    search = plan(space, prefix[-1], view.goal, view.planner, seed)
    if search.waypoints is None and not only_known:
        space = view.passable
        search = plan(space, prefix[-1], view.goal, view.planner, seed)
    if search.waypoints is None:
        return search, None
    return search, _join(space, prefix, search.waypoints, view.behaviour.blend_length)


def _join(space: FreeSpace, prefix: Array, waypoints: Array, blend_length: float) -> Array:
    """The prefix and the path from its end, with every corner from there on blended.

    The robot is driving on the prefix, so it is left as it is, but for its last stretch: where that
    can be drawn straight, the corner at its end can be blended too.
    """
    keep = truncate(prefix, max(_length(prefix) - blend_length, 0.0))
    if space.edge_free(keep[-1], prefix[-1]):
        return np.concatenate(
            [keep[:-1], blend_corners(space, np.vstack([keep[-1], waypoints]), blend_length)]
        )
    return np.concatenate([prefix[:-1], blend_corners(space, waypoints, blend_length)])


def _better(view: View, memory: Memory, fresh: Array | None, guide: Array) -> bool:
    """Whether a new guide replaces a valid one; any way to the goal is better than an errand."""
    if fresh is None or memory.on_errand:
        return fresh is not None
    return view.planner.replaces(view.passable.path_cost(fresh), view.passable.path_cost(guide))


def _stop_or_wait(
    view: View, memory: Memory, now: TrajectorySample, search: Plan | None
) -> tuple[Choice, Memory]:
    """No guide: brake along the old trajectory if moving, else wait for the map to change."""
    if _standing(now):
        label: Label = "no_path" if search is None else search.label
        return _wait(view, memory, now, label, "no path to the goal in the map")
    path = remaining(memory.trajectory.path, now.arc_length)
    return _brake(view, memory, now, path, "the way ahead is blocked: stopping on the path")


def _advance(
    view: View, memory: Memory, now: TrajectorySample, guide: Array
) -> tuple[Choice, Memory]:
    """Commit to the admitted part of the guide, ending at rest."""
    admitted = view.admitted.free_length(guide)
    corner = first_stop(guide, 0.0, view.behaviour.stop_corner)
    braking = stopping_distance(now.speed, now.acceleration, view.limits)
    if corner < braking:  # too late to stop there: the profile slows down for it instead
        corner = _length(guide)
    end = min(admitted, corner, _length(guide))
    blocked = end == admitted and admitted < _length(guide)
    if end < braking - 1e-3:
        label: Label = "unknown_ahead" if view.passable.free_length(guide) > end else "none"
        path = truncate(guide, max(end, 1e-3))
        reason = f"{end:.2f} m admitted ahead, {braking:.2f} m needed to stop"
        return _brake(view, memory, now, path, reason, label)
    if _standing(now) and blocked and end < view.behaviour.least_advance:
        return _wait(view, memory, now, "unknown_ahead", f"{end:.2f} m admitted ahead")
    if _standing(now) and view.turns_in_place:
        tangent = tangent_at(guide, min(0.2, 0.5 * _length(guide)))
        target = float(np.arctan2(tangent[1], tangent[0]))
        if abs(_wrapped(target - now.heading)) > view.behaviour.turn_first:
            return _turn(view, memory, now, guide, target)
    return _follow(view, memory, now, guide, end, blocked)


def _follow(
    view: View, memory: Memory, now: TrajectorySample, guide: Array, end: float, blocked: bool
) -> tuple[Choice, Memory]:
    path = truncate(guide, end)
    unknown_ahead = view.penalize_unknown and view.known.free_length(path) < _length(path)
    share = view.behaviour.penalized_speed if unknown_ahead else 1.0
    trajectory = _profile(view, now, path, share)
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


def _turn(
    view: View, memory: Memory, now: TrajectorySample, guide: Array, target: float
) -> tuple[Choice, Memory]:
    trajectory = memory.trajectory
    if now.at_rest or abs(_wrapped(target - _final_heading(trajectory))) > 0.2:
        trajectory = turn_in_place(now.position, view.effect_ns, now.heading, target, view.limits)
    reason = f"turning {np.degrees(_wrapped(target - now.heading)):.0f} degrees into the path"
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
    target = best_frontier(view.admitted, view.passable, now.position, view.goal, visited)
    seed = plan_seed(view.seed, "errand", view.sequence)
    search = (
        None if target is None else plan(view.admitted, now.position, target, view.planner, seed)
    )
    if target is None or search is None or search.waypoints is None:
        text = f"{reason}; no frontier in reach"
        memory = replace(memory, guide=None, on_errand=False)
        return Choice("stop_and_wait", text, label, memory.trajectory), memory
    guide = blend_corners(view.admitted, search.waypoints, view.behaviour.blend_length)
    memory = replace(memory, guide=guide, on_errand=True, improved_ns=view.time_ns)
    choice, memory = _advance(view, memory, now, guide)
    return replace(choice, reason=f"{reason}; looking from {_length(guide):.2f} m away"), memory


def _brake(
    view: View,
    memory: Memory,
    now: TrajectorySample,
    path: Array,
    reason: str,
    label: Label = "none",
) -> tuple[Choice, Memory]:
    trajectory = stop_along(
        path, view.effect_ns, 0.0, now.speed, now.acceleration, now.heading, view.limits
    )
    choice = Choice("stop_and_wait", reason, label, trajectory)
    return choice, replace(memory, trajectory=trajectory, guide=None, on_errand=False)


def _profile(view: View, now: TrajectorySample, path: Array, speed_share: float) -> Trajectory:
    return follow_path(
        path,
        view.effect_ns,
        0.0,
        now.speed,
        now.acceleration,
        now.heading,
        view.limits,
        speed_share * view.limits.speed,
    )


def _standing(now: TrajectorySample) -> bool:
    """Whether the robot is in one place, though it may still be turning."""
    return now.speed < 1e-3


def _final_heading(trajectory: Trajectory) -> float:
    return trajectory.at(trajectory.start_ns + round(trajectory.duration_s * 1e9)).heading


def _length(path: Array) -> float:
    return float(arc_lengths(path)[-1])


def _distance(a: Array, b: Array) -> float:
    return float(np.linalg.norm(a - b))


def _wrapped(angle: float) -> float:
    return float((angle + np.pi) % (2 * np.pi) - np.pi)
