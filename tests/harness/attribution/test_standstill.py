"""Causes of standstills, from tables of facts and from episodes."""

from pathlib import Path

import pytest

from tests.harness.attribution.facts import BAD, LIED, cause_of, changed
from wayproof.harness.attribution import find_cause, read_case
from wayproof.harness.attribution import standstill as standstills
from wayproof.harness.attribution.floor_edge import FloorEdge
from wayproof.harness.attribution.pose import PoseFacts
from wayproof.harness.attribution.ranges import RangeFacts
from wayproof.harness.attribution.standstill_facts import StandstillFacts
from wayproof.harness.attribution.ways import MapWays, TrueWays, certain_radius
from wayproof.harness.log.reader import open_log
from wayproof.harness.schema import wayproof_pb2 as pb

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


def test_a_doubt_that_came_later_is_none_of_an_earlier_decision(recorded):
    log = open_log(Path(recorded("empty", "drone", 1, "episode.time_limit=2").log))
    case = read_case(log)
    navigator = case.empty_navigator_at(3)
    sure, unsure = pb.Decision(position_sigma=0.02), pb.Decision(position_sigma=0.4)
    assert certain_radius(navigator, sure) == navigator.costmap.inflation_radius
    assert certain_radius(navigator, unsure) < navigator.costmap.inflation_radius - 0.7


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
