"""Causes of contacts and standstills from tables of facts, and facts of episodes."""

from dataclasses import replace
from pathlib import Path

import pytest

from wayproof.harness.attribution import contact as contacts
from wayproof.harness.attribution import find_cause, read_case
from wayproof.harness.attribution import standstill as standstills
from wayproof.harness.attribution.commanded import CommandedFacts
from wayproof.harness.attribution.contact_facts import ContactFacts
from wayproof.harness.attribution.floor_edge import FloorEdge
from wayproof.harness.attribution.old_evidence import old_facts
from wayproof.harness.attribution.pose import PoseFacts
from wayproof.harness.attribution.ranges import RangeFacts
from wayproof.harness.attribution.standstill_facts import StandstillFacts
from wayproof.harness.attribution.ways import MapWays, TrueWays, certain_radius
from wayproof.harness.log.reader import open_log
from wayproof.harness.schema import wayproof_pb2 as pb

LIED = PoseFacts(error=0.5, covered=0.1, beyond=0.4, at_end=0.5)
BAD = RangeFacts(lost=0.3)


def cause_of(tests, facts):
    return next(name for name, test in tests if test(facts) is not None)


def changed(facts, changes):
    """Facts with some of them changed, of a part by `part.name`."""
    for name, value in changes.items():
        part, _, inner = name.partition(".")
        if inner:
            whole = getattr(facts, part)
            value = with_one(whole() if callable(whole) else whole, inner, value)
        facts = with_one(facts, part, value)
    return facts


def with_one(facts, name, value):
    """Facts with another value of one name, whether it is measured at once or when called."""
    measured = callable(getattr(facts, name))
    return replace(facts, **{name: (lambda: value) if measured else value})


TOUCH = ContactFacts(
    name="crate_0", time_s=5.0, decision=38, decision_s=3.8, there_when_decided=True,
    there_when_observed=True, observed_s=3.8, away=0.9, free=3, unknown=0, own=4, nearest_own=0.1,
    off_path=0.02, planned_clearance=0.0, pose_error=0.02, margin=0.1, usual=0.1, pose=PoseFacts(),
    ranges=RangeFacts(), disregarded=0.0, late=None,
)  # fmt: skip

BLOCKED = CommandedFacts(first=30, count=15, verdict="blocked", free_m=0.4, in_the_way=5, blocked=9)
UNKNOWN = replace(BLOCKED, verdict="unknown", in_the_way=0, blocked=0)


@pytest.mark.parametrize(
    ("change", "cause"),
    [
        ({}, "margin_too_small"),
        ({"own": 0}, "missed_obstacle"),
        ({"own": 0, "free": 1, "unknown": 2}, "unseen_obstacle"),
        ({"off_path": 0.3, "planned_clearance": 0.2}, "tracking"),
        ({"off_path": 0.3, "planned_clearance": 0.04}, "margin_too_small"),
        ({"off_path": 0.12, "planned_clearance": 0.06}, "margin_too_small"),
        ({"off_path": 0.08, "planned_clearance": 0.2, "margin": 0.04}, "margin_too_small"),
        ({"there_when_decided": False}, "moved_obstacle"),
        ({"there_when_observed": False}, "moved_obstacle"),
        ({"there_when_observed": False, "observed_s": -1e-9, "own": 0}, "missed_obstacle"),
        ({"late": (40, 0.3, 0.05), "there_when_decided": False}, "latency"),
        ({"disregarded": 0.2}, "disregarded_obstacle"),
        ({"disregarded": 0.2, "own": 0}, "missed_obstacle"),
        ({"pose": LIED, "own": 0}, "localization"),
        ({"pose": LIED, "off_path": 0.6, "planned_clearance": 0.2}, "localization"),
        ({"pose": LIED, "ranges": BAD}, "localization"),
        ({"ranges": BAD, "own": 0}, "perception"),
        ({"ranges": RangeFacts(off=0.4), "late": (40, 0.3, 0.05)}, "perception"),
        ({"ranges": RangeFacts(early=0.01), "own": 0}, "perception"),
        ({"ranges": RangeFacts(early=0.001), "own": 0}, "missed_obstacle"),
        ({"ranges": RangeFacts(lost=0.001, off=0.01), "own": 0}, "missed_obstacle"),
        ({"ranges.blind": 4.0, "own": 0}, "perception"),
        ({"ranges.blind": 4.0, "own": 0, "unknown": 9}, "unseen_obstacle"),
        ({"old.hidden": "the pose came again", "old.stated": "old"}, "frozen_evidence"),
        ({"old.stated": "without a new sweep", "pose": LIED}, "stale_evidence"),
        ({"late": (40, 0.6, 0.25), "late_answer": 0.59}, "plugin_failed"),
        ({"late": (40, 0.6, 0.25), "late_answer": 0.05}, "latency"),
        ({"commanded": BLOCKED}, "disregarded_obstacle"),
        ({"commanded": BLOCKED, "pose": LIED}, "disregarded_obstacle"),
        ({"commanded": replace(BLOCKED, in_the_way=0)}, "disregarded_obstacle"),
        ({"commanded": replace(BLOCKED, in_the_way=0), "own": 0}, "missed_obstacle"),
        ({"commanded": UNKNOWN, "own": 0, "unknown": 9}, "unseen_obstacle"),
        ({"commanded": UNKNOWN, "own": 0, "unknown": 9, "pose": LIED}, "unseen_obstacle"),
        (
            {"commanded": UNKNOWN, "own": 0, "unknown": 9, "there_when_decided": False},
            "moved_obstacle",
        ),
        ({"commanded": UNKNOWN, "own": 0}, "missed_obstacle"),
        (
            {"commanded": UNKNOWN, "own": 0, "free": 12, "unknown": 5, "hidden": 16},
            "unseen_obstacle",
        ),
        (
            {"commanded": UNKNOWN, "own": 0, "free": 4, "unknown": 3, "hidden": -9},
            "missed_obstacle",
        ),
        ({"commanded": UNKNOWN}, "margin_too_small"),
    ],
)
def test_a_contact_has_the_cause_that_its_facts_leave(change, cause):
    assert cause_of(contacts.TESTS, changed(TOUCH, change)) == cause


