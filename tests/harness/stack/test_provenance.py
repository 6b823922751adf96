"""Episodes with a prior map: what it may do, what the log says of it, and what the audit finds."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from tests.harness.replay.episodes import committed_of
from wayproof.harness.cli.main import main
from wayproof.harness.config import Config
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
from wayproof.harness.scenario.scenario import build
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.harness.stack.build import build_navigator
from wayproof.harness.stack.provenance import places_along
from wayproof.harness.trace import read_trace
from wayproof.planners import arc_lengths, point_at

SHORT = "episode.time_limit=3"
TRUTH = "prior.source=truth"
GUESS, NO_GUESS = "prediction.source=completion", "prediction.policy=ignore"


def decisions(result):
    return [one for one in read_messages(Path(result.log)) if isinstance(one, pb.Decision)]


@pytest.mark.parametrize("ignored", [(TRUTH, "prior.policy=ignore"), (GUESS, NO_GUESS)])
def test_what_is_ignored_changes_no_decision(recorded, ignored):
    result = recorded("warehouse", "drone", 1, SHORT, *ignored)
    assert result.chain == recorded("warehouse", "drone", 1, SHORT).chain
    assert not any(one.HasField("global_evidence") for one in decisions(result))


def test_a_guide_changes_paths_and_admits_nothing(recorded):
    result = recorded("warehouse", "drone", 1, SHORT, TRUTH)
    assert result.chain != recorded("warehouse", "drone", 1, SHORT).chain
    stated = decisions(result)
    assert all(one.HasField("global_evidence") for one in stated)
    assert max(one.global_evidence.prior_m for one in stated) > 3.0
    assert all(one.committed_evidence.prior_m == 0.0 for one in stated if one.action == "follow")
    figures = score(read_trace(open_log(Path(result.log))))
    assert figures["unmeasured_share"] == 0.0
    assert 0.2 < figures["guided_share"] < 1.0
    assert main(["verify", result.log]) == 0


@pytest.mark.parametrize(
    ("robot", "settings"), [("quadruped", (GUESS,)), ("drone", (GUESS, TRUTH))]
)
def test_predictions_guide_below_a_prior_map_and_admit_nothing(recorded, robot, settings):
    log = Path(recorded("warehouse", robot, 1, SHORT, *settings).log)
    found = audit(log)
    assert (found.violations, found.swept > 15) == ((), True)
    stated = [one.global_evidence for one in open_log(log).decisions()]
    most = {kind: max(getattr(one, kind) for one in stated) for kind in ("prior_m", "predicted_m")}
    if TRUTH in settings:
        assert most["prior_m"] > 3.0
    else:
        assert most["prior_m"] == 0.0 < most["predicted_m"]
        assert replay(log).identical


def test_a_prior_that_admits_is_found_by_the_audit_of_what_was_measured(recorded):
    log = Path(recorded("warehouse", "drone", 1, SHORT, TRUTH, "prior.policy=admit").log)
    found = audit(log)
    assert found.violations == ()
    broken = audit(log, measured_only=True)
    assert "swept" in broken.rules
    assert all("unknown" in one.text for one in broken.violations if one.rule == "swept")
    assert score(read_trace(open_log(log)))["unmeasured_share"] > 0.05


@pytest.mark.parametrize(("measured", "prior"), [(0.0, 1.0), (-0.9, 0.0), (None, None)])
def test_a_planted_length_by_provenance_is_found(recorded, measured, prior):
    """All of it on the prior, less than it is, and none stated."""
    log = open_log(Path(recorded("warehouse", "quadruped", 1, SHORT, TRUTH).log))
    moment = next(
        one for one in committed_of(log)
        if one.decision.action == "follow" and one.decision.committed_evidence.measured_m > 1.0
    )  # fmt: skip
    assert judge(moment)[1] == []
    changed = pb.Decision()
    changed.CopyFrom(moment.decision)
    evidence = changed.committed_evidence
    if measured is None:
        changed.ClearField("committed_evidence")
    elif prior:
        evidence.prior_m, evidence.measured_m = evidence.measured_m, measured
    else:
        evidence.measured_m += measured
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


def test_a_completion_for_other_cells_is_refused():
    scenario = build(override(Config("empty", "drone", 1), [GUESS, "map.resolution=0.2"]))
    with pytest.raises(InputError, match=r"for cells of 0\.1 m"):
        build_navigator(scenario.config, scenario.mission, {})


def test_places_along_a_path_are_those_of_each_arc_length():
    rng = np.random.default_rng(5)
    for count in (2, 3, 40):
        path = np.round(rng.normal(size=(count, 3)).cumsum(axis=0), 2)
        path = np.repeat(path, rng.integers(1, 3, count), axis=0)
        beyond = polyline_length(path) + 1.0
        s = np.concatenate([arc_lengths(path), rng.uniform(0.0, beyond, 50)])
        each = np.stack([point_at(path, one) for one in s.tolist()])
        assert places_along(path, s).tobytes() == each.tobytes()
