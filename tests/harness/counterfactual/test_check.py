"""Counterfactual checks of causes."""

import math
import shutil
from pathlib import Path
from types import SimpleNamespace

import pytest

from wayproof.harness.attribution import CAUSES, find_cause, read_case
from wayproof.harness.attribution.finding import Finding
from wayproof.harness.counterfactual.check import check, settle, why_inconclusive
from wayproof.harness.counterfactual.recorded_movers import with_recorded_movers
from wayproof.harness.counterfactual.remedies import REMEDIES
from wayproof.harness.counterfactual.verdict import Check
from wayproof.harness.log.reader import open_log
from wayproof.harness.recompute.rebuild import rebuild
from wayproof.harness.replay.fork import fork
from wayproof.harness.study.checks import check_failures

CONTACTS = ("missed_obstacle", "unseen_obstacle", "disregarded_obstacle", "margin_too_small")
"""Causes that are shown after a collision."""


def saved_by(recorded, *remedies):
    """A check in which these saved the robot, and no other one of all; `+name` with both seeds."""
    first = {name.removeprefix("+") for name in remedies}
    names = ("control", *REMEDIES)
    once = [Check(name, 0, "success" if name in first else recorded, 9.0, name in first)
            for name in names]  # fmt: skip
    seeds = [(name, f"+{name}" in remedies) for name in first - {"control"}]
    return once + [
        Check(name, 0, "success" if saves else recorded, 9.0, saves, again=True)
        for name, saves in seeds
    ]


@pytest.mark.parametrize(
    ("found", "saving", "near", "cause", "answer"),
    [
        ("localization", ("true_pose",), (), "localization", "confirmed"),
        ("tracking", ("+true_pose",), (), "localization", "changed"),
        ("tracking", ("true_pose",), ("localization",), "localization", "changed"),
        ("tracking", ("true_pose",), (), "tracking", "confirmed"),
        ("tracking", ("+true_pose", "perfect_tracking"), (), "tracking", "confirmed"),
        ("localization", ("perfect_tracking",), (), "localization", "inconclusive"),
        ("localization", ("+perfect_tracking",), ("tracking",), "localization", "inconclusive"),
        ("missed_obstacle", ("+larger_margin",), (), "missed_obstacle", "inconclusive"),
        ("margin_too_small", ("+perfect_tracking",), (), "tracking", "changed"),
        ("planner", ("larger_margin", "+true_ranges", "true_map"), (), "perception", "changed"),
        ("planner", ("true_map",), ("missed_obstacle",), "planner", "confirmed"),
        ("missed_obstacle", ("true_map", "larger_margin"), (), "missed_obstacle", "confirmed"),
        ("missed_obstacle", ("true_map", "true_pose"), (), "missed_obstacle", "confirmed"),
        ("missed_obstacle", ("true_map", "+true_pose"), (), "localization", "changed"),
        ("missed_obstacle", ("true_pose",), (), "missed_obstacle", "inconclusive"),
        ("ghost_obstacle", ("true_map", "true_pose"), ("localization",), "localization", "changed"),
        ("ghost_obstacle", ("true_map", "+true_ranges"), (), "perception", "changed"),
        ("ghost_obstacle", ("+no_delay",), (), "latency", "changed"),
        ("ghost_obstacle", (), (), "ghost_obstacle", "inconclusive"),
        ("planner", (), (), "planner", "confirmed"),
        ("planner", ("more_time",), (), "planner", "confirmed"),
        ("unexplained", ("more_time",), (), "unexplained", "confirmed"),
        ("localization", ("more_time",), (), "localization", "inconclusive"),
        ("impossible", ("more_time",), (), "impossible", "confirmed"),
        ("impossible", (), (), "impossible", "confirmed"),
        ("unexplained", (), (), "unexplained", "confirmed"),
        ("disregarded_obstacle", ("guard", "+true_pose"), (), "disregarded_obstacle", "confirmed"),
        ("missed_obstacle", ("guard",), (), "missed_obstacle", "inconclusive"),
        ("missed_obstacle", ("guard", "+no_movers"), (), "moved_obstacle", "changed"),
        ("disregarded_obstacle", (), (), "disregarded_obstacle", "inconclusive"),
        ("stack_held", ("no_guard",), (), "stack_held", "confirmed"),
        ("stack_held", (), (), "stack_held", "confirmed"),
        ("exploration", (), (), "exploration", "confirmed"),
        ("exploration", ("+true_pose",), (), "localization", "changed"),
        ("stack_held", ("no_guard", "+true_ranges"), (), "stack_held", "confirmed"),
        ("ghost_obstacle", ("no_guard",), (), "ghost_obstacle", "inconclusive"),
        ("unexplained", ("+more_search",), (), "planner", "changed"),
        ("unexplained", ("true_map",), (), "unexplained", "confirmed"),
        ("unexplained", ("true_map",), ("ghost_obstacle",), "ghost_obstacle", "changed"),
        ("unexplained", ("true_map", "+no_movers"), (), "moved_obstacle", "changed"),
        ("localization", ("control", "true_pose"), (), "localization", "inconclusive"),
        ("plugin_failed", (), (), "plugin_failed", "inconclusive"),
    ],
)
def test_a_check_decides_the_cause(found, saving, near, cause, answer):
    finding = Finding(found, "by its facts", 3, (0.0, 0.0, 0.0))
    recorded = "collision" if found in CONTACTS else "stuck"
    settled, given = settle(finding, saved_by(recorded, *saving), recorded, near)
    assert (settled.cause, given) == (cause, answer)
    assert "by its facts" in settled.evidence