TRUTH = TrueWays(
    radius=0.5,
    exists=True,
    over_ramps=False,
    at_start=0.7,
    shortest_s=5.0,
    speed=1.0,
    left_m=3.0,
    gained_m=0.0,
    widest=lambda: 0.8,
    open_at_end=lambda: True,
)


MAP = MapWays(
    known=0.0, passable=1.0, roomy=1.0, certain=1.0, in_vain=0.0, not_found=0.0, ghosts=0,
    of_prior=0, ghost=(0.0, 0.0, 0.0), without_ghosts=True,
    roomy_without_ghosts=True, without_movers=False, held_up=0.0, unknown=0.2,
)  # fmt: skip


STILL = StandstillFacts(
    outcome="stuck", reason="", window=50, discarded=0.0, late=0.0, deadline=0.25, delay=0.05,
    off_path=0.0, worst_off_path=0.1, left_path=0.0, limit_s=60.0, claimed=False,
    lost_sigma=None, doubt=0.02, radius=0.3, cell=0.1, iterations=1, without_path=0.0,
    pose=PoseFacts(), truth=TRUTH, ranges=RangeFacts, map=lambda: MAP,
)  # fmt: skip


def edge(verdict, *commands):
    return FloorEdge((1.0, 2.0, 0.0), 5, verdict, commands)


CLOSED = {"map.passable": 0.0, "map.ghosts": 7}
NARROW = {"map.roomy": 0.0, "map.ghosts": 7}
IN_VAIN = {"map.in_vain": 0.4, "map.not_found": 0.8}


