"""What a study says where little or nothing was shown, and the exit code that goes with it."""

from __future__ import annotations

import dataclasses
import json
import math
import re
from pathlib import Path

import pytest

from tests.harness.study.here import ARM, HEAD, paired, row, written
from wayproof.harness.cli.main import main
from wayproof.harness.study.analysis import samples_between, samples_of
from wayproof.harness.study.contents import contents_of
from wayproof.harness.study.file import PACKAGED, files_of, read_study
from wayproof.harness.study.gate import read_gate
from wayproof.harness.study.gates import GateResult, gate_in_words, judge
from wayproof.harness.study.plan import Arm, plan_episodes
from wayproof.harness.study.result import StudyResult
from wayproof.harness.study.rows import Row
from wayproof.harness.study.store import Store
from wayproof.harness.study.study import conclude, verdict_in_words

GATED = 'seeds = 2\ngates = ["success.mean >= 0.1"]\n'


def judged(gate: str, rows: list[Row], time_limit: float = 60.0) -> GateResult:
    [result] = judge(samples_of(paired(rows)), [read_gate(gate)], time_limit)
    return result


def result_of(rows: list[Row], *gates: str) -> StudyResult:
    results = judge(samples_of(paired(rows)), [read_gate(one) for one in gates], 60.0)
    return StudyResult("hard", len(rows), 0, 0, "", [], results)


@pytest.mark.parametrize(
    "gate",
    [
        "collisions.mean <= 0",
        "collisions.mean <= 0.001 proven",
        "collisions.mean <= 1",
        "time_to_goal.mean <= 5.955 proven",
        "time_to_goal.mean <= 30",
        "success.mean >= 0.99",
        "jerk.mean <= 100",
    ],
)
@pytest.mark.parametrize("seeds", [1, 2, 3])
def test_two_episodes_prove_next_to_nothing(gate: str, seeds: int) -> None:
    rows = [row(k, time_to_goal=5.95, jerk=2.0) for k in range(seeds)]
    assert judged(gate, rows).verdict == "inconclusive"
    result = result_of(rows, gate)
    assert (result.verdict, result.exit_code()) == ("inconclusive", 3)
    assert result.exit_code(allow_inconclusive=True) == (3 if "proven" in gate else 0)


def test_a_single_collision_refutes_that_there_are_none() -> None:
    rows = [row(0), row(1, outcome="collision", collisions=1.0)]
    assert judged("collisions.mean <= 0", rows).verdict == "failed"
    assert result_of(rows, "collisions.mean <= 0").exit_code() == 1


@pytest.mark.parametrize(
    ("gate", "shown"), [("collisions.mean <= 0.1", "held"), ("success.mean >= 0.9", "held"),
                        ("collisions.mean >= 0.1", "failed"), ("success.mean <= 0.9", "failed")],
)  # fmt: skip
def test_no_event_in_enough_worlds_decides_a_margin(gate: str, shown: str) -> None:
    """A tenth on either side of the estimate, whichever side the gate is on."""
    few = judged(gate, [row(k) for k in range(20)])
    assert few.verdict == "inconclusive"
    assert few.worlds_needed == 36  # 0.9^35 = 0.02503, just more than 0.025
    assert f"about 36 worlds would show it {shown}" in gate_in_words(few)
    assert judged(gate, [row(k) for k in range(35)]).verdict == "inconclusive"
    assert judged(gate, [row(k) for k in range(36)]).verdict == shown


@pytest.mark.parametrize("bound", ["<= 0.3", ">= 0.3", "<= 0.7", ">= 0.7"])
def test_the_worlds_that_are_needed_grow_with_the_square_of_what_is_short(bound: str) -> None:
    """Half of 16 succeed: of 0.3 and 0.7 the estimate is 0.2 away, the end that decides farther."""
    rows = [row(k, outcome="success" if k % 2 else "timeout") for k in range(16)]
    result = judged(f"success.mean {bound}", rows)
    assert result.interval is not None
    end = result.interval.high if "0.7" in bound else result.interval.low
    assert result.verdict == "inconclusive"
    assert abs(end - 0.5) > 0.2
    assert result.worlds_needed == math.ceil(16 * (abs(end - 0.5) / 0.2) ** 2)


