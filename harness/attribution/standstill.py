"""The cause of not arriving: whether there was a way in truth, in the map, and for the planner.

The tests are asked in order, each a question to measured facts, and the first that answers names
the cause. What would have to change first comes first: a goal that nobody could reach, decisions
that never took effect, a pose and ranges that lied; only then what follows from them, the map and
the body. The planner is named where a way lay open to it, and what no test explains is
unexplained.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from wayproof.harness.attribution.case import Case, Moment, off_path
from wayproof.harness.attribution.contact import BLIND, LATE
from wayproof.harness.attribution.finding import Finding
from wayproof.harness.attribution.pose import PoseFacts, pose_facts
from wayproof.harness.attribution.ranges import RangeFacts, range_facts
from wayproof.harness.attribution.ways import NO_PATH, MapWays, TrueWays, map_ways, true_ways
from wayproof.harness.stack.mapping import MARGIN_SIGMAS

HALF = 0.5
"""A share of the last decisions that decides."""

FEW = 0.1
"""A share of the last decisions that matters."""

STAYED = 0.3
"""Less movement than this is none, m."""

PROGRESS = 0.5
"""More of the way than this covered over the last decisions is progress, m."""

DOUBT = 0.1
"""By so much at least a margin has to grow with the pose's doubt to be what closes a way, m."""


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
        left_path: Share of all decisions that stopped because the body had left its path.
        limit_s: Time limit.
        claimed: Whether the robot claimed the goal where it was not.
        doubt: By how much the stated doubt of the pose widens the margin, m.
        radius: Of the body, m.
        cell: Edge of the map's cells, m.
        iterations: Spent by the last search.
        without_path: Share of all searches that found no path.
        pose: Its error over the window.
        ranges: What the sensors reported against the truth.
        truth: Ways that truly exist.
        map: Ways that the map had.
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
    left_path: float
    limit_s: float
    claimed: bool
    doubt: float
    radius: float
    cell: float
    iterations: int
    without_path: float
    pose: PoseFacts
    ranges: RangeFacts
    truth: TrueWays
    map: MapWays

    @property
    def on_its_way(self) -> bool:
        """Whether the time limit ended a robot that came nearer to its goal."""
        return self.outcome == "timeout" and self.truth.gained_m > PROGRESS

    @property
    def fell(self) -> bool:
        """Whether the body ended where no path leads."""
        return self.outcome in ("fall", "out_of_bounds")


def impossible(facts: StandstillFacts) -> str | None:
    """No way exists for this body and margin, or the shortest one takes longer than the limit."""
    truth = facts.truth
    if not truth.exists and not facts.fell:
        return (
            f"no way to the goal exists for a body of {truth.radius:.2f} m with its margin; the "
            f"widest lets {truth.widest:.2f} m pass"
        )
    if truth.shortest_s > facts.limit_s:
        return (
            f"the shortest way takes {truth.shortest_s:.1f} s at full speed, "
            f"the limit was {facts.limit_s:.1f} s"
        )
    return None


def latency(facts: StandstillFacts) -> str | None:
    """Decisions came past their deadline and were discarded, or sweeps did not come at all."""
    if facts.discarded >= HALF:
        return (
            f"{facts.discarded:.0%} of the last {facts.window} decisions took longer than the "
            f"deadline of {facts.deadline * 1e3:.0f} ms (median {facts.delay * 1e3:.0f} ms) and "
            "were discarded"
        )
    if facts.ranges.withheld >= HALF:
        return f"{facts.ranges.withheld:.0%} of the decisions were made without a new sweep"
    return None


def localization(facts: StandstillFacts) -> str | None:
    """The pose was farther off than the margin covers, or so uncertain that the margin closed."""
    pose = facts.pose
    if facts.claimed:
        return f"the goal was claimed where it is not: the pose was {pose.at_end:.2f} m off"
    if pose.beyond > 0.0:
        return str(pose)
    if facts.doubt > DOUBT and facts.map.passable < HALF <= facts.map.certain:
        return (
            f"the stated doubt of the pose widens the margin by {facts.doubt:.2f} m, "
            "and without that the map has a way"
        )
    return None


