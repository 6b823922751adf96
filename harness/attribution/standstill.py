"""Cause of a failure to arrive: was there a path in truth, in the map, and for the planner?

Each test takes measured facts and returns its evidence, or None; the first with evidence names the
cause. Root causes come first: a goal out of reach, decisions that never took effect, wrong poses
and ranges; then their consequences, the map and the body. The planner is the cause where a path was
open to it; what no test explains is `unexplained`.
"""

from __future__ import annotations

from collections.abc import Callable

from wayproof.harness.attribution.case import Case
from wayproof.harness.attribution.contact import BLIND
from wayproof.harness.attribution.finding import Finding
from wayproof.harness.attribution.floor_edge import HELD
from wayproof.harness.attribution.old_evidence import OLD_TESTS
from wayproof.harness.attribution.standstill_facts import (
    StandstillFacts,
    standing_since,
    standstill_facts,
)
from wayproof.harness.attribution.ways import MapWays, true_ways

Test = Callable[[StandstillFacts], str | None]
"""Test of facts, with its evidence in words."""

HALF = 0.5
"""Fraction of the last decisions that is decisive."""

FEW = 0.1
"""Fraction of the last decisions that matters."""

NEARLY = 0.8
"""Share of the time limit; a least time beyond it leaves too little for what it does not count."""

TURNED = 0.5
"""Angle beyond which a body that stays in its place counts as turning on its way, rad."""

JUMP = 0.3
"""Movement of the pose against the body within a second that may throw it over, m."""

DOUBT = 0.1
"""Growth of the margin with the uncertainty of the pose, from which on it may close a path, m."""


def no_way(facts: StandstillFacts) -> str | None:
    """No path exists for this body and margin, or none over floors that the settings climb."""
    truth = facts.truth
    if truth.exists or facts.fell:
        return None
    if truth.over_ramps:
        return (
            "a way to the goal exists over floor that rises or falls, which costmap.max_slope = "
            f"{facts.max_slope:g} rad makes an obstacle, and none without"
        )
    return (
        f"no way to the goal exists for a body of {truth.radius:.2f} m with its margin; the "
        f"widest lets {truth.widest():.2f} m pass"
    )


def no_time(facts: StandstillFacts) -> str | None:
    """The shortest path takes longer than the limit at the speed that the settings allow."""
    least, limit = facts.truth.shortest_s, facts.limit_s
    takes = f"the shortest way takes {least:.1f} s at {facts.speed_in_words}"
    if least > limit:
        return f"{takes}, the limit was {limit:.1f} s"
    if facts.on_its_way and least >= NEARLY * limit:
        return (
            f"{takes}, which leaves {limit - least:.1f} s of the limit of {limit:.1f} s for turns, "
            "bends and changes of speed; the robot was under way"
        )
    if not facts.hidden_by and least >= HALF * limit and least + facts.explored_s > limit:
        return (
            f"{takes}, {facts.explored_s:.1f} s more went into looking where nothing was known, "
            f"and the limit was {limit:.1f} s"
        )
    return None


def stuck_clock(facts: StandstillFacts) -> str | None:
    """The robot turned on its way, and was taken for stuck."""
    if facts.outcome != "stuck" or facts.turned < TURNED:
        return None
    return (
        f"the robot was under way and had turned by {facts.turned:.1f} rad in place when "
        f"episode.stuck_after = {facts.stuck_after:g} s ended it"
    )


def stack_late(facts: StandstillFacts) -> str | None:
    """A stack on trial answered past the deadline, so its commands were discarded."""
    if facts.answered_late < HALF:
        return None
    return (
        f"{facts.answered_late:.0%} of the last {facts.window} answers of the stack came past the "
        f"deadline of {facts.deadline * 1e3:.0f} ms (median {facts.answer * 1e3:.0f} ms), and "
        "their commands were discarded"
    )


def claimed_elsewhere(facts: StandstillFacts) -> str | None:
    """A stack on trial claimed the goal where the pose that it got is not at the goal."""
    if not facts.claimed_at:
        return None
    return f"the goal was claimed {facts.claimed_at:.2f} m from it, by the pose that the stack got"