@pytest.mark.parametrize(("metric", "value"), [("success", 1.0), ("collisions", 0.0)])
def test_as_many_worlds_as_a_difference_is_said_to_need(metric: str, value: float) -> None:
    gate = read_gate(f"{metric}.rise <= 0.1")

    def result(worlds: int) -> GateResult:
        rows = [row(k, **{metric: value}) for k in range(worlds)]
        [one] = judge(samples_between(rows, rows), [gate], 60.0)
        return one

    needed = result(10).worlds_needed
    assert needed is not None
    assert result(needed).verdict == "held"
    assert result(needed - 3).verdict == "inconclusive"


def test_what_cannot_be_shown_says_so() -> None:
    result = judged("collisions.mean <= 0", [row(k) for k in range(50)])
    assert result.worlds_needed is None
    assert "no number of worlds would decide it" in gate_in_words(result)


def test_all_gates_share_their_error() -> None:
    """With twenty gates each interval is wider, and its line says over how many."""
    rows = [row(k) for k in range(40)]
    alone = judged("success.mean >= 0.9", rows)
    many = judge(samples_of(paired(rows)), [read_gate("success.mean >= 0.9")] * 20)
    assert alone.verdict == "held"
    assert {one.verdict for one in many} == {"inconclusive"}
    assert "95 %, 40 worlds" in gate_in_words(alone)
    assert "simultaneous 95 % over 20 gates" in gate_in_words(many[0])


@pytest.mark.parametrize(
    ("count", "seeds", "digest", "worlds", "verdict"),
    [
        (1, 50, "", 1, "inconclusive"),  # seeds of one imported world are one world
        (12, 1, "the same shape", 1, "inconclusive"),  # and so are copies of it
        (12, 3, "", 12, "held"),
    ],
)
def test_imported_worlds_are_judged_together_by_their_shapes(count, seeds, digest, worlds, verdict):
    arms = [dataclasses.replace(ARM, world=f"yard{k}.xml") for k in range(count)]
    rows = [row(k, arm, world=digest) for arm in arms for k in range(seeds)]
    result = judged("success.mean >= 0.5", rows)
    assert (result.verdict, result.worlds) == (verdict, worlds)
    assert count == 1 or "12 imported worlds drone" in gate_in_words(result)


def test_episodes_that_did_not_run_are_no_evidence() -> None:
    rows = [*(row(k) for k in range(40)), row(40, outcome="error")]
    assert judged("success.mean >= 0.9", rows).worlds == 40
    crashed = dataclasses.replace(row(40, outcome="error"), chain="ab")
    assert judged("success.mean >= 0.9", [*rows[:40], crashed]).worlds == 41


def test_a_figure_of_stacks_on_trial_is_judged_on_their_arms_alone() -> None:
    builtin, gap = (dataclasses.replace(ARM, stack=name) for name in ("builtin", "gap"))
    gate = read_gate("not_admitted.mean <= 0.5")
    rows = [row(seed, builtin) for seed in range(40)]
    ours = judge(samples_of(paired(rows, stack="builtin")), [gate], 60.0)
    assert [(one.arm, one.verdict) for one in ours] == [(builtin, "inconclusive")]
    rows += [row(seed, gap, not_admitted=0.1) for seed in range(40)]
    both = judge(samples_of(paired(rows, stack="builtin")), [gate], 60.0)
    assert [(one.arm, one.verdict) for one in both] == [(gap, "held")]


@pytest.mark.parametrize("first", ["builtin", "gap"])
def test_a_compared_arm_of_the_built_in_stack_is_left_out_too(first: str) -> None:
    """Its own reference, or its place after the first stack, gives it no referee."""
    stacks = {name: dataclasses.replace(ARM, stack=name) for name in ("builtin", "gap")}
    drift = {"perturbation": "pose_drift", "severity": 3.0}
    arms = [*stacks.values(), *(dataclasses.replace(one, **drift) for one in stacks.values())]
    figures = {"builtin": None, "gap": 0.1}
    rows = [row(k, arm, not_admitted=figures[arm.stack]) for arm in arms for k in range(40)]
    gate = read_gate("not_admitted.mean <= 0.5")
    for samples in (samples_of(paired(rows, stack=first)), samples_between(rows, rows)):
        found = judge(samples, [gate], 60.0)
        assert [(one.arm.stack, one.verdict, one.gates) for one in found] == [
            ("gap", "held", 2),
            ("gap", "held", 2),
        ]


