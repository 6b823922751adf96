"""What a decision sees, what it remembers, and what it chooses."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from wayproof.harness.stack.decision import Action, Label
from wayproof.harness.stack.reasons import Kind, Reason
from wayproof.maps.elementary import norm
from wayproof.planners import (
    FreeSpace,
    MotionLimits,
    Plan,
    PlannerConfig,
    Trajectory,
    TrajectorySample,
    arc_lengths,
    plan,
)

Array = NDArray[np.float64]

States = Callable[[NDArray[np.int64], NDArray[np.int64]], NDArray[np.uint8]]
"""States (nx, ny, nz) of the cells from one on up to another, both (3,) within the costmap."""


PlanPath = Callable[[FreeSpace, Array, Array, PlannerConfig, int, float], Plan]
"""Plans in a space from a start (3,) to a goal (3,), with settings, a seed and a heading, rad."""


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
        unknown_cost: Cost of unknown space to a guide, in place of what a cell at the edge of the
            inflation costs, 1: who comes to the unknown may have to stop.
        goal_reach: A goal inside the inflation is replaced by the nearest place outside of it, at
            most this far away, m.
        goal_patience: Time that the robot waits there for the goal to become free, s.
        backups: How often it goes back on its own trail, before the action is `abort`.
        backup_length: How far, m.
        backwards_speed: Share of the speed at which a body that is longer than wide goes tail
            first.
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
    unknown_cost: float = 4.0
    goal_reach: float = 1.0
    goal_patience: float = 5.0
    backups: int = 2
    backup_length: float = 1.0
    backwards_speed: float = 0.4

    def __post_init__(self) -> None:
        """Refuse lengths, times and angles that are not positive."""
        for name, value in vars(self).items():
            if not 0 < value < 1e6:
                raise ValueError(f"behaviour.{name}: got {value:g}, expected more than 0")
        for name in ("penalized_speed", "backwards_speed"):
            if getattr(self, name) > 1:
                raise ValueError(f"behaviour.{name}: got {getattr(self, name):g}, at most 1")


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
        states: Of the costmap's cells.
        unknown_blocks: Whether the unknown policy keeps the body out of unknown space.
        turns_in_place: Whether heading matters for motion (ground robots).
        penalize_unknown: Whether unknown space costs speed.
        limits: What the body may be asked for.
        planner: Search settings.
        behaviour: Waiting and giving up.
        mission_goal: (3,) what `goal` stands for where the mission's own is blocked, m; else none.
        plan: Plans a path: space, start, goal, settings, seed, heading.
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
    states: States
    unknown_blocks: bool
    turns_in_place: bool
    penalize_unknown: bool
    limits: MotionLimits
    planner: PlannerConfig
    behaviour: BehaviourConfig
    mission_goal: Array | None = None
    plan: PlanPath = plan


@dataclass(frozen=True)
class Errand:
    """A way to somewhere else than the goal, to look from there.

    Attributes:
        since: Number of the decision that set out.
        backing_up: Whether it leads back on the robot's own trail, and not to a frontier.
    """

    since: int
    backing_up: bool = False


@dataclass(frozen=True)
class GivenUp:
    """The decision after which the robot had no path any more.

    Attributes:
        sequence: Its number.
        kind: Of its reason.
        label: Its label.
    """

    sequence: int
    kind: Kind
    label: Label


@dataclass(frozen=True)
class Memory:
    """What one decision hands to the next.

    Attributes:
        trajectory: The last one committed; the robot follows it until the next takes effect.
        earlier: Those committed before it, from the one that the robot follows now.
        guide: (n, 3) from the start of `trajectory` to the goal, or on an errand to a frontier.
        errand: If the guide leads not to the goal, but to a place to look from.
        given_up: Since when there is no guide; none if there is one.
        rest_since_ns: Since when the robot has been waiting for the way to open; -1 if it is not.
        improved_ns: When a cheaper guide was last looked for.
        visited: (n, 3) places that it has looked from.
        trail: (n, 3) where it came along, the latest last, no longer than a way back needs.
        backups: How often it has gone back on its trail.
        slender: Whether the guide is for a long body as it lies, not for the disc about it.
    """

    trajectory: Trajectory
    earlier: tuple[Trajectory, ...] = ()
    guide: Array | None = None
    errand: Errand | None = None
    given_up: GivenUp | None = None
    rest_since_ns: int = -1
    improved_ns: int = 0
    visited: Array = field(default_factory=lambda: np.empty((0, 3)))
    trail: Array = field(default_factory=lambda: np.empty((0, 3)))
    backups: int = 0
    slender: bool = False

    @property
    def on_errand(self) -> bool:
        """Whether the guide leads to a place to look from."""
        return self.errand is not None


@dataclass(frozen=True)
class Choice:
    """The action and what led to it.

    Attributes:
        action: What the robot does.
        reason: Why.
        label: What stood in the way.
        trajectory: What it follows.
        guide: (n, 3) path to the goal, or none.
        search: The search made for this decision, or none if the guide was kept.
        search_seed: Its seed, 0 if none.
    """

    action: Action
    reason: Reason
    label: Label
    trajectory: Trajectory
    guide: Array | None = None
    search: Plan | None = None
    search_seed: int = 0


def standing(now: TrajectorySample) -> bool:
    """Whether the robot is in one place, though it may still be turning."""
    return now.speed < 1e-3


def length(path: Array) -> float:
    """Arc length of a path (n, 3), m."""
    return float(arc_lengths(path)[-1])


def distance(a: Array, b: Array) -> float:
    """Straight distance between two points, m."""
    return norm(a - b)
