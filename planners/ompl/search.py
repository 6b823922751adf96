"""OMPL's planners as pure functions of (space, start, goal, budget, seed).

OMPL (Sucan, Moll, Kavraki, "The Open Motion Planning Library", IEEE RAM 2012) is deterministic if
its generator is reseeded before each plan, every object is new and built in a fixed order on one
thread, and a count ends the search, never the clock.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from ompl import base as ob
from ompl import geometric as og
from ompl import util as ou

from wayproof.planners import kernels
from wayproof.planners.astar.grid_astar import FieldPlanner
from wayproof.planners.free_space import FreeSpace
from wayproof.planners.kernels import Floats, Pose
from wayproof.planners.ompl._plugin import SEPARATOR, UserCodeError, load_class, user_code
from wayproof.planners.ompl.state_spaces import StateSpace, sample_curve
from wayproof.planners.ompl.validity import BodyValidity
from wayproof.planners.ompl.waypoint_planner import WaypointPlanner

# Reseeding a generator that was used before makes OMPL print an error, although it reseeds.
ou.setLogLevel(ou.LogLevel.LOG_NONE)


class Budget(NamedTuple):
    """What a planner is built with: turns of its loop, weight of the cell cost, and seed."""

    iterations: int
    clearance_weight: float
    seed: int = 1


Builder = Callable[[ob.SpaceInformation, Budget], ob.Planner]


def _fmt(information: ob.SpaceInformation, budget: Budget) -> ob.Planner:
    """FMT* spends a turn on each draw of a sample and up to one on expanding it."""
    planner = og.FMT(information)
    planner.setNumSamples(max(budget.iterations // 3, 1))
    return planner


# Left out: PRM and PRM* (a thread of their own), and RRT, BFMT, SORRT* and the other KPIECE
# variants, which differ little from the one of their family that is here.
PLANNERS: dict[str, Builder] = {
    "astar": lambda information, budget: FieldPlanner(information, budget.clearance_weight),
    "rrtconnect": lambda information, _: og.RRTConnect(information),
    "rrtstar": lambda information, _: og.RRTstar(information),
    "informed_rrtstar": lambda information, _: og.InformedRRTstar(information),
    "bitstar": lambda information, _: og.BITstar(information),
    "fmt": _fmt,
    "aorrtc": lambda information, _: og.AORRTC(information),
    "kpiece1": lambda information, _: og.KPIECE1(information),
}

FORMER_NAMES = {"field": "astar"}
"""Names of planners in logs of format 5 and before; a decision records the name of its config."""

END_TOLERANCE = 1e-6
"""How far the ends of a user's path may be from the query's start and goal [m]."""

UNSEEDED = ("astar",)
"""Planners that find the same path whatever the seed: they are never restarted."""


def registered(name: str) -> str:
    """The key in `PLANNERS` of a planner's name, or the name itself."""
    return FORMER_NAMES.get(name, name)


def planner_builder(name: str) -> Builder:
    """The planner of a name in ``PLANNERS``, or of ``module:Class`` or ``file.py:Class``.

    Raises:
        ValueError: If there is no such planner, or the class is no ``ompl.base.Planner`` and has
            no ``plan``.
    """
    name = registered(name)
    if name in PLANNERS:
        return PLANNERS[name]
    if SEPARATOR not in name:
        available = ", ".join(PLANNERS)
        raise ValueError(
            f"planner.name: got {name!r}, expected one of {available}, module:Class "
            "or path/to/file.py:Class"
        )
    try:
        found = load_class(name)
    except ValueError as error:
        raise ValueError(f"planner.name: got {name!r}, which cannot be loaded: {error}") from None
    if issubclass(found, ob.Planner):
        return lambda information, _: found(information)
    if not callable(getattr(found, "plan", None)):
        raise ValueError(
            f"planner.name: got {name!r}, expected a class made of ompl.base.Planner, or one with "
            "a method plan(space, start, goal, seed, budget)"
        )
    who = f"planner '{name}'"
    return lambda information, budget: WaypointPlanner(
        information, found(), who, budget.seed, budget.iterations
    )


class _EdgeValidator(ob.MotionValidator):  # type: ignore[misc]
    """Checks an edge exactly, in one call, instead of by points along it."""

    def __init__(self, information: ob.SpaceInformation, edge_free: Callable[..., bool]) -> None:
        super().__init__(information)
        self._edge_free = edge_free

    def checkMotion(self, a: ob.State, b: ob.State) -> bool:
        return self._edge_free(a, b)


class Query(NamedTuple):
    """Where a path leads from and to, and how it may run.

    Attributes:
        space: Where the path may run.
        kind: What a state is.
        start: Free pose.
        goal: Free pose.
        turning_radius: Least radius of a curve [m], for curved kinds.
        any_heading: Whether the path may end at another heading than the goal's.
    """

    space: FreeSpace
    kind: StateSpace
    start: Pose
    goal: Pose
    turning_radius: float
    any_heading: bool = False


