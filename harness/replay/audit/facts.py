"""The plain fact of each kind of reason, by the decision itself and those before it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

import numpy as np

from wayproof.harness.decision import path_of
from wayproof.harness.geometry import wrap_angle
from wayproof.harness.log.paths import Array, densely, length, place_at
from wayproof.harness.replay.audit.committed import Committed, hold
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.harness.stack.reasons import Kind

NEAR = 1e-3
"""Tolerance of figures computed in two ways, m, s and rad."""

GOAL_SHARE = 0.8
"""Share of the goal's tolerance within which a goal is claimed."""

SIGMAS = 2.0
"""Standard deviations within which the goal has to be to be claimed."""

STILL = 0.02
"""Length up to which a trajectory counts as a hold, m."""


@dataclass(frozen=True)
class Step:
    """One earlier decision.

    Attributes:
        time_ns: Simulated time, ns.
        action: Action.
        predicate: Its whole reason.
        moves: Whether its trajectory is no hold.
        position: (3,) estimated position, m.
    """

    time_ns: int
    action: str
    predicate: pb.Reason
    moves: bool
    position: Array

    @property
    def late(self) -> bool:
        """Whether the decision was discarded, and the trajectory before it stood."""
        return self.predicate.kind == "late"


@dataclass
class Past:
    """All decisions before the current one.

    Attributes:
        steps: Decisions by number.
        trajectories: The last trajectories, the newest last.
        way: (n, 3) last global path, m.
    """

    steps: dict[int, Step] = field(default_factory=dict)
    trajectories: list[pb.Trajectory] = field(default_factory=list)
    way: Array = field(default_factory=lambda: np.empty((0, 3)))

    def take(self, decision: pb.Decision) -> None:
        """Add the next decision."""
        self.steps[decision.sequence] = Step(
            time_ns=decision.timestamp.ToNanoseconds(),
            action=decision.action,
            predicate=decision.predicate,
            moves=length(path_of(decision.trajectory.path)) >= STILL,
            position=np.array(decision.position),
        )
        self.trajectories = [*self.trajectories[-9:], decision.trajectory]
        if len(decision.global_path) > 1:
            self.way = path_of(decision.global_path)

    def stand(self, decision: pb.Decision) -> None:
        """Void all trajectories: a recorded robot stands where the next decision is made."""
        self.trajectories = [hold(decision.position, 0.0, decision.timestamp.ToNanoseconds())]

    def followed(self, time_ns: int) -> pb.Trajectory | None:
        """Return the trajectory that the robot follows at a time; None before the first."""
        begun = [one for one in self.trajectories if one.start.ToNanoseconds() <= time_ns]
        return begun[-1] if begun else None

    def at(self, time_ns: int) -> int | None:
        """Return the number of the decision at a time, ns; figures are logged to a microsecond."""
        numbers = [k for k, one in self.steps.items() if abs(one.time_ns - time_ns) < 10_000]
        return numbers[0] if numbers else None

    def since(self, first: int, last: int) -> list[Step]:
        """Return the decisions from `first` to `last`, the latter excluded."""
        return [self.steps[k] for k in range(first, last) if k in self.steps]


def point_of(point: pb.Point) -> Array:
    """Return a logged point as an array (3,), m."""
    return np.array([point.x, point.y, point.z])


Fact = Callable[[Committed, Past], Iterator[str]]


def same(name: str, claimed: float, found: float, within: float = NEAR) -> Iterator[str]:
    """Yield a text unless two figures are equal within a tolerance."""
    if not abs(claimed - found) <= within:
        yield f"{name} is {claimed:.3f}, found {found:.3f}"


def driving(now: Committed, past: Past) -> Iterator[str]:
    """Check that what is committed is free, or ends before the cell that is named."""
    reason, committed = now.reason, now.length
    if not reason.HasField("cell"):
        yield from same("free_m", reason.free_m, committed)
    elif reason.kind == "following" and committed > reason.free_m + NEAR:
        yield f"{reason.free_m:.3f} m are free, {committed:.3f} m committed"
    doubtful = reason.HasField("sigma_m") or reason.HasField("range_sigma_m")
    if reason.kind == "following" and (now.decision.action == "slow") != doubtful:
        yield f"action {now.decision.action} on a path that is admitted"
    yield from slowed(now, past)


def slowed(now: Committed, past: Past) -> Iterator[str]:
    """Check that a deviation that is stated is too great for full speed."""
    reason, limits = now.reason, now.config.behaviour
    if reason.HasField("sigma_m"):
        yield from same("sigma_m", reason.sigma_m, now.decision.position_sigma)
        if not reason.sigma_m > limits.uncertain_sigma:
            yield f"a standard deviation of {reason.sigma_m:.2f} m costs no speed"
    if reason.HasField("range_sigma_m") and not reason.range_sigma_m > limits.noisy_sigma:
        yield f"a deviation of the ranges of {reason.range_sigma_m:.3f} m costs no speed"