@pytest.mark.parametrize(
    ("change", "cause"),
    [
        ({}, "exploration"),
        ({"map.known": 0.8}, "planner"),
        ({"cut": 40}, "stack_held"),
        ({"cut": 40, "map.known": 0.8}, "stack_held"),
        ({"cut": 40, "pose": LIED}, "localization"),
        ({"cut": 40, "truth.open_at_end": False}, "moved_obstacle"),
        ({"cut": 10, "map.known": 0.8}, "planner"),
        ({"cut": 40, "map.passable": 0.0}, "unexplained"),
        ({"cut": 10}, "exploration"),
        ({"on_trial": True}, "exploration"),
        ({"on_trial": True, "outcome": "timeout"}, "exploration"),
        ({"on_trial": True, "cut": 40}, "stack_held"),
        ({"on_trial": True, "map.known": 0.8}, "planner"),
        ({"on_trial": True, "map.passable": 0.0}, "unexplained"),
        ({"on_trial": True, "truth.exists": False}, "impossible"),
        ({"on_trial": True, "outcome": "fall"}, "tracking"),
        ({"outcome": "fall", "edge": edge("blocked")}, "disregarded_obstacle"),
        ({"outcome": "fall", "edge": edge("unknown", 7)}, "unseen_obstacle"),
        ({"outcome": "fall", "edge": edge("admitted")}, "missed_obstacle"),
        ({"outcome": "fall", "edge": edge("unknown"), "pose": LIED}, "localization"),
        ({"outcome": "fall", "edge": edge("unknown"), "late": 0.6}, "latency"),
        ({"map.in_vain": 0.4, "map.not_found": 0.8}, "planner"),
        ({"map.in_vain": 0.4, "map.not_found": 0.2}, "exploration"),
        ({**NARROW, **IN_VAIN}, "ghost_obstacle"),
        ({**NARROW, "map.in_vain": 0.4, "map.not_found": 0.2}, "exploration"),
        ({**NARROW, "map.known": 0.8}, "planner"),
        ({**NARROW, **IN_VAIN, "map.roomy_without_ghosts": False}, "planner"),
        ({**NARROW, **IN_VAIN, "map.ghosts": 0}, "planner"),
        ({**NARROW, **IN_VAIN, "map.roomy": 0.8}, "planner"),
        ({"discarded": 0.6}, "latency"),
        ({"discarded": 0.6, "truth.exists": False}, "impossible"),
        ({"discarded": 0.6, "answered_late": 0.6}, "plugin_failed"),
        ({"discarded": 0.6, "answered_late": 0.2}, "latency"),
        ({"claimed": True, "claimed_at": 2.0}, "plugin_failed"),
        ({"outcome": "out_of_bounds", "beyond_area": 12}, "disregarded_obstacle"),
        ({"outcome": "out_of_bounds"}, "tracking"),
        ({"old.hidden": "the pose came again"}, "frozen_evidence"),
        ({"old.stated": "without a new sweep"}, "stale_evidence"),
        ({"truth.exists": False}, "impossible"),
        ({"truth.shortest_s": 61.0}, "impossible"),
        ({"truth.shortest_s": 61.0, "pose": LIED}, "impossible"),
        ({"truth.shortest_s": 55.0, "explored_s": 9.0}, "impossible"),
        ({"truth.shortest_s": 55.0, "explored_s": 3.0}, "exploration"),
        ({"truth.shortest_s": 55.0, "explored_s": 9.0, "hidden_by": "sensors"}, "perception"),
        ({"truth.shortest_s": 20.0, "explored_s": 55.0}, "exploration"),
        ({"truth.exists": False, "truth.over_ramps": True, "outcome": "fall"}, "tracking"),
        ({"turned": 1.2}, "impossible"),
        ({"turned": 1.2, "outcome": "timeout"}, "exploration"),
        ({"turned": 1.2, "pose": LIED}, "localization"),
        ({"hidden_by": "map.no_return = ignore"}, "perception"),
        ({"hidden_by": "map.no_return = ignore", "map.known": 0.8}, "planner"),
        ({"hidden_by": "map.no_return = ignore", "map.passable": 0.0}, "unexplained"),
        ({"outcome": "fall", "jumped": 0.5}, "localization"),
        ({"outcome": "fall", "jumped": 0.1}, "tracking"),
        ({"outcome": "fall", "doubt": 0.5, "map.passable": 0.0}, "tracking"),
        ({"outcome": "timeout", "truth.shortest_s": 61.0, "truth.gained_m": 2.0}, "impossible"),
        ({"outcome": "timeout", "truth.shortest_s": 50.0, "truth.gained_m": 2.0}, "impossible"),
        ({"outcome": "timeout", "truth.shortest_s": 46.0, "truth.gained_m": 2.0}, "planner"),
        ({"outcome": "timeout", "truth.gained_m": 2.0, "without_path": 0.6}, "planner"),
        ({"outcome": "timeout", "truth.gained_m": 2.0, "map.passable": 0.2}, "unexplained"),
        ({"outcome": "timeout", "truth.gained_m": 2.0, "off_path": 0.7}, "tracking"),
        ({"outcome": "timeout", "truth.gained_m": 0.1}, "exploration"),
        ({"outcome": "timeout", "truth.gained_m": 0.1, "map.known": 1.0}, "planner"),
        ({"truth.open_at_end": False}, "moved_obstacle"),
        (CLOSED, "ghost_obstacle"),
        ({**CLOSED, "map.ghosts": 0, "map.without_movers": True}, "moved_obstacle"),
        (
            {"outcome": "timeout", "truth.gained_m": 2.0, "without_path": 0.4, "map.held_up": 0.8},
            "moved_obstacle",
        ),
        ({"map.known": 0.8, "truth.widest": 0.52}, "impossible"),
        ({"map.known": 0.8, "truth.at_start": 0.4}, "impossible"),
        ({"outcome": "fall", "truth.at_start": 0.4}, "tracking"),
        ({**CLOSED, "map.without_ghosts": False}, "unexplained"),
        ({**CLOSED, "pose": LIED}, "localization"),
        ({**CLOSED, "ranges": BAD}, "perception"),
        ({"off_path": 0.7}, "tracking"),
        ({"lost_sigma": 0.6}, "localization"),
        ({"left_path": 0.2, "map.known": 1.0}, "tracking"),
        ({"outcome": "fall"}, "tracking"),
        ({"outcome": "fall", "truth.exists": False}, "tracking"),
        ({"outcome": "fall", "late": 1.0}, "latency"),
        ({"outcome": "fall", "pose": LIED}, "localization"),
        ({"outcome": "out_of_bounds", "pose": LIED}, "localization"),
        ({"claimed": True, "pose.at_end": 0.4}, "localization"),
        ({"doubt": 0.5, "map.passable": 0.0}, "localization"),
        ({"doubt": 0.5, "map.passable": 0.0, "map.certain": 0.0}, "unexplained"),
        ({"ranges.blind": 4.0}, "perception"),
        ({"ranges.blind": 4.0, "map.known": 1.0}, "planner"),
    ],
)
def test_a_standstill_has_the_cause_that_its_facts_leave(change, cause):
    assert cause_of(standstills.TESTS, changed(STILL, change)) == cause


