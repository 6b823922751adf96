"""Data types of one decision: planner input, planner state, command."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayproof.harness.behaviour_config import BehaviourConfig
from wayproof.harness.config import Config
from wayproof.harness.decision import Action, Label
from wayproof.harness.stack.gait import Gait
from wayproof.harness.stack.reasons import Reason
from wayproof.harness.stack.state import PlannerState, UnderWay
from wayproof.maps.elementary import norm
from wayproof.planners import (
    FreeSpace,
    Plan,
    PlannerConfig,
    Trajectory,
    TrajectorySample,
    arc_lengths,
)

Array = NDArray[np.float64]

LENGTH_ROUNDING = 1e-6
"""Length by which the free length of a path that is all free may be shorter, by rounding, m."""

CellStates = Callable[[NDArray[np.int64], NDArray[np.int64]], NDArray[np.uint8]]
"""States (nx, ny, nz) of the cells between two corners (3,) of the costmap, the upper excluded."""

ObservedNs = Callable[[Array], NDArray[np.int64]]
"""Times (n,) at which places (n, 3), m, were last measured, ns; -1 of one that never was."""


class Localization(NamedTuple):
    """Uncertainty of the pose, by an estimator that states a covariance.

    Attributes:
        sigma: Stated standard deviation of the position along its worst axis, m.
        held: Whether the sweeps hold the position along all axes of motion.
    """

    sigma: float
    held: bool


Provenance = Literal["measured", "prior", "predicted"]


class EvidenceSpace(NamedTuple):
    """Space known to be free by one stage of the evidence.

    Attributes:
        provenance: Provenance of what the stage has more than the one before it.
        known_free: Free by this stage or one before it.
    """

    provenance: Provenance
    known_free: FreeSpace


class Horizon(NamedTuple):
    """The rolling window of the costmap, and ways beyond it.

    Attributes:
        low: (2,) corner of the part in which a goal may lie, m.
        high: (2,) the other corner, m.
        way: Plan from a position (3,) to a goal (3,) over the whole operating area, in coarse
            cells: (n, 2) from the position on, m; None if the map holds no way.
    """

    low: Array
    high: Array
    way: Callable[[Array, Array], Array | None]


EVERYWHERE = Horizon(np.full(2, -np.inf), np.full(2, np.inf), lambda start, goal: None)
"""A window that holds any goal."""


GOAL_SHARE = 0.8
"""Share of `episode.goal_tolerance` within which the robot claims to have arrived."""


@dataclass(frozen=True)
class FreeSpaces:
    """Free space for one footprint under several readings of the costmap.

    Attributes:
        traversable: Space that the unknown policy lets the body enter.
        known_free: Space known to be free.
        optimistic: Space not known to be blocked; the unknown costs most (freespace assumption,
            Koenig and Smirnov 1997).
        cell_states: States of the costmap's cells.
        guided: The optimistic space with what was not measured laid under the map: its
            occupied cells block, and its free ones cost less than unknown ones; and with the cost
            of closed gaps. None without either.
        avoids_gaps: Whether closed gaps cost more in it.
        evidence: Space known to be free by each stage of the evidence, the measured one first;
            empty without any other.
    """

    traversable: FreeSpace
    known_free: FreeSpace
    optimistic: FreeSpace
    cell_states: CellStates
    guided: FreeSpace | None = None
    avoids_gaps: bool = False
    evidence: tuple[EvidenceSpace, ...] = ()


@dataclass(frozen=True)
class PlannerInput:
    """All that one decision depends on besides the planner state; points in the costmap's frame.

    Attributes:
        time_ns: Time of the sweep.
        effect_ns: Time at which the command reaches the robot.
        sequence: Number of the decision.
        position: (3,) estimated position, m.
        heading: Estimated yaw, rad.
        goal: (3,) m.
        config: Settings of the mission.
        gait: How the body moves.
        spaces: Free space for the footprint that is decided for.
        localization: Uncertainty of the pose; None if no covariance is stated.
        range_sigma: Standard deviation of the ranges of the sweeps, m; 0 where it is not estimated.
        pose_age_s: Time since the pose was estimated, by its stamp or as it comes again, s.
        horizon: Part of the operating area that the spaces hold.
        observed_ns: When each place was last measured, by the stamps of the sweeps.
    """

    time_ns: int
    effect_ns: int
    sequence: int
    position: Array
    heading: float
    goal: Array
    config: Config
    gait: Gait
    spaces: FreeSpaces
    localization: Localization | None = None
    range_sigma: float = 0.0
    pose_age_s: float = 0.0
    horizon: Horizon = EVERYWHERE
    observed_ns: ObservedNs = lambda places: np.full(len(places), -1)

    @property
    def traversable(self) -> FreeSpace:
        """Space that the unknown policy lets the body enter."""
        return self.spaces.traversable

    @property
    def known_free(self) -> FreeSpace:
        """Space known to be free."""
        return self.spaces.known_free

    @property
    def optimistic(self) -> FreeSpace:
        """Space not known to be blocked."""
        return self.spaces.optimistic

    @property
    def planner(self) -> PlannerConfig:
        """Settings of the search."""
        return self.config.planner

    @property
    def behaviour(self) -> BehaviourConfig:
        """Settings of the decision."""
        return self.config.behaviour

    @property
    def goal_tolerance(self) -> float:
        """Distance from the goal within which it counts as reached, m."""
        return GOAL_SHARE * self.config.episode.goal_tolerance

    @property
    def unknown_blocks(self) -> bool:
        """Whether the unknown policy keeps the body out of unknown space."""
        return self.config.costmap.unknown_policy == "forbid"

    @property
    def uncertain(self) -> bool:
        """Whether the sweeps do not hold the pose, and its standard deviation costs speed."""
        pose = self.localization
        return pose is not None and not pose.held and pose.sigma > self.behaviour.uncertain_sigma

    @property
    def noisy(self) -> bool:
        """Whether the deviation of the ranges costs speed."""
        return self.range_sigma > self.behaviour.noisy_sigma


@dataclass(frozen=True)
class Command:
    """Action of one decision, its reason and its trajectory.

    Attributes:
        action: Action of the robot.
        reason: Why, with its figures.
        label: Failure label; `none` without a failure.
        trajectory: Trajectory that the robot follows.
        global_path: (n, 3) to the goal or to a viewpoint, or none.
        search: The search made for this decision; none if the global path was kept.
        search_seed: Its seed, 0 if none.
        under_way: The manoeuvre that the next decision may go on with.
    """

    action: Action
    reason: Reason
    label: Label
    trajectory: Trajectory
    global_path: Array | None = None
    search: Plan | None = None
    search_seed: int = 0
    under_way: UnderWay = ""


class Decided(NamedTuple):
    """The result of a manoeuvre or of a whole decision.

    Attributes:
        command: Command of the robot.
        state: The planner state for the next decision.
    """

    command: Command
    state: PlannerState


def is_stationary(sample: TrajectorySample) -> bool:
    """Return whether the robot does not translate; it may still be turning."""
    return sample.speed < 1e-3


def arc_length(path: Array) -> float:
    """Return the arc length of a path (n, 3), m."""
    return float(arc_lengths(path)[-1])


def is_free_along(space: FreeSpace, path: Array) -> bool:
    """Return whether all of a path (n, 3) is free."""
    return space.free_length(path) >= arc_length(path) - LENGTH_ROUNDING


def distance(a: Array, b: Array) -> float:
    """Return the straight distance between two points, m."""
    return norm(a - b)
