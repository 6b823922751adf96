"""Checks of stacks on trial: by the guard from the log alone, and with the stack itself."""

from dataclasses import replace
from pathlib import Path

import pytest

from wayproof.harness.attribution import find_cause, read_case
from wayproof.harness.attribution.commanded import commands_to
from wayproof.harness.attribution.finding import Finding
from wayproof.harness.cli.main import main
from wayproof.harness.counterfactual.check import check
from wayproof.harness.counterfactual.guard import settle_by_guard
from wayproof.harness.counterfactual.verdict import Check, read_check, record_check
from wayproof.harness.errors import InputError
from wayproof.harness.log.reader import open_log

BLIND = ("cylinders", "drone", 0, "stack.name=blind")


@pytest.mark.parametrize(
    ("cause", "guard_saves", "answer", "note"),
    [
        ("disregarded_obstacle", True, "confirmed", ""),
        ("unseen_obstacle", True, "confirmed", ""),
        ("disregarded_obstacle", False, "inconclusive", "does not keep the robot from it"),
        ("missed_obstacle", True, "inconclusive", "which says nothing about missed_obstacle"),
        ("tracking", False, "inconclusive", "which says nothing about tracking"),
        ("disregarded_obstacle", None, "inconclusive", "ended as error, not as recorded"),
    ],
)
def test_the_guard_confirms_only_what_it_shows(cause, guard_saves, answer, note):
    finding = Finding(cause, "by its facts", 3, (0.0, 0.0, 0.0))
    control = "error" if guard_saves is None else "collision"
    checks = [Check("control", 2, control, 4.0, False)]
    if guard_saves is not None:
        checks.append(Check("guard", 2, "timeout", 9.0, guard_saves))
    given, why = settle_by_guard(finding, checks)
    assert given == answer
    assert note in why


def test_a_stop_within_the_inflation_takes_no_blame_off_what_led_there(recorded):
    """The stack rests a few centimetres from a wall, which sweeps nothing and is admitted."""
    stack = "stack.name=tests.harness.interface.stacks_on_trial:ToTheWall"
    log = open_log(Path(recorded("empty", "drone", 1, stack, "episode.stuck_after=5").log), True)
    case = read_case(log)
    verdicts = [moment.decision.verdict.verdict for moment in case.moments]
    assert (case.outcome, verdicts[-1]) == ("collision", "admitted")
    finding = find_cause(case)
    assert finding.cause == "disregarded_obstacle"
    assert check(log, finding).answer == "confirmed"


def test_the_guard_brakes_at_the_first_command_that_led_to_the_contact(recorded, tmp_path, capsys):
    path = Path(recorded(*BLIND).log)
    log = open_log(path)
    case = read_case(log)
    first, *others = commands_to(case, case.end_s)
    verdicts = [moment.decision.verdict.verdict for moment in case.moments]
    assert "admitted" not in verdicts[first : others[-1] + 1]
    assert verdicts[first - 1] == "admitted"
    verdict = check(log, find_cause(case))
    assert [(one.remedy, one.begin, one.saves) for one in verdict.checks] == [
        ("control", first, False),
        ("guard", first, True),
    ]
    assert (verdict.finding.cause, verdict.answer) == ("disregarded_obstacle", "confirmed")
    copy = tmp_path / "copy.mcap"
    copy.write_bytes(path.read_bytes())
    record_check(copy, verdict)
    assert read_check(open_log(copy)) == verdict
    assert main(["explain", str(copy)]) == 0
    assert "disregarded_obstacle is confirmed; guard would have saved it" in capsys.readouterr().out


@pytest.mark.large
def test_the_stack_itself_goes_on_where_it_is_given(recorded):
    log = open_log(Path(recorded(*BLIND).log))
    finding = find_cause(read_case(log))
    verdict = check(log, finding, ("guard", "no_delay"), stack="blind")
    assert {one.remedy: one.saves for one in verdict.checks} == {
        "control": False, "guard": True, "no_delay": False,
    }  # fmt: skip
    assert (verdict.answer, verdict.note) == ("confirmed", "")
    other = check(log, finding, ("guard",), stack="gap")  # it passes by, so nothing is shown
    assert other.answer == "inconclusive"
    assert "answers before it differ from the recorded" in other.note
    with pytest.raises(InputError, match="--stack builtin, expected one of a stack on trial"):
        check(log, finding, stack="builtin")


@pytest.mark.few(1)
@pytest.mark.parametrize(
    ("settings", "note"),
    [
        (("episode.time_limit=1",), "the guard can only keep the robot from a contact"),
        (("stack.guard=true", "episode.stuck_after=2"), "the guard was on"),
    ],
)
def test_where_the_guard_shows_nothing_the_check_is_inconclusive(recorded, settings, note):
    log = open_log(Path(recorded(*BLIND, *settings).log))
    finding = find_cause(read_case(log))
    verdict = check(log, finding)
    assert (verdict.finding, verdict.answer, verdict.checks) == (finding, "inconclusive", ())
    assert verdict.note.startswith(note)


def test_a_stack_that_the_guard_holds_is_tried_without_it(recorded):
    settings = "stack.guard=true", "episode.stuck_after=2"
    log = open_log(Path(recorded(*BLIND, *settings).log))
    finding = find_cause(read_case(log))
    assert finding.cause == "stack_held"
    assert "blocked and 0 into unknown space" in finding.evidence
    alone = check(log, finding)
    assert (alone.finding, alone.answer) == (finding, "inconclusive")
    verdict = check(log, finding, ("no_guard",), stack="blind")
    assert [(one.remedy, one.outcome) for one in verdict.checks] == [
        ("control", "stuck"),
        ("no_guard", "collision"),
    ]
    assert (verdict.finding, verdict.answer) == (finding, "confirmed")


def test_commands_admitted_discarded_or_cut_did_not_lead_to_a_contact(recorded):
    case = read_case(open_log(Path(recorded(*BLIND).log)))
    led = commands_to(case, case.end_s)

    def changed(number, change):
        moments = list(case.moments)
        decision = type(moments[number].decision)()
        decision.CopyFrom(moments[number].decision)
        change(decision)
        moments[number] = replace(moments[number], decision=decision)
        return commands_to(replace(case, moments=tuple(moments)), case.end_s)

    middle = led[len(led) // 2]

    def admit(decision):
        decision.verdict.verdict = "admitted"

    def cut(decision):
        decision.verdict.cut = True

    def discard(decision):
        decision.deadline_missed = True

    assert changed(middle, admit) == changed(middle, cut) == led[len(led) // 2 + 1 :]
    assert changed(middle, discard) == tuple(number for number in led if number != middle)
    assert changed(led[-1], admit) == ()
