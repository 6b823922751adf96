"""Causes: each test on facts by hand, and planted failures through the whole procedure."""

import math
import shutil
from dataclasses import fields, replace
from functools import cache
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from wayproof.harness.attribution import CAUSES, find_cause, near_misses, read_case
from wayproof.harness.attribution import contact as contacts
from wayproof.harness.attribution import standstill as standstills
from wayproof.harness.attribution.contact import ContactFacts
from wayproof.harness.attribution.finding import Finding
from wayproof.harness.attribution.grids import clearances, joined, widest
from wayproof.harness.attribution.pose import PoseFacts
from wayproof.harness.attribution.ranges import RangeFacts
from wayproof.harness.attribution.standstill import StandstillFacts, lacks_time
from wayproof.harness.attribution.true_space import TrueSpace
from wayproof.harness.attribution.ways import MapWays, TrueWays
from wayproof.harness.bench.attribution.breaks import KINDS, Broken
from wayproof.harness.bench.attribution.confusion import confusion, right, run_planted, table
from wayproof.harness.bench.attribution.failures import attempts
from wayproof.harness.bench.attribution.fault_scenarios import PLANTS
from wayproof.harness.config import Config
from wayproof.harness.counterfactual.check import Check, check, settle
from wayproof.harness.counterfactual.record import read_check, record_check
from wayproof.harness.counterfactual.recorded_movers import with_recorded_movers
from wayproof.harness.counterfactual.remedies import REMEDIES
from wayproof.harness.errors import InputError
from wayproof.harness.log.reader import open_log
from wayproof.harness.recompute.rebuild import rebuild
from wayproof.harness.replay.fork import fork
from wayproof.harness.result import Contact
from wayproof.harness.scenario.scenario import build
from wayproof.harness.study.checks import check_failures

TOUCH = ContactFacts(
    name="crate_0", time_s=5.0, decision=38, decision_s=3.8, there_when_decided=True,
    there_when_observed=True, observed_s=3.8, away=0.9, free=3, unknown=0, own=4, nearest_own=0.1,
    off_path=0.02, planned_clearance=0.0, pose_error=0.02, margin=0.1, usual=0.1, pose=PoseFacts(),
    ranges=RangeFacts(), disregarded=0.0, late=None,
)  # fmt: skip
TRUTH = TrueWays(
    radius=0.5,
    widest=0.8,
    exists=True,
    open_at_end=True,
    at_start=0.7,
    shortest_s=5.0,
    left_m=3.0,
    gained_m=0.0,
)
MAP = MapWays(
    known=0.0, passable=1.0, certain=1.0, in_vain=0.0, not_found=0.0, ghosts=0, holes=0,
    ghost=(0.0, 0.0, 0.0), without_ghosts=True, without_movers=False, held_up=0.0,
    unknown=0.2,
)  # fmt: skip
STILL = StandstillFacts(
    outcome="stuck", reason="", window=50, discarded=0.0, late=0.0, deadline=0.25, delay=0.05,
    off_path=0.0, worst_off_path=0.1, left_path=0.0, limit_s=60.0, claimed=False, doubt=0.02,
    radius=0.3, cell=0.1, iterations=1, without_path=0.0, pose=PoseFacts(), ranges=RangeFacts(),
    truth=TRUTH, map=MAP,
)  # fmt: skip
LIED = PoseFacts(error=0.5, covered=0.1, beyond=0.4, first=12, at_end=0.5)
BAD = RangeFacts(lost=0.3)
CLOSED = {"map.passable": 0.0, "map.ghosts": 7}

SCENE = """<mujoco><size nuser_geom="1"/><worldbody>
<geom name="floor" type="plane" size="5 5 0.1" user="1"/>
<geom name="crate" type="box" pos="2 0 0.5" size="0.5 0.5 0.5" user="4"/>
<body name="robot_base" pos="0 0 0.5"><freejoint/><geom size="0.25" group="3"/></body>
</worldbody></mujoco>"""


@pytest.fixture(scope="module")
def planted(tmp_path_factory):
    """Log and result of a planted failure, each run once."""
    folder = tmp_path_factory.mktemp("planted")

    @cache
    def run(cause, seed):
        path = folder / f"{cause}-{seed}.mcap"
        return path, run_planted(cause, seed, path)

    return run


