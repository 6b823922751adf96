"""Facts of a failure to arrive without a contact: decisions, pose, and paths in truth and map."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np

from wayproof.harness.attribution.case import Case, Moment, off_path, yaw_of
from wayproof.harness.attribution.commanded import answer_s, commands_to, on_trial
from wayproof.harness.attribution.contact_facts import LATE, UNDER_WAY
from wayproof.harness.attribution.floor_edge import FloorEdge, floor_edge
from wayproof.harness.attribution.old_evidence import OldFacts, old_facts
from wayproof.harness.attribution.pose import PoseFacts, pose_facts
from wayproof.harness.attribution.ranges import RangeFacts, range_facts, settings_of_sight
from wayproof.harness.attribution.ways import NO_PATH, MapWays, TrueWays, map_ways, true_ways
from wayproof.harness.decision import path_of
from wayproof.harness.stack.mapping import MARGIN_SIGMAS

STAYED = 0.3
"""Distance up to which a robot counts as standing still, m."""

PROGRESS = 0.5
"""Path length covered over the last decisions that counts as progress, m."""

LOOKS = ("explore", "recover")
"""Actions that look for a way where nothing is known."""


@dataclass(frozen=True)
class StandstillFacts:
    """Facts of an episode that ended without a contact.

    Attributes:
        outcome: Outcome of the episode.
        reason: Its reason, in words.
        window: Number of last decisions that are examined.
        discarded: Fraction of them past their deadline.
        late: Fraction of the last ten decisions that took effect later than expected.
        deadline: Deadline, s.
        delay: Median delay in the window, s.
        off_path: Fraction of the window with the body off its path beyond the tracking tolerance.
        worst_off_path: Greatest distance from the path in the window, m.
        left_path: Fraction of all decisions that stopped because the body had left its path.
        limit_s: Time limit, s.
        claimed: Whether the robot claimed to be at a goal where it was not.
        lost_sigma: Standard deviation of the pose for which the stack gave up, m; None if it did
            not.
        doubt: Growth of the margin with the stated uncertainty of the pose, m.
        radius: Radius of the body, m.
        cell: Edge of the cells of the map, m.
        iterations: Iterations of the last search.
        without_path: Fraction of all searches that found no path.
        pose: Error of the pose over the window.
        truth: Paths that truly exist.
        ranges: Measures the reported ranges against the true ones, once, as that takes long.
        map: Searches the paths in the map, likewise.
        answered_late: Fraction of the window that a stack on trial answered past the deadline.
        answer: Median time to its answers in the window, s.
        on_trial: Whether a stack on trial commanded.
        cut: Number of decisions in the window at which the guard braked in its place.
        cut_blocked: Number of these whose commands were blocked; the others were unknown.
        beyond_area: Number of the last decision with a command out of the operating area that the
            referee did not admit and the body followed at the end; None without one.
        claimed_at: Distance of the estimated position from a goal that a stack on trial claimed
            from beyond the tolerance, m; 0 otherwise.
        edge: End of the floor that the robot walked over; None if it did not fall there.
        jumped: Greatest movement of the pose estimate against the body within a second, from its
            start on, at the end, m.
        turned: Heading through which the body turned on its way in the window, rad.
        explored_s: Time that went into looking where nothing was known, s.
        hidden_by: Settings that keep the sensors or the map from seeing, in words; may be empty.
        did: What a stack on trial did in the window, in words.
        speed_fraction: `motion.speed_fraction`.
        max_slope: `costmap.max_slope`, rad.
        stuck_after: `episode.stuck_after`, s.
        old: Measures what of the evidence was old.
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
    lost_sigma: float | None
    radius: float
    cell: float
    iterations: int
    without_path: float
    pose: PoseFacts
    truth: TrueWays
    ranges: Callable[[], RangeFacts]
    map: Callable[[], MapWays]
    answered_late: float = 0.0
    answer: float = 0.0
    on_trial: bool = False
    cut: int = 0
    cut_blocked: int = 0
    beyond_area: int | None = None
    claimed_at: float = 0.0
    edge: FloorEdge | None = None
    jumped: float = 0.0
    turned: float = 0.0
    explored_s: float = 0.0
    hidden_by: str = ""
    did: str = ""
    speed_fraction: float = 1.0
    max_slope: float = 0.0
    stuck_after: float = 30.0
    old: Callable[[], OldFacts] = OldFacts

    @property
    def speed_in_words(self) -> str:
        """The speed that the settings allow, with the setting where it is not the body's full."""
        share = self.speed_fraction
        return (
            "full speed"
            if share >= 1.0
            else (f"{self.truth.speed:.2f} m/s (motion.speed_fraction = {share:g})")
        )

    @property
    def on_its_way(self) -> bool:
        """Whether the time limit ended a robot that still came nearer to its goal."""
        return self.outcome == "timeout" and self.truth.gained_m > PROGRESS

    @property
    def fell(self) -> bool:
        """Whether the body ended where no path leads."""
        return self.outcome in ("fall", "out_of_bounds")


