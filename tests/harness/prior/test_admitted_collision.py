"""A collision that a stale prior map admits: planted, its cause, and the check of the cause."""

import re

import pytest

from wayproof.harness.attribution import read_case
from wayproof.harness.attribution.procedure import find_cause
from wayproof.harness.config import Config
from wayproof.harness.config_document import override, with_perturbation
from wayproof.harness.counterfactual.check import check
from wayproof.harness.log.reader import open_log
from wayproof.harness.perturbations import perturbation_from
from wayproof.harness.runner import run_episode
from wayproof.harness.scenario.scenario import build

NEAR_IS_UNKNOWN = (
    "prior.source=truth",
    "map.minimum_range=4",
    "motion.limits=cautious",
    "episode.time_limit=4.0",
)


def run(policy, path):
    """Run in a maze whose partitions have moved since the prior map, of which near ones are unseen.

    So the robot enters what nothing measured, or not at all.
    """
    config = override(Config("maze", "drone", 0), [*NEAR_IS_UNKNOWN, f"prior.policy={policy}"])
    perturbed = with_perturbation(config, perturbation_from("stale_prior:5:moved"))
    return run_episode(build(perturbed), path)


@pytest.fixture(scope="module")
def admitted(tmp_path_factory):
    path = tmp_path_factory.mktemp("admitted") / "a.mcap"
    assert run("admit", path).outcome == "collision"
    return open_log(path)


def test_the_cause_counts_the_cells_that_the_prior_map_let_the_robot_into(admitted):
    finding = find_cause(read_case(admitted))
    assert finding.cause == "unseen_obstacle"
    unknown, prior = map(
        int,
        re.fullmatch(
            r"(\d+) of \d+ cells before partition_\d+ were unknown at decision \d+, and (\d+) of "
            r"these free in the prior map, which let the robot in",
            finding.evidence,
        ).groups(),
    )
    assert 0 < prior <= unknown


def test_the_check_takes_the_admission_back(admitted):
    finding = find_cause(read_case(admitted))
    verdict = check(admitted, finding, thorough=False)
    assert verdict.answer == "confirmed"
    assert [one.remedy for one in verdict.checks if one.saves] == ["forbidden_unknown"]


def test_a_map_that_does_not_admit_costs_no_collision(tmp_path):
    assert run("guide", tmp_path / "a.mcap").outcome in ("timeout", "success")
