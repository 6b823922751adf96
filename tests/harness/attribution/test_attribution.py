"""Causes of failures, found in episodes with one known fault."""

import shutil
from pathlib import Path

import pytest

from tests.tools.faults.fault_scenarios import FAULTS
from wayproof.harness.attribution import CAUSES, find_cause, read_case
from wayproof.harness.attribution import contact as contacts
from wayproof.harness.attribution import standstill as standstills
from wayproof.harness.attribution.standstill import lacks_time
from wayproof.harness.counterfactual.check import check
from wayproof.harness.counterfactual.verdict import read_check, record_check
from wayproof.harness.log.reader import open_log


def test_every_cause_has_a_test_of_facts_and_a_planted_fault():
    """Those of a stack on trial are found where it is called, see tests/harness/interface."""
    tested = {name for name, _ in (*contacts.TESTS, *standstills.TESTS)}
    on_trial = {"plugin_failed", "stack_held", "exploration"}
    assert tested == set(CAUSES)
    assert len(CAUSES) == 18
    assert tested - on_trial == {*FAULTS, "unexplained"}


@pytest.mark.parametrize("cause", FAULTS)
def test_planted_causes_are_found(planted, cause):
    _, result = planted(cause, 0)
    assert result.cause == cause, result.cause_evidence


def test_the_cause_in_a_log_is_that_found_at_run_time(planted, tmp_path):
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


def test_a_blocked_path_lacks_space_and_not_time(planted):
    path, _ = planted("impossible", 0)
    assert not lacks_time(read_case(open_log(path)))


def test_a_success_has_no_cause(recorded):
    result = recorded("empty", "drone", 1)
    assert result.outcome == "success"
    assert (result.cause, result.contact, result.cause_decision) == ("", "", -1)
    case = read_case(open_log(Path(result.log)))
    assert find_cause(case) is None
