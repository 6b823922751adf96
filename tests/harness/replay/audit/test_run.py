"""Audits of real episodes, and of decisions with one planted fault."""

import dataclasses
import json
from pathlib import Path

import numpy as np
import pytest

from tests.harness.replay.episodes import SHORT, committed_of
from tests.harness.replay.forgeries import Forgery
from wayproof.harness.cli.main import main
from wayproof.harness.log.reader import open_log
from wayproof.harness.replay.audit import audit
from wayproof.harness.replay.audit.run import judge
from wayproof.harness.replay.audit.way import judge_way
from wayproof.harness.schema import wayproof_pb2 as pb

FEW = "episode.time_limit=5"


@pytest.mark.few(1)
@pytest.mark.parametrize(("robot", "seed"), [("quadruped", 1), ("drone", 24)])
def test_real_episodes_break_no_rule(recorded, robot, seed):
    found = audit(Path(recorded("warehouse", robot, seed, FEW).log))
    assert found.violations == ()
    assert found.policy == "forbid"
    assert found.decisions > 45
    assert found.swept > 30
    assert 0.0 <= found.filtered.filtered_m < 0.5 * found.filtered.way_m


def test_what_was_not_measured_may_be_entered_where_the_policy_admits_it(recorded):
    settings = "prior.source=truth", "costmap.unknown_policy=allow", "episode.time_limit=3"
    log = Path(recorded("empty", "drone", 1, *settings).log)
    assert audit(log).violations == ()
    assert "evidence" in audit(log, "forbid").rules


def test_the_command_prints_the_broken_rules(recorded, capsys):
    settings = "costmap.unknown_policy=allow", "episode.time_limit=3"
    log = recorded("warehouse", "drone", 1, *settings).log
    assert main(["audit", log]) == 0
    assert "no violation" in capsys.readouterr().out
    assert main(["audit", log, "--policy", "forbid", "--json"]) == 1
    document = json.loads(capsys.readouterr().out)
    assert document["violations"][0]["rule"] == "swept"
    assert main(["audit", "nothing.mcap"]) == 2


@pytest.fixture(scope="module")
def moment(recorded):
    """A decision of a real log on whose way the body moves at more than half a metre a second."""
    log = open_log(Path(recorded("warehouse", "quadruped", 1, FEW).log))
    for one in committed_of(log):
        trajectory = one.decision.trajectory
        arcs = trajectory.arc_length
        half = len(arcs) // 2
        long = min(len(trajectory.path), len(arcs)) > 20
        if one.decision.action in ("follow", "explore") and long:
            if min(arcs[1] - arcs[0], arcs[half] - arcs[half - 1]) > 0.05:
                return one
    raise AssertionError("no decision of the log is one to plant faults in")


@pytest.fixture
def checked(moment):
    """Check the decision after something was done to it."""

    def check(change):
        changed = pb.Decision()
        changed.CopyFrom(moment.decision)
        change(changed)
        record = dataclasses.replace(moment.record, decision=changed)
        return {one.rule for one in judge(dataclasses.replace(moment, record=record))[1]}

    return check


def given(**fields):
    """Give fields of a decision other values."""

    def change(decision):
        for name, value in fields.items():
            setattr(decision, name, value)

    return change


def added(**fields):
    """Add to figures of a decision."""
    return lambda decision: given(
        **{name: getattr(decision, name) + value for name, value in fields.items()}
    )(decision)


def samples(name, law):
    """Make the samples of a trajectory again by a law of their number and value."""

    def change(decision):
        found = getattr(decision.trajectory, name)
        found[:] = [law(k, one) for k, one in enumerate(list(found))]

    return change


def through_the_wall(decision):
    for k, point in enumerate(decision.trajectory.path):
        point.y += 0.1 * k