def standstill_facts(case: Case) -> StandstillFacts:
    """Measure the facts for the tests; those that take long when a test calls for them."""
    last = case.moments[-1]
    window = _window(case)
    numbers = range(len(case.moments) - window, len(case.moments))
    recent = case.moments[-window:]
    offs = [_distance_off_path(case, number) for number in numbers]
    tolerance = case.config.behaviour.tracking_tolerance
    navigator = case.empty_navigator_at(numbers[-1])
    left = [
        one.decision.label == "localization_lost" and not one.decision.predicate.HasField("sigma_m")
        for one in case.moments
    ]
    verdicts = [one.decision.verdict for one in recent]
    cut = [one.verdict for one in verdicts if one.cut]
    searches = [one.decision for one in case.moments if one.decision.planner_iterations]
    return StandstillFacts(
        outcome=case.outcome,
        reason=case.reason,
        window=window,
        discarded=float(np.mean([one.decision.deadline_missed for one in recent])),
        answered_late=float(np.mean([_answered_late(one) for one in recent])),
        answer=float(np.median([answer_s(one) for one in recent])),
        on_trial=on_trial(case),
        cut=len(cut),
        cut_blocked=cut.count("blocked"),
        beyond_area=_beyond_area(case),
        claimed_at=_claimed_at(case),
        edge=floor_edge(case),
        jumped=_jumped(case),
        turned=_turned(recent),
        explored_s=_explored_s(case),
        speed_fraction=case.config.motion.speed_fraction,
        max_slope=case.config.costmap.max_slope,
        stuck_after=case.config.episode.stuck_after,
        hidden_by=", ".join(settings_of_sight(case)),
        did=_did(recent) if on_trial(case) else "",
        late=float(np.mean([_is_late(case, one) for one in case.moments[-10:]])),
        deadline=case.config.latency.deadline,
        delay=float(np.median([one.latency.delay_s for one in recent])),
        off_path=float(np.mean([off > tolerance for off in offs])),
        worst_off_path=max(offs),
        left_path=float(np.mean(left)),
        limit_s=case.config.episode.time_limit,
        claimed=last.decision.action == "goal",
        doubt=MARGIN_SIGMAS * last.decision.position_sigma,
        lost_sigma=_lost_sigma(last),
        radius=case.mission.radius,
        cell=navigator.costmap.resolution,
        iterations=searches[-1].planner_iterations if searches else 0,
        without_path=float(np.mean([one.label == NO_PATH for one in searches] or [False])),
        pose=pose_facts(case, numbers),
        truth=true_ways(case, navigator, numbers[0]),
        ranges=cache(lambda: range_facts(case, numbers[-1])),
        map=cache(lambda: map_ways(case, numbers[0])),
        old=cache(lambda: old_facts(case, numbers[-1])),
    )


def _jumped(case: Case) -> float:
    """Return how far the pose estimate moved against the body within the last second, m.

    The body starts where it is; what the estimate is off at first, its controller has to follow.
    """
    end_ns = case.moments[-1].time_ns
    errors = [one.error for one in case.moments if one.time_ns >= end_ns - 10**9]
    if end_ns <= 10**9:
        errors.insert(0, np.zeros(3))
    return float(np.ptp(errors, axis=0).max())


