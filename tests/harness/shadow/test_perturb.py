"""Exactly one assumption off, on recorded input."""

import pytest

from tests.harness.shadow.conftest import FR079, shadowed
from wayproof.harness.errors import InputError
from wayproof.harness.log.reader import open_log
from wayproof.harness.log.streams import _streams
from wayproof.harness.perturbations import PERTURBATIONS, perturbation_from
from wayproof.harness.perturbations.outage import Outage
from wayproof.harness.replay.replay import replay

NOT_RECORDED = ("world", "motion_sensors", "prior")

ON_RECORDINGS = [kind for kind, one in PERTURBATIONS.items() if one.changes not in NOT_RECORDED]


@pytest.fixture(scope="module")
def clean(robot, tmp_path_factory):
    path = tmp_path_factory.mktemp("clean") / "clean.mcap"
    return shadowed(FR079, robot, path, end=1.0)


def hashes(log):
    return {one.name: one.hash for one in list(_streams(log))[-1].streams}


@pytest.mark.few(6)
@pytest.mark.parametrize("kind", ON_RECORDINGS)
def test_only_the_declared_streams_change_and_the_log_replays(kind, clean, robot, tmp_path):
    perturbation = perturbation_from(f"{kind}:5")
    if kind == "pose_jump" or isinstance(perturbation, Outage):
        perturbation = type(perturbation)(severity=5, window=(0.3, 10.0))
    log = shadowed(FR079, robot, tmp_path / "one.mcap", end=1.0, perturbation=perturbation, seed=1)
    before, after = hashes(clean), hashes(log)
    changed = {name for name in before if before[name] != after[name]}
    assert changed == set(perturbation.streams(["FLASER"]))
    assert replay(log).identical


def test_the_recorded_motion_stays_as_it_was(clean, robot, tmp_path):
    drift = perturbation_from("pose_drift:5")
    log = shadowed(FR079, robot, tmp_path / "drift.mcap", end=1.0, perturbation=drift)
    assert [one.position for one in open_log(log).motions()] == [
        one.position for one in open_log(clean).motions()
    ]


@pytest.mark.parametrize(
    ("perturbation", "why"),
    [("motion:3", "changes the world"), ("stale_prior:3", "changes the prior map")],
)
def test_what_a_recording_does_not_have_cannot_be_changed(robot, tmp_path, perturbation, why):
    with pytest.raises(InputError, match=why):
        shadowed(
            FR079,
            robot,
            tmp_path / "no.mcap",
            end=1.0,
            perturbation=perturbation_from(perturbation),
        )