def left_its_area(facts: StandstillFacts) -> str | None:
    """A stack on trial commanded the body out of the operating area, against the referee."""
    if facts.outcome != "out_of_bounds" or facts.beyond_area is None:
        return None
    return (
        f"{facts.reason}: commanded there at decision {facts.beyond_area}, which the referee "
        "found blocked, as it leads out of the operating area"
    )


def latency(facts: StandstillFacts) -> str | None:
    """Decisions missed their deadline and were discarded."""
    if facts.discarded >= HALF:
        return (
            f"{facts.discarded:.0%} of the last {facts.window} decisions took longer than the "
            f"deadline of {facts.deadline * 1e3:.0f} ms (median {facts.delay * 1e3:.0f} ms) and "
            "were discarded"
        )
    return None


def localization(facts: StandstillFacts) -> str | None:
    """The pose error exceeds the margin, or its uncertainty widens the margin too much."""
    pose = facts.pose
    if facts.claimed and not facts.claimed_at:
        return f"the goal was claimed where it is not: the pose was {pose.at_end:.2f} m off"
    if facts.lost_sigma is not None:
        return (
            f"the stack gave up, as it did not know where it was: the pose had a standard "
            f"deviation of {facts.lost_sigma:.2f} m and was {pose.at_end:.2f} m off"
        )
    if facts.outcome == "fall" and facts.jumped > JUMP:
        return (
            f"{facts.reason}: the pose moved by {facts.jumped:.2f} m against the body within a "
            "second, and its setpoints with it"
        )
    if pose.beyond > 0.0:
        return str(pose)
    if facts.fell:
        return None
    if facts.doubt > DOUBT and facts.map().passable < HALF <= facts.map().certain:
        return (
            f"the stated doubt of the pose widens the margin by {facts.doubt:.2f} m, "
            "and without that the map has a way"
        )
    return None


def late_setpoints(facts: StandstillFacts) -> str | None:
    """The body fell while trajectories took effect too late and started where it no longer was."""
    if facts.outcome != "fall" or facts.late < HALF:
        return None
    return (
        f"{facts.late:.0%} of the last ten decisions took effect later than the stack "
        f"reckoned with (median {facts.delay * 1e3:.0f} ms), so setpoints jumped; {facts.reason}"
    )


def perception(facts: StandstillFacts) -> str | None:
    """Returns were lost or wrong, or near ones were dropped."""
    ranges = facts.ranges()
    if ranges.lied:
        return str(ranges)
    if ranges.blind > facts.radius + BLIND and facts.map().known < HALF and not facts.fell:
        return (
            f"returns nearer than {ranges.blind:.1f} m are dropped, "
            "so the map knows no way where the robot stands"
        )
    return None


def _over_edge(cause: str) -> Test:
    """Return a test of a fall over the end of the floor, for one cause of `FloorEdge`."""

    def over_edge(facts: StandstillFacts) -> str | None:
        edge = facts.edge
        return f"{facts.reason}: {edge}" if edge is not None and edge.cause == cause else None

    return over_edge


OVER_AN_EDGE = tuple((cause, _over_edge(cause)) for cause, _ in HELD.values())
"""Tests whose evidence is the end of the floor, by cause."""


def left_its_path(facts: StandstillFacts) -> str | None:
    """The body fell, or left the area of all paths."""
    if not facts.fell:
        return None
    return f"{facts.reason}: no path leads there; last {facts.worst_off_path:.2f} m off its path"


def moved_obstacle(facts: StandstillFacts) -> str | None:
    """A mover blocked the only path."""
    if facts.truth.open_at_end():
        return None
    return "a way exists, but something that moves truly closed it at the end"


def just_left(facts: StandstillFacts) -> str | None:
    """A mover, present or recent, blocks the only path in the map, at the end or often."""
    if facts.on_its_way and facts.without_path >= FEW and facts.map().held_up >= HALF:
        return (
            f"{facts.without_path:.0%} of all searches found no path, and "
            f"{facts.map().held_up:.0%} of their maps had one without what moved there"
        )
    if facts.map().passable >= HALF or not facts.map().without_movers:
        return None
    return "the map has a way without what moves there, or stood there a moment before the end"