def _turned(recent: Sequence[Moment]) -> float:
    """Return through which angle the body turned, under way in half of some decisions, rad."""
    if np.mean([one.decision.action in UNDER_WAY for one in recent]) < 0.5:
        return 0.0
    return float(np.ptp(np.unwrap([yaw_of(one.truth.quaternion) for one in recent])))


def _explored_s(case: Case) -> float:
    """Return the time from decisions that looked where nothing was known to the next ones, s."""
    pairs = zip(case.moments, case.moments[1:], strict=False)
    return sum(
        (after.time_ns - one.time_ns) * 1e-9 for one, after in pairs if one.decision.action in LOOKS
    )


def _did(recent: Sequence[Moment]) -> str:
    """Say what a stack on trial did in some decisions."""
    if recent[-1].decision.action == "abort":
        return "gave up itself"
    places = np.array([one.true_position for one in recent])
    length = float(np.linalg.norm(np.diff(places, axis=0), axis=1).sum())
    net = float(np.linalg.norm(places[-1] - places[0]))
    if length < STAYED:
        return "stood still"
    if net < 0.5 * length:
        return f"moved to and fro: {length:.1f} m, to {net:.1f} m from where it began"
    return f"moved on by {net:.1f} m"


def _lost_sigma(last: Moment) -> float | None:
    """Return the standard deviation for which the stack gave up, m; None if it did not."""
    reason = last.decision.predicate
    gave_up = reason.kind == "localization_lost" and last.decision.action == "abort"
    return reason.sigma_m if gave_up else None


def _window(case: Case) -> int:
    """Return the number of last decisions within `episode.stuck_after`, at least one.

    For a robot that gave up, no more than since it came to rest, or within one second.
    """
    period = max(1e-9, case.moments[-1].time_ns * 1e-9 / max(len(case.moments) - 1, 1))
    window = round(case.config.episode.stuck_after / period)
    if case.outcome == "aborted":
        window = min(window, max(len(case.moments) - standing_since(case), round(1.0 / period)))
    return min(len(case.moments), max(1, window))


def standing_since(case: Case) -> int:
    """Return the number of the decision since which the robot stood still."""
    places = np.array([moment.true_position for moment in case.moments])
    away = np.flatnonzero(np.linalg.norm(places - places[-1], axis=1) > STAYED)
    return int(away[-1]) + 1 if len(away) else 0


def _distance_off_path(case: Case, number: int) -> float:
    moment = case.moments[number]
    trajectory = case.followed(moment.time_ns)
    if trajectory is None:
        return 0.0
    return off_path(trajectory, moment.true_position + moment.error, case.axes)[0]


def _answered_late(moment: Moment) -> bool:
    """Return whether a command was discarded, for the time that the answer alone took."""
    decision = moment.decision
    return decision.deadline_missed and answer_s(moment) > decision.deadline_s


def _claimed_at(case: Case) -> float:
    """Return how far from the goal the pose was where a stack claimed it, m; 0 if near enough."""
    last = case.moments[-1]
    if last.answer is None or last.decision.action != "goal":
        return 0.0
    gap = np.array(last.pose.position) - np.array(case.mission.goal)
    distance = float(np.linalg.norm(gap[: case.axes]))
    return distance if distance > case.config.episode.goal_tolerance else 0.0


def _beyond_area(case: Case) -> int | None:
    """Return the last of the commands followed at the end that leads out of the operating area."""
    low, high = np.array(case.mission.low), np.array(case.mission.high)
    for number in reversed(commands_to(case, case.end_s)):
        path = path_of(case.moments[number].decision.trajectory.path)
        outside = ((path < low) | (path > high))[:, : case.axes]
        if case.moments[number].decision.verdict.verdict == "blocked" and outside.any():
            return number
    return None


def _is_late(case: Case, moment: Moment) -> bool:
    return moment.latency.delay_s > case.config.latency.expected + LATE
