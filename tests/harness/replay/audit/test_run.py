"""Audits of real episodes, and of decisions with one planted fault."""

import dataclasses
import json
from pathlib import Path

import numpy as np
import pytest

from tests.harness.replay.episodes import committed_of
from wayproof.harness.cli.main import main
from wayproof.harness.decision import chain_hash
from wayproof.harness.log.codec.container import walk
from wayproof.harness.log.codec.messages import read_messages
from wayproof.harness.log.copy import write_copy
from wayproof.harness.log.head import read_head
from wayproof.harness.log.reader import open_log
from wayproof.harness.replay.audit import audit
from wayproof.harness.replay.audit.run import judge
from wayproof.harness.replay.audit.way import judge_way
from wayproof.harness.schema import wayproof_pb2 as pb

SHORT = "episode.time_limit=8"


@pytest.mark.parametrize(("robot", "seed"), [("quadruped", 1), ("drone", 24)])
def test_real_episodes_break_no_rule(recorded, robot, seed):
    found = audit(Path(recorded("warehouse", robot, seed, SHORT).log))
    assert found.violations == ()
    assert found.policy == "forbid"
    assert found.decisions > 70
    assert found.swept > 50
    assert 0.0 <= found.filtered.filtered_m < 0.5 * found.filtered.way_m


@pytest.mark.parametrize("policy", ["allow", "forbid"])
def test_what_was_not_measured_may_be_entered_where_the_policy_admits_it(recorded, policy):
    settings = ("prior.source=truth", f"costmap.unknown_policy={policy}")
    log = Path(recorded("empty", "drone", 1, *settings).log)
    found = audit(log)
    assert found.violations == ()
    assert ("evidence" in audit(log, "forbid").rules) == (policy != "forbid")


def test_the_command_prints_the_broken_rules(recorded, capsys):
    log = recorded("warehouse", "drone", 1, SHORT, "costmap.unknown_policy=allow").log
    assert main(["audit", log]) == 0
    assert "no violation" in capsys.readouterr().out
    assert main(["audit", log, "--policy", "forbid", "--json"]) == 1
    document = json.loads(capsys.readouterr().out)
    assert document["violations"][0]["rule"] == "swept"
    assert main(["audit", "nothing.mcap"]) == 2


@pytest.fixture(scope="module")
def moment(recorded):
    """A decision of a real log on whose way the body moves at more than half a metre a second."""
    log = open_log(Path(recorded("warehouse", "quadruped", 1, SHORT).log))
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


def nothing(decision):
    del decision


def another_map(decision):
    decision.map_version = "0" * 32


def through_the_wall(decision):
    for k, point in enumerate(decision.trajectory.path):
        point.y += 0.1 * k


def recovers_into_the_wall(decision):
    decision.action = "recover"
    through_the_wall(decision)


def stops_in_the_wall(decision):
    decision.action = "stop_and_wait"
    through_the_wall(decision)