def turning(now: Committed, past: Past) -> Iterator[str]:
    """Check that the body stays in its place, and ends at the heading."""
    if now.length >= STILL:
        yield "the trajectory leaves its place"
    turned = now.decision.trajectory.heading[-1] - now.reason.turn_rad
    yield from same("turn_rad", 0.0, wrap_angle(turned))


def braking_for_goal(now: Committed, past: Past) -> Iterator[str]:
    """Check the length of the committed path."""
    yield from same("path_m", now.reason.path_m, now.length)
    yield from slowed(now, past)


def waiting(now: Committed, past: Past) -> Iterator[str]:
    """Check that the robot has been at rest as long as stated, or without a path since."""
    reason = now.reason
    if reason.HasField("waited_s") == reason.HasField("since"):
        yield "it states neither how long it has waited, nor since when there is no path"
    if reason.HasField("since"):
        steps = past.since(reason.since, now.decision.sequence)
        if reason.since != now.decision.sequence and not steps:
            yield f"there is no earlier decision {reason.since}"
        if any(one.action in ("follow", "slow", "explore") for one in steps if not one.late):
            yield f"since decision {reason.since} there was a path"
    yield from waited(now, past)


def waited(now: Committed, past: Past) -> Iterator[str]:
    """Check that a robot that states how long it has waited has not moved since."""
    reason = now.reason
    if not reason.HasField("waited_s"):
        return
    if now.length >= STILL:
        yield "it moves"
    begun_ns = now.decision.timestamp.ToNanoseconds() - round(reason.waited_s * 1e9)
    first = past.at(begun_ns)
    if first is None and reason.waited_s > NEAR:
        yield f"no decision was made {reason.waited_s:.2f} s ago"
    elif first is not None and any(one.moves for one in past.since(first, now.decision.sequence)):
        yield f"it has moved within {reason.waited_s:.2f} s"
    behaviour = now.config.behaviour
    if reason.frontier and reason.waited_s < behaviour.wait_timeout:
        yield f"looked for a frontier after {reason.waited_s:.2f} s"
    if reason.HasField("places") and reason.places < behaviour.max_recoveries:
        yield f"gave up after {reason.places} places"


def errand(now: Committed, past: Past) -> Iterator[str]:
    """Check that the way leads to the stated place, and has since the decision that set out."""
    reason, number = now.reason, now.decision.sequence
    if len(now.global_path) < 2:
        yield "it names no way"
        return
    target = point_of(reason.target)
    yield from same("target", 0.0, now.apart(now.global_path[-1], target))
    if reason.since > number or (reason.since < number and reason.since not in past.steps):
        yield f"there is no earlier decision {reason.since}"
    for step in past.since(reason.since, number):
        before = step.predicate
        if before.kind == reason.kind and now.apart(point_of(before.target), target) > NEAR:
            yield f"since decision {reason.since} it went elsewhere"
            return


def going_back(now: Committed, past: Past) -> Iterator[str]:
    """Check that the robot has been where it goes; if its pose is lost, that it is."""
    yield from errand(now, past)
    target = point_of(now.reason.target)
    been = [now.apart(one.position, target) for one in past.steps.values()]
    if not been or min(been) > now.map.resolution:
        yield "it has not been where it goes back to"
    if now.reason.HasField("sigma_m"):
        yield from lost(now, past)


def leaving_inflation(now: Committed, past: Past) -> Iterator[str]:
    """Check how far the robot moves, or turns, or how long it has waited."""
    reason, headings = now.reason, now.decision.trajectory.heading
    if reason.HasField("distance_m"):
        yield from same("distance_m", reason.distance_m, now.length)
    elif reason.HasField("turn_rad"):
        yield from same("turn_rad", reason.turn_rad, headings[-1] - headings[0])
    elif not reason.HasField("waited_s"):
        yield "it states no way out, nor how long it has waited"
    yield from waited(now, past)


def no_path(now: Committed, past: Past) -> Iterator[str]:
    """Check that a search was made, and names no path."""
    if not now.decision.planner:
        yield "no search was made"
    made = now.decision.planner_iterations
    if now.reason.iterations != made:
        yield f"{now.reason.iterations} iterations, {made} were made"
    yield from waited(now, past)


