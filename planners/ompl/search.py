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

from wayproof.planners.free_space import FreeSpace
from wayproof.planners.kernels import segment, sweep
from wayproof.planners.kernels.grid import Floats, Pose
from wayproof.planners.ompl.state_spaces import BodyValidity, StateSpace, sample_curve
from wayproof.planners.registry import Budget, is_registered, planner_builder
from wayproof.plugin import UserCodeError, user_code

# Reseeding a generator that was used before makes OMPL print an error, although it reseeds.
ou.setLogLevel(ou.LogLevel.LOG_NONE)

END_TOLERANCE = 1e-6
"""Largest distance of the ends of a user's path from the query's start and goal, m."""


class _EdgeValidator(ob.MotionValidator):  # type: ignore[misc]
    """Exact check of an edge, in place of OMPL's checks of points along it."""

    def __init__(self, information: ob.SpaceInformation, edge_free: Callable[..., bool]) -> None:
        super().__init__(information)
        self._edge_free = edge_free

    def checkMotion(self, a: ob.State, b: ob.State) -> bool:
        return self._edge_free(a, b)


class Query(NamedTuple):
    """Ends of a path and the space that it runs in.

    Attributes:
        space: Free space.
        kind: State space.
        start: Free pose.
        goal: Free pose.
        turning_radius: Least radius of a curve, m, for curved kinds.
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
    """Search one path with a planner.

    Args:
        query: Ends and space.
        name: A key of `PLANNERS`, `module:Class` or `file.py:Class`.
        budget: Its iterations end the search. Planners that improve their path use them all; the
            others stop at their first path.
        seed: Seed of OMPL's generator, in [1, 2**31 - 1].
        simplifications: Number of attempts of OMPL to leave out states of a curved path.

    Returns:
        Poses from start to goal, shape (n, 4), or None; and the iterations used.

    Raises:
        UserCodeError: A planner of the user's own raised, or added no valid path.
    """
    ou.RNG.setSeed(seed)
    information, definition = _problem(query)
    used = 0

    def spent() -> bool:
        nonlocal used
        used += 1
        return used > budget.iterations

    run = _run if is_registered(name) else _run_user_planner
    run(name, information, definition, budget, ob.PlannerTerminationCondition(spent))
    used = min(used, budget.iterations)
    if not definition.hasExactSolution():
        return None, used
    path = definition.getSolutionPath()
    if not is_registered(name):
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
    """Build a planner and solve; the solution is added to the definition."""
    planner = planner_builder(name)(information, budget)
    planner.setProblemDefinition(definition)
    planner.setup()
    return planner.solve(until)


def _run_user_planner(
    name: str,
    information: ob.SpaceInformation,
    definition: ob.ProblemDefinition,
    budget: Budget,
    until: ob.PlannerTerminationCondition,
) -> object:
    """Run as `_run` with a planner of the user's own.

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
    """Check the solution of a user's planner.

    An edge through blocked space is accepted: its cost is infinite, so there is no path then.

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
    """Make OMPL's objects of a query, all of them new: no search affects the next."""
    state_space = query.kind.make(query.space, query.turning_radius)
    information = ob.SpaceInformation(state_space)
    information.setStateValidityChecker(
        BodyValidity(
            information, query.space, query.kind, z=query.start[2], any_heading=query.any_heading
        )
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
    """Return the compiled check of an edge of this kind of state."""
    space, kind, z = query.space, query.kind, query.start[2]
    grid, threshold, shape, read = space.grid, space.collision_distance_sq, space.shape, kind.read
    if kind.curved:
        radius = query.turning_radius
        return lambda a, b: bool(
            sweep.poses_free(grid, shape, sample_curve(state_space, kind, a, b, radius, z))
        )
    if kind.oriented:
        return lambda a, b: bool(sweep.sweep_free(grid, shape, read(a, z), read(b, z)))
    return lambda a, b: bool(segment.edge_free(grid, threshold, read(a, z)[:3], read(b, z)[:3]))


def _poses(query: Query, state_space: ob.StateSpace, path: og.PathGeometric) -> Floats:
    """Return poses of a path, shape (n, 4), between which position and heading change evenly."""
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
