"""The cause of not arriving: whether there was a way in truth, in the map, and for the planner.

The tests are asked in order, each a question to measured facts, and the first that answers names
the cause: first whether decisions took effect at all, then whether any way truly existed, then what
stood in it, truly or in the map alone, then the body, and what is left is the planner.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from harness.cause.case import Case, Moment, off_path
from harness.cause.contact import LATE
from harness.cause.finding import Finding
from harness.cause.grids import (
    Cells,
    cell_of,
    clearances,
    holes_in_floor,
    joined,
    true_occupancy,
    widest,
)
from harness.stack.navigator import Navigator
from maps.states import OCCUPIED, UNKNOWN

HALF = 0.5
"""The share of the last decisions that had to be discarded, or to find the body off its path."""

STAYED = 0.3
"""Less movement than this is none, m."""

GHOST_CELLS = 1.5
"""An occupied cell farther than this from anything true, pose error apart, is a ghost."""


@dataclass(frozen=True)
class StandstillFacts:
    """What is known of an episode that ended without a contact.

    Attributes:
        outcome: Of the episode.
        reason: In words.
        window: Decisions at the end that are looked at.
        discarded: Share of them past their deadline.
        late: Share of the last ten decisions that took effect later than reckoned with.
        deadline: s.
        delay: Median of their delays, s.
        off_path: Share of them with the body farther off its path than the tracking tolerance.
        worst_off_path: m.
        radius: That a way has to be wide for, half of it: the inflation radius, m.
        true_widest: Of the ways that truly exist without what moves, m; 0 if there is none.
        true_way: Whether there is one for this body and margin.
        way_with_movers: Whether there is with the movers as they are at the end.
        map_way: Whether there is through what the map does not hold for occupied.
        known_way: Whether there is through what it knows to be free.
        ghosts: Cells mapped occupied that are truly free.
        holes: Of these, columns of a walking robot that are forbidden because the map holds what
            lies under their floor for free.
        ghost: Centre of the one nearest to the robot, m.
        way_without_ghosts: Whether there is a way in the map without them.
        shortest_s: Time that the straight way takes at full speed.
        limit_s: Time limit.
        claimed: Whether the robot claimed the goal where it was not.
        pose_error: At the end, m.
        margin: Localization margin, m.
        iterations: Spent by the last search.
        unknown: Share of the map's cells in the plane or space of motion that are unknown.
    """

    outcome: str
    reason: str
    window: int
    discarded: float
    late: float
    deadline: float
    delay: float
    off_path: float
    worst_off_path: float
    radius: float
    true_widest: float
    true_way: bool
    way_with_movers: bool
    map_way: bool
    known_way: bool
    ghosts: int
    holes: int
    ghost: tuple[float, float, float]
    way_without_ghosts: bool
    shortest_s: float
    limit_s: float
    claimed: bool
    pose_error: float
    margin: float
    iterations: int
    unknown: float


def latency(facts: StandstillFacts) -> str | None:
    """Decisions came past their deadline and were discarded."""
    if facts.discarded < HALF:
        return None
    return (
        f"{facts.discarded:.0%} of the last {facts.window} decisions took longer than the deadline "
        f"of {facts.deadline * 1e3:.0f} ms (median {facts.delay * 1e3:.0f} ms) and were discarded"
    )


def late_setpoints(facts: StandstillFacts) -> str | None:
    """The body lost its balance while every trajectory began for it where it no longer was."""
    if facts.outcome != "fall" or facts.late < HALF:
        return None
    return (
        f"{facts.late:.0%} of the last ten decisions took effect later than the stack "
        f"reckoned with (median {facts.delay * 1e3:.0f} ms), so setpoints jumped; {facts.reason}"
    )


def left_its_path(facts: StandstillFacts) -> str | None:
    """The body fell, or left the area that every path keeps to."""
    if facts.outcome not in ("fall", "out_of_bounds"):
        return None
    return f"{facts.reason}: no path leads there; last {facts.worst_off_path:.2f} m off its path"


def margin_too_small(facts: StandstillFacts) -> str | None:
    """The pose was farther off than the margin allows for, so the goal was missed."""
    if not facts.claimed:
        return None
    return f"the pose was {facts.pose_error:.2f} m off, and the margin was {facts.margin:.2f} m"


def impossible(facts: StandstillFacts) -> str | None:
    """There is no way in truth for this body and margin, or none that takes so little time."""
    if not facts.true_way:
        return (
            f"no way to the goal exists for a body of {facts.radius:.2f} m with its margin; the "
            f"widest lets {facts.true_widest:.2f} m pass"
        )
    if facts.shortest_s > facts.limit_s:
        return (
            f"the shortest way takes {facts.shortest_s:.1f} s at full speed, "
            f"the limit was {facts.limit_s:.1f} s"
        )
    return None


def moved_obstacle(facts: StandstillFacts) -> str | None:
    """What moves stood in the only way."""
    if facts.way_with_movers:
        return None
    return "a way exists, but something that moves truly closed it at the end"


def ghost_obstacle(facts: StandstillFacts) -> str | None:
    """The way is closed in the map alone, by cells that are truly free."""
    if facts.map_way or not facts.ghosts or not facts.way_without_ghosts:
        return None
    x, y, z = facts.ghost
    seen_through = (
        f"{facts.holes} of them as beams went through their floor, " if facts.holes else ""
    )
    return (
        f"{facts.ghosts} cells mapped occupied are truly free, {seen_through}"
        f"such as ({x:.2f}, {y:.2f}, {z:.2f}), and without them the map has a way to the goal"
    )


def tracking(facts: StandstillFacts) -> str | None:
    """The body does not go where its path leads."""
    if facts.off_path < HALF:
        return None
    return (
        f"the body was off its path in {facts.off_path:.0%} of the last {facts.window} decisions, "
        f"by up to {facts.worst_off_path:.2f} m"
    )


def planner(facts: StandstillFacts) -> str | None:
    """A way existed in truth and in the map, and it was not taken."""
    if facts.known_way:
        where = "through space that the map knew to be free"
    elif facts.map_way:
        where = f"through space that nobody had looked at ({facts.unknown:.0%} was unknown)"
    else:
        where = "in truth, though not in the map's cells"
    return f"a way existed {where}; the last search spent {facts.iterations} iterations"


TESTS: tuple[tuple[str, Callable[[StandstillFacts], str | None]], ...] = (
    ("latency", latency),
    ("latency", late_setpoints),
    ("tracking", left_its_path),
    ("margin_too_small", margin_too_small),
    ("impossible", impossible),
    ("moved_obstacle", moved_obstacle),
    ("ghost_obstacle", ghost_obstacle),
    ("tracking", tracking),
    ("planner", planner),
)
"""In the order in which they are asked."""


def cause_of_standstill(case: Case) -> Finding:
    """Why the goal was not reached, where nothing was touched."""
    facts = standstill_facts(case)
    place = tuple(case.moments[-1].truth.position)
    for cause, test in TESTS:
        evidence = test(facts)
        if evidence is not None:
            return Finding(cause, evidence, _since(case), (place[0], place[1], place[2]))
    raise AssertionError("the last test always answers")


def standstill_facts(case: Case) -> StandstillFacts:
    """Measure all that the tests ask for."""
    last = case.moments[-1]
    period = max(1e-9, last.time_ns * 1e-9 / max(len(case.moments) - 1, 1))
    window = min(len(case.moments), max(1, round(case.config.episode.stuck_after / period)))
    recent = case.moments[-window:]
    offs = [_off(case, number) for number in range(len(case.moments) - window, len(case.moments))]
    tolerance = case.config.behaviour.tracking_tolerance
    navigator = case.navigator_at(len(case.moments) - 1)
    searches = [one.decision.planner_iterations for one in case.moments]
    return StandstillFacts(
        outcome=case.outcome,
        reason=case.reason,
        window=window,
        discarded=float(np.mean([one.decision.deadline_missed for one in recent])),
        late=float(np.mean([_is_late(case, one) for one in case.moments[-10:]])),
        deadline=case.config.latency.deadline,
        delay=float(np.median([one.latency.delay_s for one in recent])),
        off_path=float(np.mean([off > tolerance for off in offs])),
        worst_off_path=max(offs),
        shortest_s=_shortest(case),
        limit_s=case.config.episode.time_limit,
        claimed=last.decision.action == "goal",
        pose_error=float(np.linalg.norm(last.error[: case.axes])),
        margin=last.decision.localization_margin_m,
        iterations=next((spent for spent in reversed(searches) if spent), 0),
        **_ways(case, navigator),
    )


def _since(case: Case) -> int:
    """Number of the decision from which on the robot stayed where it was at the end."""
    places = np.array([moment.true_position for moment in case.moments])
    away = np.flatnonzero(np.linalg.norm(places - places[-1], axis=1) > STAYED)
    return int(away[-1]) + 1 if len(away) else 0


def _off(case: Case, number: int) -> float:
    moment = case.moments[number]
    trajectory = case.followed(moment.time_ns)
    if trajectory is None:
        return 0.0
    return off_path(trajectory, moment.true_position + moment.error, case.axes)[0]


def _is_late(case: Case, moment: Moment) -> bool:
    return moment.latency.delay_s > case.config.latency.expected + LATE


def _shortest(case: Case) -> float:
    """Least time for the straight way to the goal, s: nothing is faster."""
    axes = case.axes
    way = np.subtract(case.mission.goal, case.mission.start)[:axes]
    reached = case.config.episode.goal_tolerance
    return max(float(np.linalg.norm(way)) - reached, 0.0) / case.mission.max_speed


def _ways(case: Case, navigator: Navigator) -> dict[str, Any]:
    """Which ways to the goal exist, in truth and in the map."""
    costmap, last = navigator.costmap, case.moments[-1]
    size, radius = costmap.resolution, costmap.inflation_radius
    goal = cell_of(navigator, np.array(case.mission.goal))
    reach = max(1, round(case.config.episode.goal_tolerance / size))
    start = cell_of(navigator, np.array(case.mission.start))
    here = cell_of(navigator, last.true_position)
    believed = cell_of(navigator, last.true_position + last.error)
    case.space.place_movers(last.truth, present=False)
    still = clearances(true_occupancy(case, navigator), size)
    case.space.place_movers(last.truth)
    truth = true_occupancy(case, navigator)
    gaps = clearances(truth, size)
    occupied, unknown = costmap.state == OCCUPIED, costmap.state == UNKNOWN
    ghosts = occupied & (_to_nearest(truth, size) > GHOST_CELLS * size + np.linalg.norm(last.error))
    mapped = clearances(occupied, size)
    without = clearances(occupied & ~ghosts, size)
    return {
        "radius": radius,
        "true_widest": widest(still, start, goal, reach),
        "true_way": joined(still > radius, start, goal, reach),
        "way_with_movers": joined(gaps > radius, here, goal, reach),
        "map_way": joined(mapped > radius, believed, goal, reach),
        "known_way": joined(clearances(occupied | unknown, size) > radius, believed, goal, reach),
        "ghosts": int(ghosts.sum()),
        "holes": int((ghosts & holes_in_floor(case, navigator)).sum()),
        "ghost": _nearest_cell(navigator, ghosts, believed),
        "way_without_ghosts": joined(without > radius, believed, goal, reach),
        "unknown": float(unknown.mean()),
    }


def _to_nearest(occupied: Cells, size: float) -> np.ndarray:
    """Distance to the nearest cell that is occupied, the grid's edge apart, m."""
    from scipy import ndimage

    if not occupied.any():
        return np.full(occupied.shape, np.inf)
    return np.asarray(ndimage.distance_transform_edt(~occupied) * size)


def _nearest_cell(
    navigator: Navigator, cells: Cells, about: tuple[int, ...]
) -> tuple[float, float, float]:
    places = np.argwhere(cells)
    if not len(places):
        return 0.0, 0.0, 0.0
    nearest = places[((places - about) ** 2).sum(axis=1).argmin()]
    costmap = navigator.costmap
    x, y, z = (costmap.origin + (nearest + 0.5) * costmap.resolution).tolist()
    return x, y, z