def cause_of(tests, facts):
    return next(name for name, test in tests if test(facts) is not None)


def changed(facts, changes):
    """Facts with some of them changed, of a part by `part.name`."""
    for name, value in changes.items():
        part, _, inner = name.partition(".")
        value = replace(getattr(facts, part), **{inner: value}) if inner else value
        facts = replace(facts, **{part: value})
    return facts


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
        ({"ranges": RangeFacts(lost=0.001, off=0.01), "own": 0}, "missed_obstacle"),
        ({"ranges.blind": 4.0, "own": 0}, "perception"),
        ({"ranges.blind": 4.0, "own": 0, "unknown": 9}, "unseen_obstacle"),
        ({"ranges.withheld": 0.9}, "latency"),
    ],
)
def test_a_contact_has_the_cause_that_its_facts_leave(change, cause):
    assert cause_of(contacts.TESTS.items(), changed(TOUCH, change)) == cause


@pytest.mark.parametrize(
    ("change", "cause"),
    [
        ({}, "unexplained"),
        ({"map.known": 0.8}, "planner"),
        ({"map.in_vain": 0.4, "map.not_found": 0.8}, "planner"),
        ({"map.in_vain": 0.4, "map.not_found": 0.2}, "unexplained"),
        ({"discarded": 0.6}, "latency"),
        ({"discarded": 0.6, "truth.exists": False}, "impossible"),
        ({"ranges.withheld": 0.9}, "latency"),
        ({"truth.exists": False}, "impossible"),
        ({"truth.shortest_s": 61.0}, "impossible"),
        ({"truth.shortest_s": 61.0, "pose": LIED}, "impossible"),
        ({"outcome": "timeout", "truth.shortest_s": 61.0, "truth.gained_m": 2.0}, "impossible"),
        ({"outcome": "timeout", "truth.shortest_s": 59.0, "truth.gained_m": 2.0}, "planner"),
        ({"outcome": "timeout", "truth.gained_m": 2.0, "without_path": 0.6}, "planner"),
        ({"outcome": "timeout", "truth.gained_m": 2.0, "map.passable": 0.2}, "unexplained"),
        ({"outcome": "timeout", "truth.gained_m": 2.0, "off_path": 0.7}, "tracking"),
        ({"outcome": "timeout", "truth.gained_m": 0.1}, "unexplained"),
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


def test_every_cause_is_planted_and_asked_for():
    asked = set(contacts.TESTS) | {name for name, _ in standstills.TESTS}
    assert asked == set(CAUSES) == {*PLANTS, "unexplained"}


def saved_by(*remedies):
    """A check in which these saved the robot, and no other one of all."""
    names = ("control", *REMEDIES)
    return [Check(name, 0, "success" if name in remedies else "stuck", 9.0, name in remedies)
            for name in names]  # fmt: skip


@pytest.mark.parametrize(
    ("found", "saving", "cause", "answer"),
    [
        ("localization", ("true_pose",), "localization", "confirmed"),
        ("tracking", ("true_pose",), "localization", "changed"),
        ("tracking", ("true_pose", "perfect_tracking"), "tracking", "confirmed"),
        ("planner", ("larger_margin", "true_ranges", "true_map"), "perception", "changed"),
        ("missed_obstacle", ("true_map", "larger_margin"), "missed_obstacle", "confirmed"),
        ("ghost_obstacle", ("no_delay",), "latency", "changed"),
        ("ghost_obstacle", (), "unexplained", "changed"),
        ("planner", (), "planner", "confirmed"),
        ("planner", ("more_time",), "planner", "confirmed"),
        ("unexplained", ("more_time",), "unexplained", "confirmed"),
        ("localization", ("more_time",), "unexplained", "changed"),
        ("impossible", ("more_time",), "impossible", "confirmed"),
        ("impossible", (), "impossible", "confirmed"),
        ("unexplained", (), "unexplained", "confirmed"),
        ("unexplained", ("more_search",), "planner", "changed"),
        ("unexplained", ("true_map",), "ghost_obstacle", "changed"),
        ("unexplained", ("true_map", "no_movers"), "moved_obstacle", "changed"),
        ("localization", ("control", "true_pose"), "localization", "inconclusive"),
    ],
)
def test_the_answer_of_a_check_decides(found, saving, cause, answer):
    finding = Finding(found, "by its facts", 3, (0.0, 0.0, 0.0))
    settled, told = settle(finding, saved_by(*saving))
    assert (settled.cause, told) == (cause, answer)
    assert "by its facts" in settled.evidence


def test_every_cause_but_what_nothing_can_put_right_has_a_remedy():
    borne_out = {cause for _, causes in REMEDIES.values() for cause in causes}
    assert borne_out == set(CAUSES) - {"disregarded_obstacle", "unexplained"}


def test_grids_know_the_widest_way():
    walls = np.zeros((20, 11), bool)
    walls[10] = True
    walls[10, 3:8] = False  # five cells: 0.3 m from the middle one's centre to the walls' cells
    gaps = clearances(walls, 0.1)
    assert gaps[10, 5] == pytest.approx(0.3)
    assert joined(gaps > 0.29, (4, 5), (16, 5), 0)
    assert not joined(gaps > 0.31, (4, 5), (16, 5), 0)
    assert widest(gaps, (4, 5), (16, 5), 0) == pytest.approx(0.3, abs=0.01)


def test_true_space_measures_the_scene():
    space = TrueSpace(SCENE)
    distance, name = space.distance(np.array([1.0, 0.0, 0.9]))
    assert (distance, name) == (pytest.approx(0.5, abs=1e-5), "crate")
    assert space.body_clearance() == pytest.approx(1.25)  # from 0.25 to 1.5
    space.place_robot(np.array([1.0, 0.0, 0.5]), np.array([1.0, 0.0, 0.0, 0.0]))
    assert space.body_clearance("crate") == pytest.approx(0.25)
    place, name = space.body_contact()
    np.testing.assert_allclose(place, [1.5, 0.0, 0.5], atol=1e-6)
    occupied = space.occupied(np.array([1.0, -1.0, 0.0]), (20, 20, 10), 0.1)
    assert occupied.sum() == 1000  # one cubic metre
    assert occupied[5:15, 5:15].all()
    assert not space.moves("crate")


def test_a_contact_reads_what_it_wrote():
    contact = Contact("shelf at the door", (1.25, -2.0, 0.5))
    assert Contact.from_text(str(contact)) == contact
    assert Contact.from_text("") is None


@pytest.mark.parametrize("cause", PLANTS)
def test_planted_causes_are_found(planted, cause):
    _, result = planted(cause, 0)
    assert result.cause == cause, result.cause_evidence


def test_what_is_found_is_counted():
    counts = confusion(["tracking"], range(1))
    assert (counts, right(counts)) == ({("tracking", "tracking"): 1}, 1.0)
    assert table(counts).row_count == 1


def test_a_log_tells_the_cause_that_its_run_found(planted, tmp_path):
    source, result = planted("missed_obstacle", 0)
    path = Path(shutil.copyfile(source, tmp_path / "glass.mcap"))
    log = open_log(path)
    finding = find_cause(read_case(log))
    assert log.result["cause"] == result.cause == finding.cause == "missed_obstacle"
    assert log.result["cause_evidence"] == finding.evidence
    assert int(log.result["cause_decision"]) == finding.decision
    assert result.contact.startswith("glass_0 at ")
    verdict = check(log, finding, ("true_map", "no_delay"))
    saved = {one.remedy: one.saves for one in verdict.checks}
    assert saved == {"control": False, "true_map": True, "no_delay": False}
    assert (verdict.finding, verdict.answer) == (finding, "confirmed")
    record_check(path, verdict)
    checked = open_log(path)
    assert read_check(checked) == verdict
    changed = {key for key in log.result if checked.result[key] != log.result[key]}
    assert changed == {"content"}  # the facts' cause stays, for anybody to work out again
    assert find_cause(read_case(checked)) == finding


def test_a_study_checks_its_failures_within_a_bound(planted, tmp_path):
    source, _ = planted("missed_obstacle", 0)
    for name in ("one", "two"):
        shutil.copyfile(source, tmp_path / f"{name}.mcap")
    studied = [SimpleNamespace(key=name) for name in ("one", "one", "two", "none")]
    store = SimpleNamespace(log=lambda key: tmp_path / f"{key}.mcap")
    tally = check_failures(studied, store, most_s=0.1)
    assert (dict(tally.answers), tally.left) == ({"inconclusive": 1}, 1)
    assert "1 left unchecked by the bound" in str(tally)
    again = check_failures(studied, store, most_s=0.0)
    assert (dict(again.answers), again.left) == ({}, 1)  # a log is checked once


def test_a_walking_robot_is_saved_by_the_true_map(planted, tmp_path):
    """It walks into a wall too near for its map; also where the log is a fork's."""
    source, result = planted("unseen_obstacle", 3)
    assert (open_log(source).config.robot, result.outcome) == ("quadruped", "collision")
    forked = fork(source, 5, (), tmp_path / "fork.mcap")
    log = open_log(Path(forked.log))
    finding = find_cause(read_case(log))
    assert finding.cause == "unseen_obstacle"
    checks = check(log, finding, ("true_map",)).checks
    assert {one.remedy: one.saves for one in checks} == {"control": False, "true_map": True}


def test_a_way_that_is_shut_lacks_space_and_not_time(planted):
    path, _ = planted("impossible", 0)
    assert not lacks_time(read_case(open_log(path)))


def test_movers_of_a_world_without_a_name_go_as_recorded(planted):
    """A wall that vanished; and a truck, which went on until it struck."""
    worlds = {}
    for cause in ("ghost_obstacle", "moved_obstacle"):
        log = open_log(planted(cause, 0)[0])
        case = read_case(log)
        (mover,) = with_recorded_movers(rebuild(log), case).world.movers
        worlds[mover.name] = mover, case
    gone, case = worlds["gone"]
    assert (gone.appears, gone.speed) == (0.0, 0.0)
    assert 0.6 <= gone.vanishes <= 1.3
    assert gone.place(0).position == pytest.approx(case.moments[0].truth.movers[0].position)
    truck, case = worlds["truck"]
    assert (truck.appears, truck.vanishes) == (0.0, math.inf)
    for moment in case.moments:
        was = moment.truth.movers[0].position
        assert truck.place(moment.time_ns).position == pytest.approx(was, abs=0.01)
    for moment in case.moments:
        moment.truth.movers[0].present = False
    (truck,) = with_recorded_movers(rebuild(log), case).world.movers
    assert truck.appears > 1e6  # it did not come before the log ended
    assert truck.place(case.moments[-1].time_ns + 10**9).position[0] < was[0] - 1.4


def test_a_success_has_no_cause(recorded):
    result = recorded("empty", "drone", 1)
    assert result.outcome == "success"
    assert (result.cause, result.contact, result.cause_decision) == ("", "", -1)
    case = read_case(open_log(Path(result.log)))
    assert find_cause(case) is None
    assert near_misses(case) == []


def test_near_misses_are_found_in_a_success(recorded):
    case = read_case(open_log(Path(recorded("empty", "drone", 1).log)))
    first = case.moments[10]
    first.truth.clearance_m = 0.01
    found = near_misses(case)
    assert [(one.decision, one.clearance_m) for one in found] == [(10, 0.01)]
    assert found[0].finding.cause in CAUSES


def test_an_unknown_cause_is_refused():
    with pytest.raises(InputError, match="unknown cause 'gost_obstacle'; did you mean"):
        run_planted("gost_obstacle", 0, Path("none.mcap"))


def test_attempts_take_both_halves_in_turn():
    for kind in KINDS:
        tried = list(attempts(kind))
        assert [seed % 2 for _, _, seed in tried] == [0, 1] * (len(tried) // 2)
        assert len(set(tried)) == len(tried)


TOGETHER = {"retentive": ["settings", "world"]}
"""Fields of kinds whose one broken assumption takes two."""


def test_every_kind_breaks_one_thing():
    sound = build(Config("corridor", "drone", 3))
    rng = np.random.default_rng(0)
    for name, kind in KINDS.items():
        assert kind.cause in CAUSES
        broken = kind.breaks(sound, SimpleNamespace(sim_time_s=10.0), rng)
        whole = Broken()
        differing = [
            one.name
            for one in fields(Broken)
            if getattr(broken, one.name) != getattr(whole, one.name)
        ]
        assert len(differing) == 1 or differing == TOGETHER[name]
    closed = KINDS["closed"].breaks(sound, None, rng).scenario(sound)
    assert len(closed.world.solids) == len(sound.world.solids) + 1
