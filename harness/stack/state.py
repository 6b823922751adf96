"""The planner state: all that one decision carries over to the next."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from wayproof.harness.decision import Label
from wayproof.planners import Trajectory

Array = NDArray[np.float64]

UnderWay = Literal["", "escape"]
"""A manoeuvre without a global path that the next decision may go on with."""

Place = tuple[float, float, float]
"""Position, m."""


def _nowhere() -> Array:
    return np.empty((0, 3))


@dataclass(frozen=True)
class Exploration:
    """A detour to a viewpoint, from which the sensors may find a way to the goal.

    Attributes:
        since: Number of the decision that began it.
        backtracking: Whether it leads back along the breadcrumbs, and not to a frontier.
        returning: Whether it leads back to where the sweeps held the pose.
    """

    since: int
    backtracking: bool = False
    returning: bool = False


@dataclass(frozen=True)
class Route:
    """The global path.

    Attributes:
        path: (n, 3) from the start of the last trajectory to the goal, or to a viewpoint, m.
        improved_ns: Time of the last search for a cheaper one.
        exploration: The detour that it belongs to; none if it leads to the goal.
    """

    path: Array
    improved_ns: int = 0
    exploration: Exploration | None = None


@dataclass(frozen=True)
class PathLoss:
    """The decision that dropped the global path without a new one.

    Attributes:
        sequence: Its number.
        under_way: The manoeuvre that it began or went on with.
        label: Its label.
    """

    sequence: int
    under_way: UnderWay
    label: Label


@dataclass(frozen=True)
class Tries:
    """What was tried since the last goal.

    Attributes:
        viewpoints: (n, 3) positions explored from, m.
        backtracks: Number of times that the robot has backtracked.
        returns: Number of times that it has gone back to where the sweeps held the pose.
    """

    viewpoints: Array = field(default_factory=_nowhere)
    backtracks: int = 0
    returns: int = 0


@dataclass(frozen=True)
class Trails:
    """Places of the way travelled.

    Attributes:
        breadcrumbs: (n, 3) the latest last, as many as backtracking needs, m.
        unheld: (n, 3) from the last one at which the sweeps held the pose, m.
    """

    breadcrumbs: Array = field(default_factory=_nowhere)
    unheld: Array = field(default_factory=_nowhere)


@dataclass(frozen=True)
class ClosedGap:
    """A narrow gap that closed before the robot, which then took a detour.

    Attributes:
        place: Place on the global path at which it did, m.
        tries: Number of times that it did.
    """

    place: Place
    tries: int


@dataclass(frozen=True)
class LostWay:
    """The global path that last closed right before an elongated body.

    Attributes:
        place: Place on it at which it closed, m.
        length_m: Length that was left of it, m.
        time_ns: Time of the sweep.
    """

    place: Place
    length_m: float
    time_ns: int


@dataclass(frozen=True)
class Narrows:
    """What an elongated body remembers of narrow places.

    Attributes:
        oriented: Whether it is planned for by its discs at their heading, not by the one about
            them.
        closed: Gaps that closed before it, the latest last.
        lost: The path that last closed before it, until it takes another.
    """

    oriented: bool = False
    closed: tuple[ClosedGap, ...] = ()
    lost: LostWay | None = None


@dataclass(frozen=True)
class PlannerState:
    """All that one decision carries over to the next.

    Attributes:
        committed: Trajectories from the one that the robot follows now to the last one committed.
        route: The global path; none where there is none.
        path_loss: Since when there is none.
        rest_since_ns: Time at which the robot began to wait for a way; -1 if it does not wait.
        tries: What was tried since the last goal.
        trails: Places of the way travelled.
        narrows: What an elongated body remembers of narrow places.
    """

    committed: tuple[Trajectory, ...]
    route: Route | None = None
    path_loss: PathLoss | None = None
    rest_since_ns: int = -1
    tries: Tries = Tries()
    trails: Trails = Trails()
    narrows: Narrows = Narrows()

    @property
    def trajectory(self) -> Trajectory:
        """The last one committed; the robot follows it until the next takes effect."""
        return self.committed[-1]

    @property
    def global_path(self) -> Array | None:
        """The global path (n, 3), or none."""
        return None if self.route is None else self.route.path

    @property
    def path(self) -> Array:
        """The global path (n, 3), where there must be one."""
        assert self.route is not None
        return self.route.path

    @property
    def exploration(self) -> Exploration | None:
        """The detour that the global path belongs to; none if it leads to the goal."""
        return None if self.route is None else self.route.exploration

    @property
    def exploring(self) -> bool:
        """Whether the global path leads to a viewpoint."""
        return self.exploration is not None

    @property
    def returning(self) -> bool:
        """Whether the global path leads back to where the sweeps held the pose."""
        return self.exploration is not None and self.exploration.returning

    @property
    def under_way(self) -> UnderWay:
        """The manoeuvre without a global path that may go on."""
        return "" if self.path_loss is None else self.path_loss.under_way

    def along(self, path: Array) -> PlannerState:
        """Return the state with the rest of its global path, (n, 3)."""
        assert self.route is not None
        return replace(self, route=replace(self.route, path=path))

    def searched(self, time_ns: int) -> PlannerState:
        """Return the state after a search for a cheaper global path at a time, ns."""
        assert self.route is not None
        return replace(self, route=replace(self.route, improved_ns=time_ns))


def for_next_goal(state: PlannerState) -> PlannerState:
    """Return the state after a goal was reached: all counts of tries begin again."""
    narrows = Narrows(oriented=state.narrows.oriented)
    return replace(state, rest_since_ns=-1, tries=Tries(), narrows=narrows)
