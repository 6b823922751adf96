"""Facts of a contact: the map there, the path of the body, and the commands that led to it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from wayproof.harness.attribution.case import Case, Moment, off_path
from wayproof.harness.attribution.commanded import (
    OWN_REACH,
    CommandedFacts,
    answer_s,
    commanded_facts,
    commands_to,
    on_trial,
)
from wayproof.harness.attribution.old_evidence import OldFacts, old_facts
from wayproof.harness.attribution.pose import PoseFacts, error_of, pose_facts, usual_margin
from wayproof.harness.attribution.ranges import RangeFacts, range_facts
from wayproof.harness.decision import path_of
from wayproof.harness.log.paths import densely
from wayproof.harness.prior.cells import logged_cells
from wayproof.harness.result import Contact
from wayproof.harness.stack.pipeline import Navigator
from wayproof.maps.states import FREE, OCCUPIED, UNKNOWN

Array = NDArray[np.float64]

ABOUT_CELLS = 2
"""Radius of the part of the map around a contact that is examined, cells."""

LEAST_NOTICE = 0.5
"""Time before a contact within which a new obstacle could not be seen, s."""

UNDER_WAY = ("follow", "slow", "explore")
"""Actions whose trajectories avoid all mapped obstacles."""

SET_OUT = 0.3
"""Length at its start along which a trajectory may lead out of the inflation, m."""

LATE = 0.01
"""Excess over the expected delay that counts as late, s."""


@dataclass(frozen=True)
class ContactFacts:
    """Facts of one contact; positions in the world frame, m.

    Attributes:
        name: Name of the touched obstacle.
        time_s: Simulated time of the contact, s.
        decision: Last decision after which the robot could still have stopped before the contact.
        decision_s: Simulated time of that decision, s.
        there_when_decided: Whether the obstacle was there at that decision and before its sweep.
        there_when_observed: Whether it was there when the map last observed the place.
        observed_s: Simulated time of that observation, s; negative if there is none.
        away: Distance of the place of contact from the body at that time, m.
        free: Number of cells around the contact, outside the obstacle, that were mapped free.
        unknown: Number of those mapped unknown.
        own: Number of occupied cells that represent the obstacle.
        nearest_own: Distance of the nearest of them from the contact, m.
        off_path: Distance of the estimated position from the path that it followed, m.
        planned_clearance: True clearance of a body on that path, m.
        pose_error: Estimated less true position at the contact, m.
        margin: Localization margin, m.
        usual: A usual localization margin, m, see `usual_margin`.
        pose: Error of the pose, from one second before that decision on.
        ranges: Reported ranges against the true ones.
        disregarded: Length by which a trajectory chosen at that decision or later is nearer to
            mapped obstacles than body and margin allow, m.
        late: Earliest decision that avoids the place and would have been in time with the expected
            delay, but was not: its number, its delay and the expected one.
        hidden: Number of cells of the obstacle itself at the contact that were unknown, less those
            mapped free: negative of glass, which beams pass.
        late_answer: Part of that delay which a stack on trial took to answer, s.
        commanded: The commands of a stack on trial that led to it against the referee's verdict;
            None of the built-in stack, or if those that led to it were admitted.
        prior_free: Number of the unknown cells that a prior map which admits has free.
        old: Measures what of the evidence was old.
    """

    name: str
    time_s: float
    decision: int
    decision_s: float
    there_when_decided: bool
    there_when_observed: bool
    observed_s: float
    away: float
    free: int
    unknown: int
    own: int
    nearest_own: float
    off_path: float
    planned_clearance: float
    pose_error: float
    margin: float
    usual: float
    pose: PoseFacts
    ranges: RangeFacts
    disregarded: float
    late: tuple[int, float, float] | None
    late_answer: float = 0.0
    hidden: int = 0
    commanded: CommandedFacts | None = None
    prior_free: int = 0
    old: Callable[[], OldFacts] = OldFacts


def contact_facts(case: Case, contact: Contact, time_s: float) -> ContactFacts:
    """Measure the facts for the tests."""
    last = _last_before(case, time_s)
    place = np.array(contact.position)
    number = last_chance(case, place, time_s)
    commands = commands_to(case, time_s)
    if commands:
        number = max(number, commands[0])  # before that one the referee admitted all
    moment = case.moments[number]
    navigator = case.navigator_at(number)
    size = navigator.map.resolution
    believed = place + moment.error
    observed_s = float(navigator.map.observed_ns_at(believed[None])[0]) * 1e-9
    since = case.moments[max(number - 1, 0) : number + 1]  # a sweep takes that long
    free, unknown, hidden, admitted, own = _mapped_state(case, navigator, contact, moment)
    off, planned = _planned(case, contact, last, time_s)
    expected, late = case.config.latency.expected, _late(case, contact, number)
    return ContactFacts(
        name=contact.name,
        time_s=time_s,
        decision=number,
        decision_s=moment.time_ns * 1e-9,
        there_when_decided=all(_was_in_place(case, contact, one, 1.5 * size) for one in since),
        there_when_observed=_was_in_place(case, contact, _nearest(case, observed_s), 1.5 * size),
        observed_s=observed_s,
        away=_room(case, moment, place),
        free=free,
        unknown=unknown,
        own=len(own),
        nearest_own=float(own.min()) if len(own) else 0.0,
        off_path=off,
        planned_clearance=planned,
        pose_error=error_of(case, last),
        pose=pose_facts(case, _stretch(case, number, time_s), place),
        ranges=range_facts(case, _decision_before(case, time_s)),
        disregarded=0.0 if on_trial(case) else _disregarded(case, navigator, moment),
        margin=last.decision.localization_margin_m,
        usual=usual_margin(case, last),
        late=None if late is None else (late.decision.sequence, late.latency.delay_s, expected),
        hidden=hidden,
        late_answer=0.0 if late is None else answer_s(late),
        commanded=commanded_facts(
            case, numbers=commands, navigator=navigator, decision=number, name=contact.name
        ),
        prior_free=admitted,
        old=cache(lambda: old_facts(case, _decision_before(case, time_s))),
    )


def last_chance(case: Case, place: Array, time_s: float) -> int:
    """Return the number of the last decision after which the body could stop before a place."""
    expected = case.config.latency.expected
    latest = _decision_before(case, time_s - expected - LEAST_NOTICE)
    for number in range(latest, -1, -1):
        moment = case.moments[number]
        if _room(case, moment, place) >= stopping_room(case, moment, expected):
            return number
    return 0


def _stretch(case: Case, number: int, time_s: float) -> range:
    """Return the decisions from one second before a decision up to a time."""
    begin_s = case.moments[number].time_ns * 1e-9 - 1.0
    end = _decision_before(case, time_s)
    return range(min(_decision_before(case, begin_s), end), end + 1)


def _disregarded(case: Case, navigator: Navigator, moment: Moment) -> float:
    """Return by how much a trajectory comes too near to occupied cells of its map, m.

    Stops and recoveries start inside the inflation and do not count.
    """
    if moment.decision.action not in UNDER_WAY:
        return 0.0
    costmap = navigator.costmap
    path = densely(path_of(moment.decision.trajectory.path), costmap.resolution)
    path = path[np.linalg.norm(path - path[0], axis=1) > SET_OUT]
    if not len(path):
        return 0.0
    cells = np.floor((path - costmap.origin) / costmap.resolution).astype(int)
    cells = np.clip(cells, 0, np.array(costmap.shape) - 1)
    nearest = float(costmap.obstacle_clearance[tuple(cells.T)].min())
    if nearest > costmap.collision_distance_sq:
        return 0.0
    return costmap.inflation_radius - float(np.sqrt(nearest)) * costmap.resolution


def stopping_room(case: Case, moment: Moment, delay: float) -> float:
    """Return the stopping distance of the body, m, if a stop takes effect after a delay, s.

    v t + v^2 / 2 a, and v a / 2 j for building up the deceleration a with the jerk j.
    """
    speed = float(np.linalg.norm(np.array(moment.truth.velocity)[: case.axes]))
    a, j = case.mission.max_acceleration, case.mission.max_jerk
    return speed * delay + speed * speed / (2.0 * a) + speed * a / (2.0 * j)


def _room(case: Case, moment: Moment, place: Array) -> float:
    """Return the distance from the body to a place, m."""
    gap = float(np.linalg.norm((place - moment.true_position)[: case.axes]))
    return max(gap - case.mission.radius, 0.0)


def _last_before(case: Case, time_s: float) -> Moment:
    return case.moments[_decision_before(case, time_s)]


def _decision_before(case: Case, time_s: float) -> int:
    """Return the number of the last decision at or before a time; 0 if there is none."""
    return max((k for k, one in enumerate(case.moments) if one.time_ns * 1e-9 <= time_s), default=0)


def _nearest(case: Case, time_s: float) -> Moment:
    return min(case.moments, key=lambda one: abs(one.time_ns * 1e-9 - time_s))


def _was_in_place(case: Case, contact: Contact, moment: Moment, within: float) -> bool:
    """Return whether the touched obstacle was at the place of contact at a moment."""
    case.space.place_movers(moment.truth)
    return case.space.distance_to(np.array(contact.position), contact.name) <= within


def _mapped_state(
    case: Case, navigator: Navigator, contact: Contact, moment: Moment
) -> tuple[int, int, int, int, Array]:
    """Return the state of the map at a contact.

    Returns:
        Numbers of free, unknown and hidden cells, and of unknown ones that a prior map admits; and
        the distances of own cells, (n,) m.
    """
    size = navigator.map.resolution
    place = np.array(contact.position) + moment.error
    reach = OWN_REACH + float(np.linalg.norm(moment.error))
    steps = np.arange(-np.ceil(reach / size), np.ceil(reach / size) + 1) * size
    offsets = np.stack(np.meshgrid(steps, steps, steps), axis=-1).reshape(-1, 3)
    distances = np.linalg.norm(offsets, axis=1)
    states = navigator.map.state_at(place + offsets)
    case.space.place_movers(moment.truth)
    truly = np.array(contact.position)
    occupied = np.flatnonzero((states == OCCUPIED) & (distances <= reach))
    mine = [k for k in occupied if case.space.distance(truly + offsets[k])[1] == contact.name]
    about = np.flatnonzero(distances <= ABOUT_CELLS * size)
    outside = [
        k for k in about if case.space.distance_to(truly + offsets[k], contact.name) > 0.5 * size
    ]
    inside = np.setdiff1d(about, outside)
    return (
        int((states[outside] == FREE).sum()),
        int((states[outside] == UNKNOWN).sum()),
        int((states[inside] == UNKNOWN).sum()) - int((states[inside] == FREE).sum()),
        _admitted_by_prior(case, (place + offsets)[outside][states[outside] == UNKNOWN]),
        distances[mine],
    )


def _admitted_by_prior(case: Case, unknown: Array) -> int:
    """Return at how many unknown points (n, 3), m, a prior map lets the robot in."""
    cells = logged_cells(case.config) if case.config.prior.policy == "admit" else None
    return 0 if cells is None else int((cells.states_at(unknown) == FREE).sum())


def _planned(case: Case, contact: Contact, last: Moment, time_s: float) -> tuple[float, float]:
    """Return the distance of the body from its path, and the clearance of a body on it, m."""
    trajectory = case.followed(round(time_s * 1e9))
    if trajectory is None:
        return 0.0, 0.0
    ahead = np.array(last.truth.velocity) * (time_s - last.time_ns * 1e-9)
    believed = last.true_position + last.error + ahead
    off, nearest = off_path(trajectory, believed, case.axes)
    case.space.place_movers(case.moments[-1].truth if time_s >= case.end_s else last.truth)
    case.space.place_robot(nearest - last.error, np.array(last.truth.quaternion))
    return off, case.space.body_clearance(contact.name)


def _late(case: Case, contact: Contact, number: int) -> Moment | None:
    """Return the first decision of about the last second that would have been in time."""
    expected, place = case.config.latency.expected, np.array(contact.position)
    for moment in case.moments[number:]:
        delay = moment.latency.delay_s
        room = _room(case, moment, place)
        in_time = room >= stopping_room(case, moment, expected)
        too_late = moment.decision.deadline_missed or room < stopping_room(case, moment, delay)
        if delay > expected + LATE and in_time and too_late and _passes_by(case, contact, moment):
            return moment
    return None


def _passes_by(case: Case, contact: Contact, moment: Moment) -> bool:
    """Return whether a body on the trajectory of a decision truly avoids the obstacle."""
    believed = np.array(contact.position) + moment.error
    _, nearest = off_path(moment.decision.trajectory, believed, case.axes)
    if case.axes == 2:
        nearest[2] = moment.true_position[2]
    case.space.place_movers(moment.truth)
    case.space.place_robot(nearest - moment.error, np.array(moment.truth.quaternion))
    return case.space.body_clearance(contact.name) > 0.0