def never_at_rest(decision):
    for samples in (decision.trajectory.arc_length, decision.trajectory.heading):
        del samples[len(samples) // 2 :]


def beyond_its_path(decision):
    decision.trajectory.arc_length[-1] += 0.05


def too_fast(decision):
    samples = decision.trajectory.arc_length
    for k, arc in enumerate(samples):
        samples[k] = 3.0 * arc


def without_headings(decision):
    del decision.trajectory.heading[:]


def with_a_heading_less(decision):
    del decision.trajectory.heading[-1]


def without_a_path(decision):
    del decision.trajectory.path[:]


def far_away(decision):
    decision.trajectory.path[-1].x = 1e9


def from_before(decision):
    decision.trajectory.start.FromNanoseconds(0)


def stands_at_once(decision):
    for k in range(len(decision.trajectory.arc_length)):
        decision.trajectory.arc_length[k] = 0.0


def arrived_in_motion(decision):
    decision.action = "goal"


def gives_up_in_motion(decision):
    decision.action = "abort"


def another_margin(decision):
    decision.localization_margin_m = 0.0


def a_smaller_inflation(decision):
    decision.collision_distance_sq -= 1


def another_policy(decision):
    decision.unknown_policy = "allow"


def another_resolution(decision):
    decision.resolution_m = 0.05


def another_map_kind(decision):
    decision.representation = "octomap"


def a_longer_deadline(decision):
    decision.deadline_s = 9.0


def says_it_was_late(decision):
    decision.deadline_missed = True


def sooner_than_it_was(decision):
    decision.delay_s = 0.0


def from_another_pose(decision):
    decision.position[0] += 1e-9


def surer_than_it_was(decision):
    decision.position_sigma = 0.0


def of_other_inputs(decision):
    decision.input_digest = "0" * 32


def with_fresher_evidence(decision):
    decision.evidence_age_s -= 0.5


def with_a_longer_path(decision):
    decision.committed_length_m += 0.01


def with_more_room(decision):
    decision.least_clearance_m += 0.11


def from_elsewhere(decision):
    decision.trajectory.path[0].x += 0.3


def runs_backwards(decision):
    samples = decision.trajectory.arc_length
    samples.extend(reversed(list(samples)[len(samples) // 2 :]))
    decision.trajectory.heading.extend(list(decision.trajectory.heading)[len(samples) // 2 :])
    del decision.trajectory.heading[len(samples) :]


def begins_further_on(decision):
    samples = decision.trajectory.arc_length
    for k, arc in enumerate(samples):
        samples[k] = min(arc + 0.5, samples[-1])


def at_another_pace(decision):
    decision.trajectory.sample_period_s = 0.2


def the_other_way_round(decision):
    for k, heading in enumerate(decision.trajectory.heading):
        decision.trajectory.heading[k] = heading + np.pi


def spins(decision):
    for k, heading in enumerate(decision.trajectory.heading):
        decision.trajectory.heading[k] = heading + 7.0 * k


def in_cells_of_no_size(decision):
    decision.resolution_m = np.nan


@pytest.mark.parametrize(
    ("change", "rules"),
    [
        (nothing, set()),
        (runs_backwards, {"form"}),
        (begins_further_on, {"joined"}),
        (at_another_pace, {"form"}),
        (the_other_way_round, {"joined"}),
        (spins, {"limits"}),
        (in_cells_of_no_size, {"settings"}),
        (another_map, {"version"}),
        (through_the_wall, {"swept"}),
        (recovers_into_the_wall, {"recover"}),
        (stops_in_the_wall, {"swept"}),
        (never_at_rest, {"rest"}),
        (beyond_its_path, {"rest"}),
        (too_fast, {"limits", "rest"}),
        (from_elsewhere, {"joined"}),
        (without_headings, {"form"}),
        (with_a_heading_less, {"form"}),
        (without_a_path, {"form"}),
        (far_away, {"form"}),
        (stands_at_once, {"joined"}),
        (from_before, {"joined"}),
        (arrived_in_motion, {"rest"}),
        (gives_up_in_motion, {"rest"}),
        (another_margin, {"margin"}),
        (a_smaller_inflation, {"margin"}),
        (another_policy, {"settings"}),
        (another_resolution, {"settings"}),
        (another_map_kind, {"settings"}),
        (a_longer_deadline, {"settings"}),
        (says_it_was_late, {"deadline"}),
        (sooner_than_it_was, {"inputs"}),
        (from_another_pose, {"inputs"}),
        (surer_than_it_was, {"inputs"}),
        (of_other_inputs, {"inputs"}),
        (with_fresher_evidence, {"figure"}),
        (with_a_longer_path, {"figure"}),
        (with_more_room, {"figure"}),
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


FORGERIES = {
    "margin": another_margin,
    "deadline": says_it_was_late,
    "settings": another_policy,
}


@pytest.mark.parametrize("rule", list(FORGERIES))
def test_a_log_forged_throughout_with_a_chain_that_holds_is_found(recorded, tmp_path, rule):
    source = Path(recorded("corridor", "quadruped", 1, "episode.time_limit=2").log)
    clean = audit(source)
    assert clean.violations == ()
    forged = tmp_path / "forged.mcap"
    forge(source, forged, FORGERIES[rule])
    found = audit(forged)
    assert found.rules[rule] == found.decisions
    assert set(found.rules) <= {rule, "reason"}  # a reason's figures rest on the margin
    assert found.swept == clean.swept > 0


def forge(source, target, change):
    """A log with each decision changed, and every hash over them as it would be."""
    messages, chain = [], ""
    for message in read_messages(source):
        if isinstance(message, pb.Decision):
            change(message)
            chain = message.chain = chain_hash(message, chain)
        messages.append(message)
    head = read_head(walk(source, head_only=True), source, allow_plugins=False)
    write_copy(target, head, messages, {**open_log(source).result, "chain": chain})


def trajectory(way, arcs):
    return pb.Trajectory(
        path=[pb.Point(x=x, y=y, z=z) for x, y, z in way],
        arc_length=arcs,
        heading=np.zeros(len(arcs)),
        sample_period_s=0.1,
    )
