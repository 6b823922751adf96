"""Paths to the goal: in truth, with movers, and in the map."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from wayproof.harness.attribution.case import Case, Moment, update_as_decided
from wayproof.harness.attribution.commanded import admitted_length, own_plan
from wayproof.harness.attribution.ghosts import ghosts, turning_radius, without_movers
from wayproof.harness.attribution.grids import (
    CLIMBED,
    DETOUR,
    Array,
    cell_of,
    clearances,
    distances_from,
    neighbourhood,
    passage,
    true_occupancy,
)
from wayproof.harness.log.paths import length
from wayproof.harness.recompute.moments import SegmentedStack
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.harness.stack.mapping import MARGIN_SIGMAS
from wayproof.harness.stack.pipeline import Navigator
from wayproof.harness.stack.planner_input import motion_limits
from wayproof.maps.states import OCCUPIED, UNKNOWN

NO_PATH = "no_path"
"""Label of a decision whose search found no path."""

LOOKS = 5
"""Number of last decisions whose maps are searched for paths."""


@dataclass(frozen=True)
class TrueWays:
    """Paths that truly exist.

    Attributes:
        radius: Half the width that a path needs with a certain pose, m; a long body has to be able
            to turn in it too.
        exists: Whether a path exists for this body and margin, over ramps that the settings allow.
        over_ramps: Whether one exists over ramps that the settings make obstacles, if not.
        at_start: Distance from the start to the nearest obstacle, m.
        shortest_s: Least time along the shortest path from rest to rest, through all goals of the
            mission, at the speed that the settings allow, s; 0 unless time ran out.
        speed: That speed, m/s.
        left_m: Remaining path length when time ran out, m; inf without a path.
        gained_m: Path length covered over the last decisions, m.
        widest: Measures half the width of the widest path without movers, m, once, as that takes
            long; 0 without one.
        open_at_end: Finds whether a path exists with the movers as they are at the end, likewise;
            or none without them, either.
    """

    radius: float
    exists: bool
    over_ramps: bool
    at_start: float
    shortest_s: float
    speed: float
    left_m: float
    gained_m: float
    widest: Callable[[], float]
    open_at_end: Callable[[], bool]


@dataclass(frozen=True)
class MapWays:
    """Paths in the map over the last decisions.

    Attributes:
        known: Fraction of decisions with a path through known free space.
        passable: Fraction with a path through space that is not occupied.
        in_vain: Fraction whose search found no path.
        not_found: Fraction of these with a path through space that is not occupied.
        roomy: Fraction with a path on which the body may turn as it likes.
        certain: Fraction with a path through space that is not occupied if the pose were certain.
        ghosts: Number of cells mapped occupied at the end that are truly free, recent movers apart.
        of_prior: Number of these that only a prior map holds occupied.
        ghost: Centre of the ghost nearest to the robot, m.
        without_ghosts: Whether a path exists at the end without ghosts.
        roomy_without_ghosts: Whether one exists on which the body may turn as it likes.
        without_movers: Whether one exists without present and recent movers.
        held_up: Fraction of all searches without a path whose map had one without movers; 0 unless
            time ran out.
        unknown: Fraction of the cells in the plane or space of motion that are unknown.
        own_plan_m: Length of the last plan of a stack on trial, m; 0 without one.
        own_plan_clear_m: Length of it up to the first cell that the body may not enter, m.
    """

    known: float
    passable: float
    in_vain: float
    not_found: float
    roomy: float
    certain: float
    ghosts: int
    of_prior: int
    ghost: tuple[float, float, float]
    without_ghosts: bool
    roomy_without_ghosts: bool
    without_movers: bool
    held_up: float
    unknown: float
    own_plan_m: float = 0.0
    own_plan_clear_m: float = 0.0


def true_ways(case: Case, navigator: Navigator, since: int) -> TrueWays:
    """Search the true scene on the grid of a stack; progress counts from a decision on."""
    last = case.moments[-1]
    size, radius = navigator.costmap.resolution, certain_radius(navigator, last.decision)
    start = np.array(case.mission.start)
    way = passage(case, navigator, start, corners=True)
    here = passage(case, navigator, last.true_position, corners=True)
    case.space.place_movers(last.truth, present=False)

    def gaps_over(steepest: float | None) -> Array:
        """Return the distance of each cell to what is truly closed, m."""
        return clearances(true_occupancy(case, navigator, steepest=steepest), size)

    still, over_ramps, steepest = gaps_over(None), False, None
    exists = way.leads(still > radius)
    if not exists and case.mission.planar and case.space.has_ramps:
        allowed = case.config.costmap.max_slope
        if allowed > 0.0 and way.leads((climbed := gaps_over(allowed)) > radius):
            still, exists, steepest = climbed, True, allowed
        else:
            over_ramps = way.leads(gaps_over(CLIMBED) > radius)

    @cache
    def lengths_to(end: tuple[int, ...]) -> Array:
        return distances_from(still > radius, end, way.reach, size) / DETOUR[case.axes]

    @cache
    def open_at_end() -> bool:
        if not last.truth.movers or not here.leads(still > radius):  # nothing that moves closed it
            return True
        case.space.place_movers(last.truth)
        return here.leads(gaps_over(steepest) > radius)

    def length_from(place: Array, end: tuple[int, ...]) -> float:
        about = neighbourhood(cell_of(navigator, place), way.reach)
        return float(lengths_to(end)[about].min())

    shortest, left, gained = 0.0, math.inf, 0.0
    speed, mission = motion_limits(case.config, case.mission).speed, case.segments[-1].mission
    if exists and case.outcome == "timeout":  # time decides no other outcome
        places = [np.array(place) for place in (mission.start, *mission.goals)]
        shortest = sum(
            rest_to_rest(
                length_from(begin, cell_of(navigator, end)), speed, mission.max_acceleration
            )
            for begin, end in pairwise(places)
        )
        left = length_from(last.true_position, way.goal)
        before = length_from(case.moments[since].true_position, way.goal)
        gained = before - left if math.isfinite(before) and math.isfinite(left) else 0.0
    return TrueWays(
        radius=radius,
        exists=exists,
        over_ramps=over_ramps,
        at_start=float(still[way.start]),
        shortest_s=shortest,
        speed=speed,
        left_m=left,
        gained_m=gained,
        widest=cache(lambda: way.widest(still)),
        open_at_end=open_at_end,
    )


class _Look(NamedTuple):
    """Paths in the map of one decision."""

    known: bool
    passable: bool
    roomy: bool
    certain: bool


def map_ways(case: Case, since: int) -> MapWays:
    """Search the maps of some decisions from one on."""
    numbers = range(since, len(case.moments))
    ever = [k for k, one in enumerate(case.moments) if one.decision.label == NO_PATH]
    in_vain = [k for k in ever if k >= since]
    some, some_in_vain = _evenly(numbers), _evenly(in_vain)
    crossed = case.outcome == "timeout" and bool(case.moments[-1].truth.movers)
    some_ever = _evenly(ever) if crossed else []
    looks: dict[int, _Look] = {}
    held_up: list[bool] = []
    navigator = None
    for number, navigator in _maps(case, {*some, *some_in_vain, *some_ever, numbers[-1]}):
        looks[number] = _search_for_paths(case, navigator, case.moments[number])
        if number in some_ever:
            held_up.append(not looks[number].passable and without_movers(case, navigator, number))
    assert navigator is not None
    last = case.moments[-1]
    planned, plan = 0.0, own_plan(last)
    if plan is not None and len(plan) >= 2:
        planned = length(plan)
        clear = admitted_length(last.decision, case.mission, navigator.costmap, plan)
    looked = [looks[k] for k in some]
    return MapWays(
        own_plan_m=planned,
        own_plan_clear_m=clear if planned else 0.0,
        known=float(np.mean([one.known for one in looked])),
        passable=float(np.mean([one.passable for one in looked])),
        roomy=float(np.mean([one.roomy for one in looked])),
        certain=float(np.mean([one.certain for one in looked])),
        in_vain=len(in_vain) / len(numbers),
        not_found=float(np.mean([looks[k].passable for k in some_in_vain] or [False])),
        held_up=float(np.mean(held_up or [False])),
        unknown=float((navigator.costmap.state == UNKNOWN).mean()),
        **ghosts(case, navigator),
    )


def _search_for_paths(case: Case, navigator: Navigator, moment: Moment) -> _Look:
    costmap = navigator.costmap
    size, radius = costmap.resolution, costmap.inflation_radius
    way = passage(case, navigator, moment.believed, corners=False)
    occupied, unknown = costmap.state == OCCUPIED, costmap.state == UNKNOWN
    gaps = clearances(occupied, size)
    return _Look(
        known=way.leads(clearances(occupied | unknown, size) > radius),
        passable=way.leads(gaps > radius),
        roomy=way.lets_turn(gaps > turning_radius(case, navigator)),
        certain=way.leads(gaps > certain_radius(navigator, moment.decision)),
    )


def certain_radius(navigator: Navigator, decision: pb.Decision) -> float:
    """Return the inflation radius of a decision, had its pose been certain, m.

    A usual uncertainty is part of the margin.

    Args:
        navigator: Stack with the costmap of the decision.
        decision: The decision, with the uncertainty of its pose.
    """
    widened = max(decision.widening, default=0) * decision.resolution_m
    doubt = MARGIN_SIGMAS * decision.position_sigma - widened
    return navigator.costmap.inflation_radius - max(doubt - USUAL_DOUBT, 0.0)


USUAL_DOUBT = 0.05
"""Usual uncertainty of a localized pose, m; any beyond it widens the margin."""


def rest_to_rest(length: float, v: float, a: float) -> float:
    """Return the least time for a path from rest to rest at a speed v and an acceleration a, s.

    Jerk, turns and bends would add to it.
    L / v + v / a where the speed is reached, and 2 sqrt(L / a) where it is not.
    """
    if length <= 0.0 or not math.isfinite(length):
        return 0.0
    if length >= v * v / a:
        return length / v + v / a
    return 2.0 * math.sqrt(length / a)


def _evenly(numbers: Sequence[int]) -> list[int]:
    """Return `LOOKS` of some numbers, evenly spread, or all of them."""
    if len(numbers) <= LOOKS:
        return list(numbers)
    return [numbers[int(k)] for k in np.linspace(0, len(numbers) - 1, LOOKS)]


def _maps(case: Case, numbers: set[int]) -> Iterator[tuple[int, Navigator]]:
    """Yield a stack in the state of each of some decisions."""
    stack = SegmentedStack(case.segments)
    for number, moment in enumerate(case.moments):
        stack.watch(moment.inputs)
        if number in numbers:
            update_as_decided(stack.navigator, moment.decision)
            yield number, stack.navigator
