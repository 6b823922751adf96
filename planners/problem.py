"""One planning problem: from a start to a goal through free space, within a counted budget."""

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from planners import kernels
from planners.kernels import Floats
from planners.sampling import PLANNERS, search
from planners.seeds import plan_seed
from planners.space import CLEARANCE_WEIGHT, FreeSpace

# How far a detour's apex is moved from the cut's middle at most, along each axis [m].
DETOUR_REACH = 1.0

PlanLabel = Literal["none", "no_path", "start_blocked", "goal_blocked"]


__all__ = ["PLANNERS", "Plan", "PlanLabel", "PlannerConfig", "plan"]


@dataclass(frozen=True)
class PlannerConfig:
    """What plans a path and how much it may spend.

    Attributes:
        name: A key of ``PLANNERS``.
        iterations: Turns of the planner's own loop for one plan, shared by its restarts.
        restarts: Searches from other seeds, of which the cheapest path wins. A planner that
            improves its first path spends the whole budget on it and never restarts.
        shortcuts: Attempts to cut or bend each search's path.
        clearance_weight: Weight of the cost of coming near obstacles against length.
        keep_ratio: A path that is still valid is replaced only by one that costs less than this
            share of it, so that the plan does not flip between sides.

    Raises:
        ValueError: If a field is out of its range.
    """

    name: str = "rrtconnect"
    iterations: int = 2000
    restarts: int = 4
    shortcuts: int = 300
    clearance_weight: float = CLEARANCE_WEIGHT
    keep_ratio: float = 0.9

    def __post_init__(self) -> None:
        if self.name not in PLANNERS:
            available = ", ".join(PLANNERS)
            raise ValueError(f"planner.name: got {self.name!r}, expected one of {available}")
        for field, least in (("iterations", 1), ("restarts", 1), ("shortcuts", 0)):
            if not getattr(self, field) >= least:
                got = getattr(self, field)
                raise ValueError(f"planner.{field}: got {got}, expected {least} or more")
        if not 0.0 <= self.clearance_weight < math.inf:
            got = f"{self.clearance_weight}"
            raise ValueError(f"planner.clearance_weight: got {got}, expected 0 or more, finite")
        if not 0.0 < self.keep_ratio <= 1.0:
            raise ValueError(f"planner.keep_ratio: got {self.keep_ratio}, expected in (0, 1]")

    def replaces(self, new_cost: float, old_cost: float) -> bool:
        """Whether a new path should replace a valid old one, by their costs [m]."""
        return new_cost < self.keep_ratio * old_cost


@dataclass(frozen=True)
class Plan:
    """A path, or why there is none.

    Attributes:
        waypoints: Shape (n, 3) [m], free edge by edge, from the start to the goal; None without.
        cost: Length plus weighted nearness to obstacles [m]; infinite without a path.
        length: [m]; infinite without a path.
        least_clearance: Least distance to a blocked cell along the path [m]; 0 without a path.
        iterations: Turns of the planner's loop that were used.
        label: ``none``, or why there is no path: ``no_path`` within the budget,
            ``start_blocked``, ``goal_blocked``.
    """

    waypoints: Floats | None
    cost: float
    length: float
    least_clearance: float
    iterations: int
    label: PlanLabel


def plan(space: FreeSpace, start: Floats, goal: Floats, config: PlannerConfig, seed: int) -> Plan:
    """Plan the cheapest path that the budget finds; a pure function of its arguments.

    Args:
        space: Where the path may run.
        start: World frame [m], shape (3,).
        goal: World frame [m], shape (3,).
        config: The planner and its budget.
        seed: Seed of this plan; restarts derive theirs from it.

    Returns:
        The path with its cost, or a label that says why there is none.
    """
    if not space.is_free(start):
        return _without_path("start_blocked", 0)
    if not space.is_free(goal):
        return _without_path("goal_blocked", 0)
    best, best_cost, used = None, math.inf, 0
    for restart in range(config.restarts):
        if used >= config.iterations:
            break
        path, spent = _search_once(
            space,
            start,
            goal,
            config,
            config.iterations - used,
            plan_seed(seed, "restart", restart),
        )
        used += spent
        cost = math.inf if path is None else space.path_cost(path, config.clearance_weight)
        if cost < best_cost:
            best, best_cost = path, cost
    if best is None:
        return _without_path("no_path", used)
    length = float(kernels.path_length(best))
    return Plan(best, best_cost, length, space.least_clearance(best), used, "none")


def _without_path(label: PlanLabel, iterations: int) -> Plan:
    return Plan(None, math.inf, math.inf, 0.0, iterations, label)


def _search_once(
    space: FreeSpace, start: Floats, goal: Floats, config: PlannerConfig, budget: int, seed: int
) -> tuple[Floats | None, int]:
    """One search and its shortcuts: the path if there is one, and the turns used."""
    if np.array_equal(start, goal):
        return np.array([start, goal], dtype=np.float64), 1
    path, used = search(space, start, goal, config.name, budget, seed)
    if path is None or math.isinf(space.path_cost(path, config.clearance_weight)):
        return None, used
    draws = _shortcut_draws(config.shortcuts, space.field.shape[2] > 1, seed)
    threshold, weight = space.blocked_at_or_below, float(config.clearance_weight)
    return kernels.shortcut(space.grid, threshold, weight, path, draws), used


def _shortcut_draws(count: int, spatial: bool, seed: int) -> Floats:
    """Two places along the path and an apex offset [m] for each attempt, shape (count, 5).

    The cube of a uniform draw keeps most offsets small, where they refine, and some large.
    """
    draws = np.random.Generator(np.random.PCG64(seed)).random((count, 5))
    centred = 2.0 * draws[:, 2:] - 1.0  # (count, 3)
    draws[:, 2:] = DETOUR_REACH * centred * centred * centred
    if not spatial:
        draws[:, 4] = 0.0
    return draws
