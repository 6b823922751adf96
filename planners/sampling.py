"""OMPL's planners as pure functions of (space, start, goal, budget, seed).

OMPL (Sucan, Moll, Kavraki, "The Open Motion Planning Library", IEEE RAM 2012) is deterministic if
its generator is reseeded before each plan, every object is new and built in a fixed order on one
thread, and a count ends the search, never the clock.
"""

from collections.abc import Callable

import numpy as np
from ompl import base as ob
from ompl import geometric as og
from ompl import util as ou

from planners import kernels
from planners.kernels import Floats
from planners.space import FreeSpace

# Reseeding a generator that was used before makes OMPL print an error, although it reseeds.
ou.setLogLevel(ou.LogLevel.LOG_NONE)

Builder = Callable[[ob.SpaceInformation, int], ob.Planner]


def _fmt(information: ob.SpaceInformation, iterations: int) -> ob.Planner:
    """FMT* spends a turn on each draw of a sample and up to one on expanding it."""
    planner = og.FMT(information)
    planner.setNumSamples(max(iterations // 3, 1))
    return planner


# Left out: PRM and PRM* (a thread of their own), and RRT, BFMT, SORRT* and the other KPIECE
# variants, which differ little from the one of their family that is here.
PLANNERS: dict[str, Builder] = {
    "rrtconnect": lambda information, _: og.RRTConnect(information),
    "rrtstar": lambda information, _: og.RRTstar(information),
    "informed_rrtstar": lambda information, _: og.InformedRRTstar(information),
    "bitstar": lambda information, _: og.BITstar(information),
    "fmt": _fmt,
    "aorrtc": lambda information, _: og.AORRTC(information),
    "kpiece1": lambda information, _: og.KPIECE1(information),
}


class _EdgeValidator(ob.MotionValidator):  # type: ignore[misc]
    """Checks an edge exactly, in one call, instead of by points along it."""

    def __init__(self, information: ob.SpaceInformation, edge_free: Callable[..., bool]) -> None:
        super().__init__(information)
        self._edge_free = edge_free

    def checkMotion(self, a: ob.State, b: ob.State) -> bool:
        return self._edge_free(a, b)


def _point_reader(space: FreeSpace, height: float) -> Callable[[ob.State], kernels.Point]:
    """How a state reads as a point: ground robots plan in the plane."""
    if space.field.shape[2] == 1:
        return lambda state: (state[0], state[1], height)
    return lambda state: (state[0], state[1], state[2])


def _state_space(space: FreeSpace) -> ob.RealVectorStateSpace:
    shape = space.field.shape
    dimensions = 2 if shape[2] == 1 else 3
    bounds = ob.RealVectorBounds(dimensions)
    for axis in range(dimensions):
        bounds.setLow(axis, float(space.origin[axis]))
        bounds.setHigh(axis, float(space.origin[axis] + shape[axis] * space.resolution))
    state_space = ob.RealVectorStateSpace(dimensions)
    state_space.setBounds(bounds)
    return state_space


def _state(information: ob.SpaceInformation, point: Floats) -> ob.State:
    state = information.allocState()
    for axis in range(information.getStateDimension()):
        state[axis] = float(point[axis])
    return state


def search(
    space: FreeSpace, start: Floats, goal: Floats, name: str, iterations: int, seed: int
) -> tuple[Floats | None, int]:
    """Search one path with one planner.

    Args:
        space: Where the path may run.
        start: Free point [m], shape (3,).
        goal: Free point [m], shape (3,).
        name: A key of ``PLANNERS``.
        iterations: Turns of the planner's own loop after which it is stopped. Planners that
            improve their path use them all; the others stop at their first path.
        seed: Seed of OMPL's generator, in [1, 2**31 - 1].

    Returns:
        Way points, shape (n, 3), from start to goal, or None; and the turns used.
    """
    ou.RNG.setSeed(seed)
    grid, threshold = space.grid, space.blocked_at_or_below
    point = _point_reader(space, float(start[2]))

    def edge_free(a: ob.State, b: ob.State) -> bool:
        return bool(kernels.edge_free(grid, threshold, point(a), point(b)))

    information = ob.SpaceInformation(_state_space(space))
    information.setStateValidityChecker(lambda state: edge_free(state, state))
    information.setMotionValidator(_EdgeValidator(information, edge_free))
    information.setup()
    problem = ob.ProblemDefinition(information)
    problem.setStartAndGoalStates(_state(information, start), _state(information, goal))
    problem.setOptimizationObjective(ob.PathLengthOptimizationObjective(information))
    planner = PLANNERS[name](information, iterations)
    planner.setProblemDefinition(problem)
    planner.setup()
    used = 0

    def spent() -> bool:
        nonlocal used
        used += 1
        return used > iterations

    planner.solve(ob.PlannerTerminationCondition(spent))
    used = min(used, iterations)
    if not problem.hasExactSolution():
        return None, used
    states = problem.getSolutionPath().getStates()
    inner = [point(state) for state in states[1:-1]]
    return np.array([start, *inner, goal], dtype=np.float64), used