def search(
    query: Query, name: str, budget: Budget, seed: int, simplifications: int
) -> tuple[Floats | None, int]:
    """Search one path with one planner.

    Args:
        query: The problem.
        name: A key of ``PLANNERS``, ``module:Class`` or ``file.py:Class``.
        budget: Turns of the planner's own loop after which it is stopped. Planners that improve
            their path use them all; the others stop at their first path.
        seed: Seed of OMPL's generator, in [1, 2**31 - 1].
        simplifications: Attempts of OMPL to leave states of a curved path out.

    Returns:
        Poses, shape (n, 4), from start to goal, or None; and the turns used.

    Raises:
        UserCodeError: A planner of the user's own raised, or added what is no path.
    """
    ou.RNG.setSeed(seed)
    information, definition = _problem(query)
    used = 0

    def spent() -> bool:
        nonlocal used
        used += 1
        return used > budget.iterations

    name = registered(name)
    run = _run if name in PLANNERS else _run_users
    run(name, information, definition, budget, ob.PlannerTerminationCondition(spent))
    used = min(used, budget.iterations)
    if not definition.hasExactSolution():
        return None, used
    path = definition.getSolutionPath()
    if name not in PLANNERS:
        _check_path(name, query, path)
    if query.kind.curved and simplifications > 0:
        og.PathSimplifier(information).reduceVertices(path, simplifications, simplifications, 1.0)
    return _poses(query, information.getStateSpace(), path), used


def _run(
    name: str,
    information: ob.SpaceInformation,
    definition: ob.ProblemDefinition,
    budget: Budget,
    until: ob.PlannerTerminationCondition,
) -> object:
    """Build a planner and let it solve; what it found is in the definition."""
    planner = planner_builder(name)(information, budget)
    planner.setProblemDefinition(definition)
    planner.setup()
    return planner.solve(until)


def _run_users(
    name: str,
    information: ob.SpaceInformation,
    definition: ob.ProblemDefinition,
    budget: Budget,
    until: ob.PlannerTerminationCondition,
) -> object:
    """The same with a planner of the user's own.

    Raises:
        UserCodeError: It raised, or returned something other than a status.
    """
    who = f"planner '{name}'"
    with user_code(who):
        status = _run(name, information, definition, budget, until)
    if not isinstance(status, (ob.PlannerStatus, type(ob.PlannerStatus.EXACT_SOLUTION))):
        got = type(status).__name__
        raise UserCodeError(who, f"returned {got} from solve, expected ompl.base.PlannerStatus")
    return status


def _check_path(name: str, query: Query, path: og.PathGeometric) -> None:
    """Refuse what no planner may add as a solution.

    An edge through blocked space is left to the cost, which is infinite: there is no path then.

    Raises:
        UserCodeError: The path is shorter than two states, not finite, or not from start to goal.
    """
    who, z = f"planner '{name}'", query.start[2]
    poses = np.array([query.kind.read(state, z) for state in path.getStates()]).reshape(-1, 4)
    if len(poses) < 2:
        raise UserCodeError(who, f"added a path of {len(poses)} states, expected 2 or more")
    wrong = np.flatnonzero(~np.isfinite(poses).all(axis=1))
    if len(wrong):
        raise UserCodeError(
            who, f"added a path whose state {wrong[0]} is {_place(poses[wrong[0]])}"
        )
    ends = (("start", poses[0], query.start), ("end", poses[-1], query.goal))
    for end, got, expected in ends:
        if not np.abs(got[:3] - expected[:3]).max() <= END_TOLERANCE:
            raise UserCodeError(
                who, f"added a path with its {end} at {_place(got)}, expected {_place(expected)}"
            )


def _place(pose: Sequence[float]) -> str:
    return "(" + ", ".join(f"{value:.3f}" for value in pose[:3]) + ")"


def _problem(query: Query) -> tuple[ob.SpaceInformation, ob.ProblemDefinition]:
    """OMPL's view of a query; every object is new, so that no search leaves a trace in the next."""
    state_space = query.kind.make(query.space, query.turning_radius)
    information = ob.SpaceInformation(state_space)
    information.setStateValidityChecker(
        BodyValidity(information, query.space, query.kind, query.start[2], query.any_heading)
    )
    information.setMotionValidator(_EdgeValidator(information, _edge_check(query, state_space)))
    information.setup()
    start, goal = information.allocState(), information.allocState()
    query.kind.write(start, query.start)
    query.kind.write(goal, query.goal)
    definition = ob.ProblemDefinition(information)
    definition.setStartAndGoalStates(start, goal)
    definition.setOptimizationObjective(ob.PathLengthOptimizationObjective(information))
    return information, definition


def _edge_check(query: Query, state_space: ob.StateSpace) -> Callable[..., bool]:
    """The one compiled check of an edge that this kind of state needs."""
    space, kind, z = query.space, query.kind, query.start[2]
    grid, threshold, shape, read = space.grid, space.collision_distance_sq, space.shape, kind.read
    if kind.curved:
        radius = query.turning_radius
        return lambda a, b: bool(
            kernels.poses_free(grid, shape, sample_curve(state_space, kind, a, b, radius, z))
        )
    if kind.oriented:
        return lambda a, b: bool(kernels.sweep_free(grid, shape, read(a, z), read(b, z)))
    return lambda a, b: bool(kernels.edge_free(grid, threshold, read(a, z)[:3], read(b, z)[:3]))


def _poses(query: Query, state_space: ob.StateSpace, path: og.PathGeometric) -> Floats:
    """A path's poses, shape (n, 4); between them the body moves evenly."""
    kind, z = query.kind, query.start[2]
    states = path.getStates()
    if not kind.curved:
        inner = [kind.read(state, z) for state in states[1:-1]]
        heading = kind.read(states[-1], z)[3] if query.any_heading else query.goal[3]
        goal = (*query.goal[:3], heading)
        return np.array([query.start, *inner, goal], dtype=np.float64)
    pieces = [
        sample_curve(state_space, kind, a, b, query.turning_radius, z)[1:]
        for a, b in itertools.pairwise(states)
    ]
    return np.vstack([np.array([query.start]), *pieces])
