"""Episodes with predictions: they replay, guide and admit nothing."""

from pathlib import Path

import pytest

from wayproof.harness.config import Config
from wayproof.harness.config_document import override
from wayproof.harness.errors import InputError
from wayproof.harness.log.codec.messages import read_messages
from wayproof.harness.replay.audit import audit
from wayproof.harness.replay.replay import replay
from wayproof.harness.scenario.scenario import build
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.harness.stack.build import build_navigator

SHORT = "episode.time_limit=5"
COMPLETION = "prediction.source=completion"


def test_predictions_guide_and_admit_nothing(recorded):
    log = Path(recorded("warehouse", "quadruped", 1, SHORT, COMPLETION).log)
    found = audit(log)
    assert found.violations == ()
    stated = [one for one in read_messages(log) if isinstance(one, pb.Decision)]
    assert max(one.global_evidence.predicted_m for one in stated) > 0.0
    assert all(one.global_evidence.prior_m == 0.0 for one in stated)
    assert replay(log).identical


def test_a_prior_map_lies_above_predictions(recorded):
    log = Path(recorded("warehouse", "drone", 1, SHORT, COMPLETION, "prior.source=truth").log)
    stated = [one for one in read_messages(log) if isinstance(one, pb.Decision)]
    assert max(one.global_evidence.prior_m for one in stated) > 3.0
    assert audit(log).violations == ()


def test_predictions_that_are_ignored_change_no_decision(recorded):
    ignored = recorded("warehouse", "drone", 1, SHORT, COMPLETION, "prediction.policy=ignore")
    assert ignored.chain == recorded("warehouse", "drone", 1, SHORT).chain


def test_other_cells_and_other_names_are_refused():
    scenario = build(override(Config("empty", "drone", 1), [COMPLETION, "map.resolution=0.2"]))
    with pytest.raises(InputError, match=r"for cells of 0\.1 m"):
        build_navigator(scenario.config, scenario.mission, {})
    with pytest.raises(InputError, match=r"prediction\.source: got .oracle., expected"):
        override(Config("empty", "drone", 1), ["prediction.source=oracle"])
