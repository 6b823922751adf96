"""Registry of planners by name: builders and capabilities."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from ompl import base as ob
from ompl import geometric as og

from wayproof.planners.astar.grid_astar import GridAStar
from wayproof.planners.ompl.state_spaces import POSE_IN_SPACE, STATE_SPACES, StateSpace
from wayproof.planners.ompl.waypoint_planner import WaypointPlanner
from wayproof.plugin import SEPARATOR, load_class


class Budget(NamedTuple):
    """Settings of a planner."""

    iterations: int  # of its own loop
    clearance_weight: float  # of the cell cost against length
    seed: int = 1


Builder = Callable[[ob.SpaceInformation, Budget], ob.Planner]


class PlannerTraits(NamedTuple):
    """Capabilities of a planner; the defaults are those of a user's own."""

    uses_seed: bool = True
    """Whether another seed may give another path; without one it is never restarted."""

    complete: bool = False
    """Whether it finds a path of positions wherever the grid has one."""

    chooses_heading: bool = False
    """Whether it takes any heading at the goal, where it is free, instead of each in turn."""

    curves: bool = True
    """Whether it plans the curves of `reeds_shepp` and `dubins`."""

    poses_in_space: bool = True
    """Whether OMPL supports it in R3 x SO(2), by informed samples or a projection."""

    coincident_ends: bool = True
    """Whether it plans from a state to the same one: the ellipsoid that Informed RRT* samples has
    no size then, which ends the search in an error in OMPL 2.0.1."""

    asymmetric: bool = True
    """Whether the way back may be of another length, as on Dubins curves: there AORRTC ends the
    process in OMPL 2.0.1, in 3 of 4 episodes."""


class PlannerEntry(NamedTuple):
    """A planner that has a name."""

    build: Builder
    traits: PlannerTraits = PlannerTraits()
    source: str = ""
    """The method and its paper."""


def _fmt(information: ob.SpaceInformation, budget: Budget) -> ob.Planner:
    """FMT* spends an iteration on each sample that it draws and up to one on expanding it."""
    planner = og.FMT(information)
    planner.setNumSamples(max(budget.iterations // 3, 1))
    return planner


# Left out: PRM and PRM* (a thread of their own), and RRT, BFMT, SORRT* and the other KPIECE
# variants, which differ little from the one of their family that is here.
PLANNERS: dict[str, PlannerEntry] = {
    "astar": PlannerEntry(
        lambda information, budget: GridAStar(information, budget.clearance_weight),
        PlannerTraits(uses_seed=False, complete=True, chooses_heading=True, curves=False),
        "A* on the grid of the costmap (Hart, Nilsson and Raphael 1968), with shortcuts.",
    ),
    "rrtconnect": PlannerEntry(
        lambda information, _: og.RRTConnect(information),
        source="OMPL's RRT-Connect (Kuffner and LaValle 2000).",
    ),
    "rrtstar": PlannerEntry(
        lambda information, _: og.RRTstar(information),
        source="OMPL's RRT* (Karaman and Frazzoli 2011).",
    ),
    "informed_rrtstar": PlannerEntry(
        lambda information, _: og.InformedRRTstar(information),
        PlannerTraits(poses_in_space=False, coincident_ends=False),
        "OMPL's Informed RRT* (Gammell, Srinivasa and Barfoot 2014).",
    ),
    "bitstar": PlannerEntry(
        lambda information, _: og.BITstar(information),
        PlannerTraits(poses_in_space=False),
        "OMPL's BIT* (Gammell, Srinivasa and Barfoot 2015).",
    ),
    "fmt": PlannerEntry(_fmt, source="OMPL's FMT* (Janson, Schmerling, Clark and Pavone 2015)."),
    "aorrtc": PlannerEntry(
        lambda information, _: og.AORRTC(information),
        PlannerTraits(poses_in_space=False, asymmetric=False),
        "OMPL's AORRTC, asymptotically optimal RRT-Connect (Wilson et al. 2025).",
    ),
    "kpiece1": PlannerEntry(
        lambda information, _: og.KPIECE1(information),
        PlannerTraits(poses_in_space=False),
        "OMPL's KPIECE1 (Sucan and Kavraki 2009).",
    ),
}


def is_registered(name: str) -> bool:
    """Return whether a name is in `PLANNERS`; any other is a user's own planner."""
    return name in PLANNERS


def planner_traits(name: str) -> PlannerTraits:
    """Return the capabilities of the planner of a name."""
    entry = PLANNERS.get(name)
    return PlannerTraits() if entry is None else entry.traits


def planner_builder(name: str) -> Builder:
    """Return the builder of a name in `PLANNERS`, or of `module:Class` or `file.py:Class`.

    Raises:
        ValueError: If there is no such planner, or the class is no `ompl.base.Planner` and has no
            `plan`.
    """
    if is_registered(name):
        return PLANNERS[name].build
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
        information, planner=found(), who=who, seed=budget.seed, budget=budget.iterations
    )


def state_space_for(name: str, planner: str, *, flat: bool, discs: bool) -> StateSpace:
    """Return the state space of a name; `auto` has a heading where the body is more than one disc.

    Args:
        name: `auto` or a key of `STATE_SPACES`.
        planner: Name of the planner that searches it.
        flat: Whether the body moves in the plane.
        discs: Whether the body is checked at its heading.

    Raises:
        ValueError: If the body needs a heading and this has none, it is for the plane only, or the
            planner cannot search it.
    """
    if name == "auto":
        name = "pose" if discs else "position"
    traits, found = planner_traits(planner), STATE_SPACES[name][0 if flat else 1]
    if found is None:
        raise ValueError(f"planner.state_space: got {name} in space, expected position or pose")
    if discs and not found.oriented:
        raise ValueError(f"planner.state_space: got {name} for a body of discs, expected pose")
    if found is POSE_IN_SPACE and not traits.poses_in_space:
        without = "" if discs else "position, or "
        others = [key for key, entry in PLANNERS.items() if not entry.traits.poses_in_space]
        raise ValueError(
            f"planner.state_space: got {name} in space for the planner {planner}, expected "
            f"{without}a planner other than {', '.join(others)}"
        )
    if name == "dubins" and not traits.asymmetric:
        others = [key for key, entry in PLANNERS.items() if not entry.traits.asymmetric]
        raise ValueError(
            f"planner.state_space: got {name} for the planner {planner}, expected reeds_shepp, or "
            f"a planner other than {', '.join(others)}"
        )
    return found