def test_a_gate_neither_vanishes_nor_passes_where_no_arm_has_its_figure() -> None:
    builtin, gap = (dataclasses.replace(ARM, stack=name) for name in ("builtin", "gap"))
    rows = [row(k, arm) for arm in (gap, builtin) for k in range(40)]
    mean, rise = (read_gate(f"not_admitted.{one} <= 0.5") for one in ("mean", "rise"))
    for first, arms in (("gap", [gap, builtin]), ("builtin", [gap, gap])):
        found = judge(samples_of(paired(rows, stack=first)), [mean, rise], 60.0)
        assert [(one.arm, one.verdict) for one in found] == [(arm, "inconclusive") for arm in arms]


def test_an_arm_without_its_partner_is_inconclusive() -> None:
    drift = Arm("warehouse", "drone", "", "pose_drift", 3)
    result = judged("success.drop <= 0.5", [row(k, drift) for k in range(9)])
    assert (result.verdict, result.interval) == ("inconclusive", None)
    assert "no episode has this figure" in gate_in_words(result)


def test_a_study_in_which_nothing_ran_is_not_green(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    store = Store(tmp_path / "out")
    study = read_study(written(tmp_path, HEAD + GATED))
    with store.open():
        for one in plan_episodes(study):
            store.record_error(one.key, "the planner could not be loaded")
        store.keep_study(study, contents_of(files_of(study)))
    assert main(["study", str(tmp_path / "study.toml"), "--out", str(store.folder)]) == 3
    printed = capsys.readouterr().out
    first = "2 failed to run, first empty drone, seed 0: the planner could not be loaded"
    assert f"verdict: incomplete: 0 of 0 episodes reached the goal; {first}" in printed
    assert f"next: wayproof report {store.folder}" in printed
    assert not re.search(r"\b(nan|inf)\b", printed)
    assert main(["report", str(store.folder), "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert (document["verdict"], document["gates"][0]["interval"]) == ("incomplete", None)
    page = (store.folder / "report.html").read_text()
    assert first in page
    assert not re.search(r">\s*-?(nan|inf)\b|\((nan|-inf)", page)


def test_a_failed_gate_comes_after_missing_episodes(tmp_path: Path) -> None:
    study = read_study(written(tmp_path, HEAD + GATED.replace("0.1", "0.9")))
    planned = plan_episodes(study)
    arm = planned[0].arm
    lost = [row(k, arm, "timeout") for k in range(2)]
    whole, partial = conclude(study, planned, lost), conclude(study, planned, lost[:1])
    assert (whole.verdict, whole.exit_code()) == ("failed", 1)
    assert (partial.verdict, partial.exit_code()) == ("incomplete", 3)
    assert "1 of 2 have not run" in verdict_in_words(partial)


@pytest.mark.parametrize(
    "path",
    sorted(one for one in PACKAGED.glob("*.toml") if "[import]" not in one.read_text()),
    ids=lambda path: path.stem,
)
def test_packaged_gates_can_be_held_by_their_own_seeds(path: Path) -> None:
    """Where every episode reaches the goal and touches nothing."""
    study = read_study(path.stem)
    planned = plan_episodes(study)
    rows = [row(one.seed, one.arm) for one in planned]
    samples = samples_of(paired(rows, planned[0].arm.variant, planned[0].arm.stack))
    results = judge(samples, [read_gate(one) for one in study.gates], 60.0)
    assert {one.verdict for one in results} <= {"held"}


@pytest.mark.parametrize(
    ("gate", "verdict", "worst"),
    [
        ("success.every >= 1", "failed", 0.0),
        ("collisions.every <= 0", "held", 0.0),
        ("time_to_goal.every <= 60", "held", 60.0),
        ("time_to_goal.every <= 59", "failed", 60.0),
        ("jerk.every <= 3", "inconclusive", None),
    ],
)
def test_a_gate_on_every_episode_is_exact_and_counts_in_no_correction(gate, verdict, worst):
    rows = [row(0, time_to_goal=5.0), row(1, outcome="timeout")]
    result = judged(gate, rows)
    assert result.verdict == verdict
    assert (None if result.interval is None else result.interval.estimate) == worst
    beside = result_of(rows, gate, "collisions.mean <= 1").gates[1]
    assert beside.gates == 1
