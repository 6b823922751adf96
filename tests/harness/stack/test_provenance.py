"""Episodes with a prior map: what it may do, what the log says of it, and what the audit finds."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from tests.harness.replay.episodes import committed_of
from wayproof.harness.cli.main import main
from wayproof.harness.config_document import override
from wayproof.harness.errors import InputError
from wayproof.harness.geometry import polyline_length
from wayproof.harness.log.codec.messages import read_messages
from wayproof.harness.log.reader import open_log
from wayproof.harness.metrics import score
from wayproof.harness.replay.audit import audit
from wayproof.harness.replay.audit.run import judge
from wayproof.harness.replay.replay import replay
from wayproof.harness.replay.what_if import what_if
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.harness.stack.build import build_navigator
from wayproof.harness.stack.provenance import places_along
from wayproof.harness.trace import read_trace
from wayproof.planners import arc_lengths, point_at

SHORT = "episode.time_limit=5"
TRUTH = "prior.source=truth"


def decisions(result):
    return [one for one in read_messages(Path(result.log)) if isinstance(one, pb.Decision)]


def test_a_prior_that_is_ignored_changes_no_decision(recorded):
    robot = "drone"
    plain = recorded("warehouse", robot, 1, SHORT)
    ignored = recorded("warehouse", robot, 1, SHORT, TRUTH, "prior.policy=ignore")
    assert ignored.chain == plain.chain
    assert not any(one.HasField("global_evidence") for one in decisions(ignored))


def test_a_guide_changes_paths_and_admits_nothing(recorded):
    robot = "drone"
    result = recorded("warehouse", robot, 1, SHORT, TRUTH)
    assert result.chain != recorded("warehouse", robot, 1, SHORT).chain
    found = audit(Path(result.log))
    assert found.violations == ()
    assert found.swept > 30
    stated = decisions(result)
    assert all(one.HasField("global_evidence") for one in stated)
    assert max(one.global_evidence.prior_m for one in stated) > 3.0
    assert all(one.committed_evidence.prior_m == 0.0 for one in stated if one.action == "follow")
    figures = score(read_trace(open_log(Path(result.log))))
    assert figures["unmeasured_share"] == 0.0
    assert 0.2 < figures["guided_share"] < 1.0


def test_a_prior_that_admits_is_found_by_the_audit_of_what_was_measured(recorded):
    log = Path(recorded("warehouse", "drone", 1, SHORT, TRUTH, "prior.policy=admit").log)
    found = audit(log)
    assert found.violations == ()
    broken = audit(log, measured_only=True)
    assert "swept" in broken.rules
    assert all("unknown" in one.text for one in broken.violations if one.rule == "swept")
    assert score(read_trace(open_log(log)))["unmeasured_share"] > 0.05


@pytest.mark.parametrize(("robot", "policy"), [("quadruped", "guide"), ("drone", "admit")])
def test_a_log_replays_from_its_own_cells(recorded, robot, policy):
    log = Path(recorded("warehouse", robot, 1, SHORT, TRUTH, f"prior.policy={policy}").log)
    assert replay(log).identical


def test_an_episode_with_a_prior_is_verified_by_simulation(recorded):
    log = recorded("warehouse", "drone", 1, SHORT, TRUTH).log
    assert main(["verify", log]) == 0


@pytest.fixture(scope="module")
def moment(recorded):
    """A decision under a guide that sets out on a path."""
    log = open_log(Path(recorded("warehouse", "quadruped", 1, SHORT, TRUTH).log))
    for one in committed_of(log):
        if one.decision.action == "follow" and one.decision.committed_evidence.measured_m > 1.0:
            return one
    raise AssertionError("no decision sets out")


def rests_on_the_prior(decision):
    evidence = decision.committed_evidence
    evidence.prior_m, evidence.measured_m = evidence.measured_m, 0.0


def rests_on_less(decision):
    decision.committed_evidence.measured_m -= 0.9


def states_nothing(decision):
    decision.ClearField("committed_evidence")


@pytest.mark.parametrize("change", [rests_on_the_prior, rests_on_less, states_nothing])
def test_a_planted_length_by_provenance_is_found(moment, change):
    assert judge(moment)[1] == []
    changed = pb.Decision()
    changed.CopyFrom(moment.decision)
    change(changed)
    record = dataclasses.replace(moment.record, decision=changed)
    found = judge(dataclasses.replace(moment, record=record))[1]
    assert {one.rule for one in found} == {"evidence"}


def test_a_policy_planted_in_a_log_that_admitted_is_found(recorded):
    """The log of a stack that was let into the prior's free space, said to be one of a guide."""
    log = open_log(Path(recorded("warehouse", "drone", 1, SHORT, TRUTH, "prior.policy=admit").log))
    guide = dataclasses.replace(log.config.prior, policy="guide")
    lied = dataclasses.replace(log, config=dataclasses.replace(log.config, prior=guide))
    rules = {one.rule for each in committed_of(lied) for one in judge(each)[1]}
    assert {"swept", "evidence"} <= rules