def late_setpoints(facts: StandstillFacts) -> str | None:
    """The body lost its balance while every trajectory began for it where it no longer was."""
    if facts.outcome != "fall" or facts.late < HALF:
        return None
    return (
        f"{facts.late:.0%} of the last ten decisions took effect later than the stack "
        f"reckoned with (median {facts.delay * 1e3:.0f} ms), so setpoints jumped; {facts.reason}"
    )


def perception(facts: StandstillFacts) -> str | None:
    """Echoes were lost or wrong, or what is near was never taken in."""
    if facts.ranges.lied:
        return str(facts.ranges)
    if facts.ranges.blind > facts.radius + BLIND and facts.map.known < HALF and not facts.fell:
        return (
            f"returns nearer than {facts.ranges.blind:.1f} m are dropped, "
            "so the map knows no way where the robot stands"
        )
    return None


def left_its_path(facts: StandstillFacts) -> str | None:
    """The body fell, or left the area that every path keeps to."""
    if not facts.fell:
        return None
    return f"{facts.reason}: no path leads there; last {facts.worst_off_path:.2f} m off its path"


def moved_obstacle(facts: StandstillFacts) -> str | None:
    """What moves stood in the only way."""
    if facts.truth.open_at_end:
        return None
    return "a way exists, but something that moves truly closed it at the end"


def just_left(facts: StandstillFacts) -> str | None:
    """What moves closes the map's only way, or stood there a moment ago; at the end, or often."""
    if facts.on_its_way and facts.without_path >= FEW and facts.map.held_up >= HALF:
        return (
            f"{facts.without_path:.0%} of all searches found no path, and {facts.map.held_up:.0%} "
            "of their maps had one without what moved there"
        )
    if facts.map.passable >= HALF or not facts.map.without_movers:
        return None
    return "the map has a way without what moves there, or stood there a moment before the end"


def ghost_obstacle(facts: StandstillFacts) -> str | None:
    """The way is closed in the map alone, by cells that are truly free."""
    ways = facts.map
    if ways.passable >= HALF or not ways.ghosts or not ways.without_ghosts:
        return None
    x, y, z = ways.ghost
    seen_through = f"{ways.holes} of them as beams went through their floor, " if ways.holes else ""
    return (
        f"{ways.ghosts} cells mapped occupied are truly free, {seen_through}"
        f"such as ({x:.2f}, {y:.2f}, {z:.2f}), and without them the map has a way to the goal"
    )


def tracking(facts: StandstillFacts) -> str | None:
    """The body does not go where its path leads."""
    if facts.off_path >= HALF:
        return (
            f"the body was off its path in {facts.off_path:.0%} of the last {facts.window} "
            f"decisions, by up to {facts.worst_off_path:.2f} m"
        )
    if facts.left_path >= FEW:
        return (
            f"{facts.left_path:.0%} of the decisions stopped as the body had left its path by "
            "more than the tolerance"
        )
    return None


def planner(facts: StandstillFacts) -> str | None:
    """A way lay open in the map, and the search did not find it, or it was not taken."""
    ways = facts.map
    if facts.on_its_way:
        return _too_slow(facts) if ways.passable >= HALF else None
    if ways.in_vain >= FEW and ways.not_found >= HALF:
        return (
            f"{ways.in_vain:.0%} of the last {facts.window} searches found no path in "
            f"{facts.iterations} iterations, though {ways.not_found:.0%} of their maps had a way "
            "around all that was occupied"
        )
    if facts.map.known >= HALF:
        return (
            f"in {facts.map.known:.0%} of the maps at the end a way led through space that was "
            f"known to be free; the last search spent {facts.iterations} iterations"
        )
    return None


def too_narrow(facts: StandstillFacts) -> str | None:
    """A way exists by less than a map of cells can hold open, or there is no room at the start."""
    truth = facts.truth
    if facts.fell or min(truth.widest - 0.5 * facts.cell, truth.at_start) > truth.radius:
        return None
    return (
        f"body and margin take {truth.radius:.2f} m, the widest way lets {truth.widest:.2f} m pass "
        f"in cells of {facts.cell:.2f} m, and the start has {truth.at_start:.2f} m about it"
    )