def never_at_rest(decision):
    for found in (decision.trajectory.arc_length, decision.trajectory.heading):
        del found[len(found) // 2 :]


def beyond_its_path(decision):
    decision.trajectory.arc_length[-1] += 0.05


def with_a_heading_less(decision):
    del decision.trajectory.heading[-1]


def without_a_path(decision):
    del decision.trajectory.path[:]


def far_away(decision):
    decision.trajectory.path[-1].x = 1e9


def from_before(decision):
    decision.trajectory.start.FromNanoseconds(0)


def from_another_pose(decision):
    decision.position[0] += 1e-9


def from_elsewhere(decision):
    decision.trajectory.path[0].x += 0.3


def runs_backwards(decision):
    arcs, headings = decision.trajectory.arc_length, decision.trajectory.heading
    arcs.extend(reversed(list(arcs)[len(arcs) // 2 :]))
    headings.extend(list(headings)[len(arcs) // 2 :])
    del headings[len(arcs) :]


def at_another_pace(decision):
    decision.trajectory.sample_period_s = 0.2


def and_then(first, second):
    return lambda decision: (first(decision), second(decision))


@pytest.mark.parametrize(
    ("change", "rules"),
    [
        (given(), set()),
        (runs_backwards, {"form"}),
        (samples("arc_length", lambda k, arc: arc + 0.5), {"joined"}),
        (at_another_pace, {"form"}),
        (samples("heading", lambda k, heading: heading + np.pi), {"joined"}),
        (samples("heading", lambda k, heading: heading + 7.0 * k), {"limits"}),
        (given(resolution_m=np.nan), {"settings"}),
        (given(map_version="0" * 32), {"version"}),
        (through_the_wall, {"swept"}),
        (and_then(given(action="recover"), through_the_wall), {"recover"}),
        (and_then(given(action="stop_and_wait"), through_the_wall), {"swept"}),
        (never_at_rest, {"rest"}),
        (beyond_its_path, {"rest"}),
        (samples("arc_length", lambda k, arc: 3.0 * arc), {"limits", "rest"}),
        (from_elsewhere, {"joined"}),
        (with_a_heading_less, {"form"}),
        (without_a_path, {"form"}),
        (far_away, {"form"}),
        (samples("arc_length", lambda k, arc: 0.0), {"joined"}),
        (from_before, {"joined"}),
        (given(action="goal"), {"rest"}),
        (given(action="abort"), {"rest"}),
        (given(localization_margin_m=0.0), {"margin"}),
        (added(collision_distance_sq=-1), {"margin"}),
        (given(unknown_policy="allow"), {"settings"}),
        (given(resolution_m=0.05), {"settings"}),
        (given(representation="octomap"), {"settings"}),
        (given(deadline_s=9.0), {"settings"}),
        (given(deadline_missed=True), {"deadline"}),
        (given(delay_s=0.0), {"inputs"}),
        (from_another_pose, {"inputs"}),
        (given(position_sigma=0.0), {"inputs"}),
        (given(input_digest="0" * 32), {"inputs"}),
        (added(evidence_age_s=-0.5), {"figure"}),
        (added(committed_length_m=0.01), {"figure"}),
        (added(least_clearance_m=0.11), {"figure"}),
    ],
)
def test_each_planted_fault_is_found(checked, change, rules):
    assert rules <= checked(change)
    assert bool(rules) == bool(checked(change))


def test_a_late_decision_leaves_the_trajectory_before_it(moment):
    record = dataclasses.replace(moment.record, latency=pb.Latency(delay_s=0.3))
    late = dataclasses.replace(moment, record=record)
    assert {one.rule for one in judge(late)[1]} == {"inputs", "deadline"}

    decision = pb.Decision()
    decision.CopyFrom(moment.decision)
    decision.delay_s, decision.deadline_missed = 0.3, True
    decision.action = "stop_and_wait"
    late = dataclasses.replace(moment, record=dataclasses.replace(record, decision=decision))
    assert {one.text for one in judge(late)[1] if one.rule == "deadline"} == {
        "late, but another trajectory than the last one"
    }
    decision.trajectory.CopyFrom(moment.before[-1])
    late = dataclasses.replace(moment, record=late.record)
    assert judge_way(late).kind == "late"
    assert {one.rule for one in judge(late)[1]} <= {"figure"}  # its length is not filled in
    assert late.keeps_trajectory
    late.decision.trajectory.sample_period_s = 0.2
    assert not dataclasses.replace(late).keeps_trajectory


@pytest.mark.parametrize(
    ("rule", "change"),
    [
        ("margin", {"localization_margin_m": 0.0}),
        ("deadline", {"deadline_missed": True}),
        ("settings", {"unknown_policy": "allow"}),
    ],
)
def test_a_log_forged_throughout_with_a_chain_that_holds_is_found(recorded, tmp_path, rule, change):
    source = Path(recorded(*SHORT["quadruped"]).log)
    clean = audit(source)
    assert clean.violations == ()
    forgery = Forgery(source)
    for decision in forgery.each(pb.Decision):
        given(**change)(decision)
    found = audit(forgery.write(tmp_path / "forged.mcap"))
    assert found.rules[rule] == found.decisions
    assert set(found.rules) <= {rule, "reason"}  # a reason's figures rest on the margin
    assert found.swept == clean.swept > 0