def test_nothing_that_moves_is_blamed_where_nothing_moves(recorded):
    """The body has flown into the floor."""
    stack = "stack.name=tests.harness.interface.stacks_on_trial:Lands"
    log = open_log(Path(recorded("empty", "drone", 1, stack).log), allow_plugins=True)
    case = read_case(log)
    assert not case.moments[-1].truth.movers
    assert find_cause(case).cause != "moved_obstacle"


@pytest.fixture(scope="module")
def brief(recorded):
    """Two seconds of a drone, whose sweeps all come."""
    return read_case(open_log(Path(recorded("empty", "drone", 1, "episode.time_limit=2").log)))


def test_a_doubt_that_came_later_is_none_of_an_earlier_decision(brief):
    navigator = brief.empty_navigator_at(3)
    sure, unsure = pb.Decision(position_sigma=0.02), pb.Decision(position_sigma=0.4)
    assert certain_radius(navigator, sure) == navigator.costmap.inflation_radius
    assert certain_radius(navigator, unsure) < navigator.costmap.inflation_radius - 0.7


def without_sweeps_of(sensor):
    return lambda one: replace(one, sweeps=tuple(s for s in one.sweeps if s.sensor != sensor))


def standing_for_want_of_evidence(moment):
    stale = pb.Decision(label="map_stale", predicate=pb.Reason(delay_s=0.7))
    return replace(moment, decision=stale)


def by_an_old_pose(moment):
    pose = pb.Pose()
    pose.CopyFrom(moment.pose)
    pose.age_ns = 400_000_000
    return replace(moment, pose=pose)


@pytest.mark.parametrize(
    ("change", "last", "said"),
    [
        (without_sweeps_of("lidar"), 9, ""),
        (without_sweeps_of("lidar"), 10, "50% of the last 20 decisions were made without a new"),
        (without_sweeps_of("altimeter"), 20, ""),
        (standing_for_want_of_evidence, 9, ""),
        (standing_for_want_of_evidence, 10, "what lay on its way was last seen 0.7 s ago"),
        (by_an_old_pose, 1, "the pose was 0.4 s old by its stamp"),
    ],
)
def test_what_was_old_by_its_stamp_at_the_end_is_stated(brief, change, last, said):
    assert next(iter(brief.beams_at(0))) == "lidar"
    assert len(brief.moments) > 20
    moments = (*brief.moments[:-last], *map(change, brief.moments[-last:]))
    stated = old_facts(replace(brief, moments=moments), len(moments) - 1).stated
    assert said in stated
    assert bool(stated) == bool(said)


def evidence(change):
    facts = changed(STILL, change)
    return next(said for _, test in standstills.TESTS if (said := test(facts)) is not None)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (
            {"truth.shortest_s": 61.0, "truth.speed": 0.2, "speed_fraction": 0.05},
            "takes 61.0 s at 0.20 m/s (motion.speed_fraction = 0.05), the limit was 60.0 s",
        ),
        ({"truth.shortest_s": 61.0}, "takes 61.0 s at full speed, the limit was 60.0 s"),
        (
            {"truth.shortest_s": 55.0, "explored_s": 9.0},
            "9.0 s more went into looking where nothing was known",
        ),
        ({"truth.exists": False, "truth.over_ramps": True}, "costmap.max_slope = 0 rad makes an"),
        ({"turned": 1.2, "stuck_after": 2.0}, "episode.stuck_after = 2 s ended it"),
        ({"hidden_by": "map.minimum_range = 4.0"}, "bounded by map.minimum_range = 4.0"),
        (
            {**CLOSED, "map.of_prior": 5},
            "7 cells mapped occupied are truly free, 5 of them held by",
        ),
        (
            {
                "on_trial": True,
                "map.known": 1.0,
                "map.own_plan_m": 3.0,
                "map.own_plan_clear_m": 3.0,
            },
            "its own last plan was clear for all 3.0 m",
        ),
        ({"on_trial": True, "map.known": 1.0, "did": "stood still"}, "the stack on trial stood"),
        ({"on_trial": True, "did": "gave up itself"}, "the stack on trial gave up itself; it did"),
    ],
)
def test_a_sentence_names_the_setting_or_what_a_stack_did(change, says):
    assert says in evidence(change)