def test_the_policy_can_be_asked_what_if_and_the_place_cannot(recorded):
    log = Path(recorded("warehouse", "drone", 1, SHORT, TRUTH).log)
    answer = what_if(log, ["prior.policy=admit"])
    assert answer.faithful
    assert answer.changes
    with pytest.raises(InputError, match=r"expected prior\.policy"):
        what_if(log, ["prior.x=0.5"])


def test_cells_that_are_none_are_refused(recorded):
    log = open_log(Path(recorded("warehouse", "drone", 1, SHORT, TRUTH).log))
    for data, text in ((b"", "where no prior map is read"), (b"thing", "cells of a prior map")):
        config = dataclasses.replace(log.config, prior_map=data)
        with pytest.raises(InputError, match=text):
            build_navigator(config, log.mission, log.beams)


def test_the_card_of_a_decision_says_what_its_paths_rest_on(recorded, capsys):
    result = recorded("warehouse", "drone", 1, SHORT, TRUTH)
    number = next(one.sequence for one in decisions(result) if one.global_evidence.prior_m > 3.0)
    assert main(["explain", result.log, str(number)]) == 0
    shown = " ".join(capsys.readouterr().out.split())
    for text in ("prior map truth, guide", "committed rests on", "m measured", "m prior"):
        assert text in shown


@pytest.mark.large
def test_occupied_cells_of_a_prior_turn_the_path_until_they_are_measured_away(recorded):
    """All doorways of the prior are closed: it finds no way, so the search goes on without it."""
    closed = 'perturbation={"kind": "stale_prior", "severity": 5, "mode": "doors"}'
    result = recorded("warehouse", "drone", 1, TRUTH, closed)
    assert result.outcome == "success"
    first = decisions(result)[5:15]
    assert all(len(one.global_path) for one in first if one.action == "follow")
    assert audit(Path(result.log)).violations == ()


def test_settings_are_checked_within_their_bounds(recorded):
    config = open_log(Path(recorded("warehouse", "drone", 1, SHORT, TRUTH).log)).config
    assert np.isfinite(config.prior.yaw)
    for setting in ("prior.policy=believe", "prior.yaw=4", "prior.x=nan", "prior.up=w"):
        with pytest.raises(InputError, match="prior"):
            override(config, [setting])


def test_places_along_a_path_are_those_of_each_arc_length():
    rng = np.random.default_rng(5)
    for count in (2, 3, 40):
        path = np.round(rng.normal(size=(count, 3)).cumsum(axis=0), 2)
        path = np.repeat(path, rng.integers(1, 3, count), axis=0)
        beyond = polyline_length(path) + 1.0
        s = np.concatenate([arc_lengths(path), rng.uniform(0.0, beyond, 50)])
        each = np.stack([point_at(path, one) for one in s.tolist()])
        assert places_along(path, s).tobytes() == each.tobytes()