def ghost_obstacle(facts: StandstillFacts) -> str | None:
    """The path is blocked by cells that are truly free, or left too narrow to turn on it."""
    ways = facts.map()
    narrow = ways.passable >= HALF
    if narrow and (ways.roomy >= HALF or not _searched_in_vain(ways)):
        return None
    if not ways.ghosts or not (ways.roomy_without_ghosts if narrow else ways.without_ghosts):
        return None
    x, y, z = ways.ghost
    of_prior = f"{ways.of_prior} of them held by the prior map alone, " if ways.of_prior else ""
    cells = f"{ways.ghosts} cells mapped occupied are truly free, {of_prior}"
    such = f"such as ({x:.2f}, {y:.2f}, {z:.2f}), "
    if narrow:
        return (
            f"{cells}{such}and leave no way on which the body may turn; "
            f"{ways.in_vain:.0%} of the last {facts.window} searches found none of the narrower"
        )
    return f"{cells}{such}and without them the map has a way to the goal"


def _searched_in_vain(ways: MapWays) -> bool:
    """Return whether searches found no path in maps with a way around all that was occupied."""
    return ways.in_vain >= FEW and ways.not_found >= HALF


def tracking(facts: StandstillFacts) -> str | None:
    """The body does not follow its path."""
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
    """A path was open in the map, and the search did not find it, or the stack did not take it."""
    ways = facts.map()
    if facts.on_its_way:
        return _too_slow(facts) if ways.passable >= HALF else None
    if _searched_in_vain(ways):
        return (
            f"{ways.in_vain:.0%} of the last {facts.window} searches found no path in "
            f"{facts.iterations} iterations, though {ways.not_found:.0%} of their maps had a way "
            "around all that was occupied"
        )
    if ways.known >= HALF:
        return (
            f"in {ways.known:.0%} of the maps at the end a way led through space that was "
            f"known to be free; {_effort(facts)}"
        )
    return None


def stack_held(facts: StandstillFacts) -> str | None:
    """The guard held a stack on trial, which offered no other way though the map had one."""
    ways = facts.map()
    if not facts.cut or facts.cut < HALF * facts.window or ways.passable < HALF:
        return None
    unknown = facts.cut - facts.cut_blocked
    return (
        f"the guard cut {facts.cut} of the last {facts.window} commands of the stack, "
        f"{facts.cut_blocked} blocked and {unknown} into unknown space, though "
        f"in {ways.passable:.0%} of the maps at the end a way led around all that was occupied"
    )


def sees_too_little(facts: StandstillFacts) -> str | None:
    """A way was left only through space that settings keep the sensors or the map from seeing."""
    if not facts.hidden_by or not _only_unknown(facts):
        return None
    return (
        f"the map knew no way, as {facts.map().unknown:.0%} of it was unknown; what it may see is "
        f"bounded by {facts.hidden_by}"
    )


def exploration(facts: StandstillFacts) -> str | None:
    """The stack did not look where a way was left: only unknown space lay before it."""
    ways = facts.map()
    if not _only_unknown(facts):
        return None
    who = f"the stack on trial {_did(facts)}; it" if facts.on_trial else "the stack"
    return (
        f"in {ways.passable:.0%} of the maps at the end a way led around all that was occupied, "
        f"through unknown space ({ways.unknown:.0%} was unknown), and none through known space "
        f"alone; {who} did not go and look there: {facts.reason}"
    )


def _only_unknown(facts: StandstillFacts) -> bool:
    """Return whether half of the maps had a way, but none through known space."""
    ways = facts.map()
    return not facts.fell and ways.passable >= HALF > ways.known


def too_narrow(facts: StandstillFacts) -> str | None:
    """A path exists that is too narrow for the cells of a map, or the start has no room."""
    truth = facts.truth
    if facts.fell or min(truth.widest() - 0.5 * facts.cell, truth.at_start) > truth.radius:
        return None
    return (
        f"body and margin take {truth.radius:.2f} m, the widest way lets {truth.widest():.2f} m "
        f"pass in cells of {facts.cell:.2f} m, and the start has {truth.at_start:.2f} m about it"
    )