def _too_slow(facts: StandstillFacts) -> str:
    """The limit left time for the shortest way, and the map had one; it was not taken in time."""
    truth = facts.truth
    return (
        f"the shortest way takes {truth.shortest_s:.1f} s at full speed, the limit was "
        f"{facts.limit_s:.1f} s, and {facts.map.passable:.0%} of the maps at the end had a way; "
        f"{truth.left_m:.1f} m were left, {facts.without_path:.0%} of all searches found no path, "
        f"and the last one spent {facts.iterations} iterations"
    )


def unexplained(facts: StandstillFacts) -> str:
    """Nothing that was measured explains it."""
    known = "a" if facts.map.known >= HALF else "no"
    return (
        f"pose and ranges were right, a way exists, and the map knew {known} way to it "
        f"({facts.map.unknown:.0%} was unknown)"
    )


TESTS: tuple[tuple[str, Callable[[StandstillFacts], str | None]], ...] = (
    ("impossible", impossible),
    ("latency", latency),
    ("localization", localization),
    ("latency", late_setpoints),
    ("perception", perception),
    ("tracking", left_its_path),
    ("moved_obstacle", moved_obstacle),
    ("ghost_obstacle", ghost_obstacle),
    ("moved_obstacle", just_left),
    ("tracking", tracking),
    ("impossible", too_narrow),
    ("planner", planner),
    ("unexplained", unexplained),
)
"""In the order in which they are asked."""


def cause_of_standstill(case: Case) -> Finding:
    """Why the goal was not reached, where nothing was touched."""
    facts = standstill_facts(case)
    x, y, z = case.moments[-1].truth.position
    for cause, test in TESTS:
        evidence = test(facts)
        if evidence is not None:
            return Finding(cause, evidence, _since(case), (x, y, z))
    raise AssertionError("the last test always answers")


def standstill_facts(case: Case) -> StandstillFacts:
    """Measure all that the tests ask for."""
    last = case.moments[-1]
    window = _window(case)
    numbers = range(len(case.moments) - window, len(case.moments))
    recent = case.moments[-window:]
    offs = [_off(case, number) for number in numbers]
    tolerance = case.config.behaviour.tracking_tolerance
    mapped, navigator = map_ways(case, numbers[0])
    left = [one.decision.label == "localization_lost" for one in case.moments]
    searches = [one.decision for one in case.moments if one.decision.planner_iterations]
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
        left_path=float(np.mean(left)),
        limit_s=case.config.episode.time_limit,
        claimed=last.decision.action == "goal",
        doubt=MARGIN_SIGMAS * last.decision.position_sigma,
        radius=case.mission.radius,
        cell=navigator.costmap.resolution,
        iterations=searches[-1].planner_iterations if searches else 0,
        without_path=float(np.mean([one.label == NO_PATH for one in searches] or [False])),
        pose=pose_facts(case, numbers),
        ranges=range_facts(case, len(case.moments) - 1),
        truth=true_ways(case, navigator, numbers[0]),
        map=mapped,
    )


def lacks_time(case: Case) -> bool:
    """Whether the shortest way that is wide enough takes longer than the time limit."""
    last = len(case.moments) - 1
    truth = true_ways(case, case.navigator_at(last), last)
    return truth.exists and truth.shortest_s > case.config.episode.time_limit


def _window(case: Case) -> int:
    """Decisions at the end that fit into `episode.stuck_after`, at least one.

    A robot that gave up did so where it stood, so no more than since it came there, or of a second.
    """
    period = max(1e-9, case.moments[-1].time_ns * 1e-9 / max(len(case.moments) - 1, 1))
    window = round(case.config.episode.stuck_after / period)
    if case.outcome == "aborted":
        window = min(window, max(len(case.moments) - _since(case), round(1.0 / period)))
    return min(len(case.moments), max(1, window))


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