def lost(now: Committed, past: Past) -> Iterator[str]:
    """Check that the deviation, or the distance from the trajectory, is beyond its limit."""
    reason, behaviour = now.reason, now.config.behaviour
    if reason.HasField("sigma_m"):
        yield from same("sigma_m", reason.sigma_m, now.decision.position_sigma)
        claim = GOAL_SHARE * now.config.episode.goal_tolerance / SIGMAS
        limits, value = [behaviour.lost_sigma, claim], reason.sigma_m
    else:
        time_ns = now.decision.timestamp.ToNanoseconds()
        followed = past.followed(time_ns)
        start = np.array(now.mission.start)
        place = start if followed is None else place_at(followed, time_ns)
        off = now.apart(place, np.array(now.decision.position))
        yield from same("distance_m", reason.distance_m, off, 0.05)
        limits, value = [behaviour.tracking_tolerance], reason.distance_m
    if min(abs(reason.limit_m - one) for one in limits) > NEAR:
        yield f"limit_m is {reason.limit_m:.3f}"
    if not value > reason.limit_m - NEAR:
        yield f"{value:.2f} m are within what is allowed"


def old_evidence(now: Committed, past: Past) -> Iterator[str]:
    """Check that something on the way was last seen so long ago, unless a guard cut another way."""
    yield from same("deadline_s", now.reason.deadline_s, now.config.costmap.max_evidence_age)
    age_s = now.reason.delay_s
    if not age_s > now.reason.deadline_s:
        yield "that is recent"
    places = densely(now.path, now.config.map.resolution)
    seen_ns = int(now.measured.observed_ns_at(places).min())
    oldest_s = (now.decision.timestamp.ToNanoseconds() - seen_ns) * 1e-9
    if age_s > oldest_s + NEAR and not now.decision.verdict.cut:
        yield f"delay_s is {age_s:.3f}, the oldest evidence is {oldest_s:.3f} s old"


def late(now: Committed, past: Past) -> Iterator[str]:
    """Check that the decision came late, and the trajectory is the last one."""
    reason, decision = now.reason, now.decision
    yield from same("delay_s", reason.delay_s, decision.delay_s)
    yield from same("deadline_s", reason.deadline_s, now.config.latency.deadline)
    if not reason.delay_s > reason.deadline_s:
        yield "that is in time"
    last = past.trajectories[-1] if past.trajectories else decision.trajectory
    if last.path != decision.trajectory.path:
        yield "the trajectory is another one than the last"
    end_ns = last.start.ToNanoseconds() + last.duration_s * 1e9
    over = decision.timestamp.ToNanoseconds() >= end_ns - 1
    if (decision.action == "stop_and_wait") != over:
        yield f"action {decision.action}, while the last trajectory {'is over' * over}"


def arrived(now: Committed, past: Past) -> Iterator[str]:
    """Check that the robot is at rest, near enough to the goal."""
    here, reason = np.array(now.decision.position), now.reason
    yield from same("distance_m", reason.distance_m, now.apart(here, np.array(now.mission.goal)))
    yield from same("limit_m", reason.limit_m, GOAL_SHARE * now.config.episode.goal_tolerance)
    if reason.distance_m > reason.limit_m:
        yield "that is too far"
    time_ns = now.decision.timestamp.ToNanoseconds()
    followed = past.followed(time_ns)
    if followed is not None:
        end_ns = followed.start.ToNanoseconds() + followed.duration_s * 1e9
        if end_ns > time_ns + 1:
            yield f"its trajectory lasts another {(end_ns - time_ns) * 1e-9:.2f} s"


def commanded(now: Committed, past: Past) -> Iterator[str]:
    """Check that a stack was on trial, and was followed as far as the verdict says."""
    verdict = now.decision.verdict
    if not now.on_trial:
        yield "no stack was on trial"
    if verdict.cut or not verdict.verdict:
        yield f"the guard cut it, or there is no verdict ('{verdict.verdict}')"
    yield from same("free_m", now.reason.free_m, verdict.free_m)
    longest = now.length
    if not now.reason.free_m <= longest + NEAR:
        yield f"free_m is {now.reason.free_m:.3f}, the path is {longest:.3f} long"
    if (verdict.verdict in ("admitted", "stale")) == now.reason.HasField("cell"):
        yield f"the verdict is {verdict.verdict}"


def nothing(now: Committed, past: Past) -> Iterator[str]:
    """Check nothing: the obstruction is all that the reason says."""
    yield from ()


FACTS: dict[Kind, Fact] = {
    "following": driving,
    "slowing_for_unknown": driving,
    "turning": turning,
    "braking_for_blocked": slowed,
    "braking_for_unknown": nothing,
    "braking_for_goal": braking_for_goal,
    "waiting": waiting,
    "looking_elsewhere": errand,
    "leaving_inflation": leaving_inflation,
    "going_back": going_back,
    "no_path": no_path,
    "goal_blocked": waited,
    "localization_lost": lost,
    "old_evidence": old_evidence,
    "late": late,
    "arrived": arrived,
    "commanded": commanded,
}
"""Check of the plain fact of each kind of reason."""
