"""Gates that may be looked at after every world, and studies that go on until they decide."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest

from tests.harness.study import here
from tests.harness.study.here import HEAD, paired, row, run_here
from tests.harness.study.test_gates import judged
from wayproof.harness.cli.main import main
from wayproof.harness.errors import InputError
from wayproof.harness.statistics.sequential import evidence, mean_sequence, median_sequence
from wayproof.harness.study.analysis import samples_of
from wayproof.harness.study.file import StudyFile, read_study, seeds_of
from wayproof.harness.study.gate import SequentialGate, read_gate
from wayproof.harness.study.gates import gate_in_words, judge, verdict_of
from wayproof.harness.study.looks import continued, run_until_decided
from wayproof.harness.study.plan import Planned, plan_episodes
from wayproof.harness.study.result import StudyResult
from wayproof.harness.study.store import Store
from wayproof.harness.study.study import run_study
from wayproof.models.world_files.options import Ends, Found
from wayproof.models.world_files.world_file import world_text


def test_the_capital_of_a_mixture_by_hand() -> None:
    """Two successes at odds of 2 to 1: whoever bets a share f has (1 + f)^2, and began with w."""
    shares, weights = [1.0, 0.8, 0.55, 0.3, 0.15, 0.06], [5, 2, 2, 2, 2, 2]
    by_hand = sum(w / 15 * (1 + f) ** 2 for f, w in zip(shares, weights, strict=True))
    assert np.exp(evidence(np.ones(2), 0.5)[-1]) == pytest.approx(by_hand)


@pytest.mark.parametrize("rate", [0.5, 0.9, 0.97])
def test_intervals_of_all_looks_together_miss_in_at_most_one_of_twenty(rate: float) -> None:
    rng = np.random.default_rng(1)
    missed = 0
    for _ in range(200):
        found = mean_sequence((rng.random(150) < rate).astype(np.float64), 0.0, 1.0, 0.95)
        missed += not found.low <= rate <= found.high
    assert missed <= 10


def test_a_median_is_bounded_by_ranks_whatever_a_jump() -> None:
    rng = np.random.default_rng(2)
    misses = 0
    for _ in range(100):
        values = rng.lognormal(0.0, 1.0, 100) + 1e9 * (rng.random(100) < 0.03)
        found = median_sequence(values, 0.95)
        misses += not found.low <= 1.0 <= found.high
        assert found.high < 1e3
    assert misses <= 5
    assert median_sequence(np.zeros(3), 0.95).high == np.inf


def test_a_decision_is_never_taken_back() -> None:
    gate = read_gate("success.mean >= 0.6", SequentialGate)
    wins = np.concatenate([np.ones(30), np.zeros(60)])
    verdicts = [verdict_of(gate, mean_sequence(wins[:n], 0.0, 1.0, 0.95)) for n in (5, 30, 60, 90)]
    assert verdicts == ["inconclusive", "held", "held", "held"]


@pytest.mark.parametrize("bound", ["<= 0.3", ">= 0.3", "<= 0.7", ">= 0.7"])
def test_the_worlds_needed_at_any_look_are_the_same_on_either_side(bound: str) -> None:
    """Half of 16 succeed, 0.2 beside the bound: the evidence has to grow to that of 1 in 40."""
    rows = [row(k, outcome="success" if k % 2 else "timeout") for k in range(16)]
    wins = np.arange(16) % 2.0
    [result] = judge(samples_of(paired(rows)), [read_gate(f"success.mean {bound}", SequentialGate)])
    grown = max(float(evidence(wins, 0.3)[-1]), 16 * 0.2**2 / 2)
    assert result.verdict == "inconclusive"
    assert result.worlds_needed == math.ceil(16 * math.log(40) / grown)


@pytest.mark.parametrize(
    ("gate", "figures", "words"),
    [
        ("collisions.mean <= 0.2", {"collisions": 40.0}, "share with any 0.025"),
        ("stops.mean <= 3", {"stops": 1000.0}, "median 0.000"),
        ("jerk.mean <= 3", {"jerk": 1e9}, "median 2.000"),
        ("time_to_goal.mean <= 30", {"time_to_goal": None}, "restricted mean 6.500"),
    ],
)
def test_a_gate_says_what_it_bounds(
    gate: str, figures: dict[str, float | None], words: str
) -> None:
    """One world of 40 stands out, by any size."""
    usual: dict[str, float | None] = {"stops": 0.0, "jerk": 2.0, "time_to_goal": 5.1282051282}
    rows = [row(0, **{**usual, **figures}), *(row(k, **usual) for k in range(1, 40))]
    result = judged(gate, rows)
    assert words in gate_in_words(result)
    assert result.verdict == "held"


STUDY = f"""{HEAD}
seeds = 2
gates = ["success.mean >= 0.5"]
[set]
"episode.time_limit" = 0.5
"map.resolution" = 0.2
"""


def written(folder: Path, *settings: str) -> StudyFile:
    return read_study(here.written(folder, STUDY), settings=settings)


def ran(study: StudyFile, store: Store) -> StudyResult:
    return run_study(study, plan_episodes(study), store, run_here, lambda done: None)


def test_seeds_added_after_a_look_make_gates_sequential_and_none_may_go(tmp_path: Path) -> None:
    store = Store(tmp_path / "out")
    study = written(tmp_path)
    assert continued(study, store) == study
    [first] = ran(study, store).gates
    assert (first.sequential, continued(study, store)) == (False, study)
    with pytest.raises(InputError, match="judged over 2 seeds, so that 1 of them are a choice"):
        continued(written(tmp_path, "seeds=[1]"), store)
    more = continued(written(tmp_path, "seeds=[7, 1, 0]"), store)
    assert (more.sequential, seeds_of(more)) == (True, [0, 1, 7])
    [second] = ran(more, store).gates
    assert "95 % at every look, 3 worlds" in gate_in_words(second)
    assert seeds_of(continued(written(tmp_path), store)) == [0, 1, 7]
    assert not continued(written(tmp_path, "episode.time_limit=0.6"), store).sequential


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--shard", "1/2"], "of a whole study"),
        (["--set", 'worlds=["yard.xml"]'], "is the same world"),
    ],
)
def test_what_seeds_cannot_decide_is_refused_in_a_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], options: list[str], said: str
) -> None:
    written(tmp_path)
    file, out = str(tmp_path / "study.toml"), str(tmp_path / "out")
    assert main(["study", file, "--out", out, "--until-decided", *options]) == 2
    [line] = capsys.readouterr().err.splitlines()
    assert said in line


def test_a_study_adds_seeds_until_it_is_decided(tmp_path: Path, capsys) -> None:
    """No drone arrives within half a second: seven failures show a rate below one half."""
    study = written(tmp_path)
    file, out = str(tmp_path / "study.toml"), str(tmp_path / "out")
    command = ["study", file, "--out", out, "--until-decided", "--at-most", "20", "--jobs", "1"]
    assert main(command) == 1
    assert "decided by 7 of at most 20 seeds: 13 episodes saved" in capsys.readouterr().out
    kept = json.loads((tmp_path / "out" / "study.json").read_text())
    assert (kept["sequential"], kept["seeds"]) == (True, list(range(7)))
    store, sizes = Store(tmp_path / "out"), []

    def run(study: StudyFile, planned: list[Planned]) -> StudyResult:
        sizes.append(len(planned))
        return ran(study, store)

    assert run_until_decided(study, store, at_most=50, jobs=1, run=run).verdict == "failed"
    assert sizes == [7]  # what was decided stays so
    with pytest.raises(InputError, match="at least the 7 seeds"):
        run_until_decided(study, store, at_most=6, jobs=1, run=run)


def test_files_and_their_seeds_are_set_before_the_first_look(tmp_path: Path) -> None:
    """A second seed of a file is no other world, and a second file a choice after the fact."""
    ends = Ends((-3.0, -3.0, -0.5), (3.0, 3.0, 3.0), (-2.0, 0.0, 0.0), 0.0, (2.0, 0.0, 0.0))
    for name in ("a", "b"):
        (tmp_path / f"{name}.xml").write_text(world_text(Found(), ends, name))
    store, first, both = Store(tmp_path / "out"), f"{tmp_path}/a.xml", f"{tmp_path}/b.xml"

    def study(worlds: str, *settings: str) -> StudyFile:
        return written(tmp_path, f"worlds={worlds}", "seeds=1", *settings)

    ran(study(f"{first},{both}"), store)
    [gate] = ran(study(f"{first},{both}"), store).gates
    assert gate.worlds == 1  # both are one empty room
    assert continued(study(f"{first},{both}"), store).sequential is False
    for other in (study(first), study(f"{first},{both}", "seeds=2")):
        with pytest.raises(InputError, match="a choice after the fact"):
            continued(other, store)