@pytest.mark.parametrize(
    ("outcomes", "recorded", "why"),
    [
        ({"control": "stuck"}, "stuck", "no remedy was tried"),
        ({"control": "success"}, "stuck", "without a change it ended as success, not as recorded"),
        (
            {"control": "collision", "true_pose": "success"},
            "stuck",
            "without a change it ended as collision, not as recorded",
        ),
        (
            {"control": "stuck", "no_movers": "stuck"},
            "stuck",
            "no remedy for localization was tried, and no other saves it",
        ),
        (
            {"control": "stuck", "guard": "success"},
            "stuck",
            "guard alone saves it, which says nothing about localization",
        ),
    ],
)
def test_what_shows_nothing_of_a_cause_is_inconclusive_and_says_why(outcomes, recorded, why):
    finding = Finding("localization", "by its facts", 3, (0.0, 0.0, 0.0))
    checks = [Check(name, 0, end, 9.0, end == "success") for name, end in outcomes.items()]
    assert settle(finding, checks, recorded=recorded) == (finding, "inconclusive")
    assert why_inconclusive(finding, checks, recorded=recorded) == why


def test_a_remedy_saves_a_mission_with_all_its_goals(recorded):
    """Two goals take 7.7 s; the first one alone takes 3.7 s."""
    goals = ('waypoints=["world"]', "goal=home", "episode.time_limit=5")
    log = open_log(Path(recorded("empty", "drone", 1, *goals).log))
    verdict = check(log, find_cause(read_case(log)), ("more_time",))
    control, longer = verdict.checks
    assert (control.outcome, longer.outcome) == ("timeout", "success")
    assert longer.end_s > 6.0


def test_every_cause_that_a_change_can_undo_has_a_remedy():
    borne_out = {cause for _, causes in REMEDIES.values() for cause in causes}
    without = {"unexplained", "exploration"}
    assert borne_out == set(CAUSES) - without


def test_a_study_checks_its_failures_within_a_bound(planted, tmp_path):
    source, _ = planted("missed_obstacle", 0)
    for name in ("one", "two"):
        shutil.copyfile(source, tmp_path / f"{name}.mcap")
    studied = [SimpleNamespace(key=name) for name in ("one", "one", "two", "none")]
    store = SimpleNamespace(log=lambda key: tmp_path / f"{key}.mcap")
    tally = check_failures(studied, store, max_s=0.1)
    assert (dict(tally.answers), tally.left) == ({"inconclusive": 1}, 1)
    assert "1 left unchecked by the bound" in str(tally)
    again = check_failures(studied, store, max_s=0.0)
    assert (dict(again.answers), again.left) == ({}, 1)  # a log is checked once


@pytest.mark.large
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