def _too_slow(facts: StandstillFacts) -> str:
    """The limit suffices for the shortest path, and the map had one; it was not taken in time."""
    truth = facts.truth
    searches = f"{facts.without_path:.0%} of all searches found no path, "
    return (
        f"the shortest way takes {truth.shortest_s:.1f} s at {facts.speed_in_words}, the limit was "
        f"{facts.limit_s:.1f} s, and {facts.map().passable:.0%} of the maps at the end had a way; "
        f"{truth.left_m:.1f} m were left, {'' if facts.on_trial else searches}"
        f"and {_effort(facts)}"
    )


def _effort(facts: StandstillFacts) -> str:
    """Say the effort of the last search in words; a stack on trial logs none."""
    if facts.cut:
        return f"the guard cut {facts.cut} of the last {facts.window} commands"
    if facts.on_trial:
        return f"the stack on trial {_did(facts)}"
    return f"the last search spent {facts.iterations} iterations"


def _did(facts: StandstillFacts) -> str:
    """Say what a stack on trial did, and what the map held of the plan that it gave."""
    ways = facts.map()
    if not ways.own_plan_m:
        return facts.did
    clear = f"{ways.own_plan_clear_m:.1f} m of its {ways.own_plan_m:.1f} m"
    if ways.own_plan_clear_m >= ways.own_plan_m - facts.cell:
        clear = f"all {ways.own_plan_m:.1f} m"
    return f"{facts.did}, and its own last plan was clear for {clear}"


def unexplained(facts: StandstillFacts) -> str:
    """State that no measured fact explains the failure."""
    return (
        f"pose and ranges were right, a way exists, and the map knew none "
        f"({facts.map().unknown:.0%} was unknown): what is occupied closes it"
    )


TESTS: tuple[tuple[str, Test], ...] = (
    ("plugin_failed", claimed_elsewhere),
    ("impossible", no_way),
    *OLD_TESTS,
    ("impossible", no_time),
    ("plugin_failed", stack_late),
    ("latency", latency),
    ("localization", localization),
    ("latency", late_setpoints),
    ("perception", perception),
    ("disregarded_obstacle", left_its_area),
    *OVER_AN_EDGE,
    ("tracking", left_its_path),
    ("impossible", stuck_clock),
    ("moved_obstacle", moved_obstacle),
    ("ghost_obstacle", ghost_obstacle),
    ("moved_obstacle", just_left),
    ("tracking", tracking),
    ("impossible", too_narrow),
    ("stack_held", stack_held),
    ("planner", planner),
    ("perception", sees_too_little),
    ("exploration", exploration),
    ("unexplained", unexplained),
)
"""Tests in their order, by cause."""


def near_to_standstill(facts: StandstillFacts) -> frozenset[str]:
    """Return the causes whose tests hold or are near to holding, whatever their order."""
    near = {cause for cause, test in TESTS if test(facts) is not None}
    near |= {"localization"} if facts.pose.nearly else set()
    near |= {"perception"} if facts.ranges().nearly_lied else set()
    near |= {"tracking"} if facts.off_path >= FEW else set()
    return frozenset(near)


def cause_of_standstill(case: Case) -> Finding:
    """Attribute a failure to reach the goal without a contact."""
    facts = standstill_facts(case)
    x, y, z = case.moments[-1].truth.position
    for cause, test in TESTS:
        evidence = test(facts)
        if evidence is not None:
            if facts.edge is not None and (cause, test) in OVER_AN_EDGE:
                return Finding(cause, evidence, facts.edge.decision, facts.edge.place)
            return Finding(cause, evidence, standing_since(case), (x, y, z))
    raise AssertionError("the last test always answers")


def lacks_time(case: Case) -> bool:
    """Return whether time ran out though a path is wide enough."""
    last = len(case.moments) - 1
    return case.outcome == "timeout" and true_ways(case, case.empty_navigator_at(last), last).exists
